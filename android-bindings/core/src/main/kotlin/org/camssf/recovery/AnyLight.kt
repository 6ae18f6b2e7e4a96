package org.camssf.recovery

import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.Rules
import org.camssf.spectra.Bundled
import org.camssf.spectra.Lamp
import org.camssf.spectra.faded
import kotlin.math.max
import kotlin.math.min
import kotlin.math.sqrt

/**
 * A hypothesis on the kinds of light.
 *
 * @property kinds of each shot, "" where its lamp was named.
 * @property observation with the lamps of these kinds.
 * @property belief ln of its prior probability.
 * @property tabulated whether the lamp of a shot is that of a table, so that the curves have the learned prior.
 */
internal class LampGuess(
    val kinds: List<String>,
    val observation: Observation,
    val belief: Double,
    val tabulated: Boolean = false,
) {
    /** The same with a chart that has faded by `amount`. */
    fun faded(amount: Double): LampGuess = LampGuess(kinds, observation.faded(amount), belief, tabulated)
}

/**
 * Recovers the curves and the light of shots whose lamp is not named, by the evidence of each kind of light. Python's
 * camssf.recovery.unnamed_light, in its order.
 *
 * A hypothesis is the kind of light of every unnamed shot, and a basis. The model computes the evidence of each; those
 * of enough weight must have converged, and are mixed by the law of total variance (docs/maths.md, "Unnamed light").
 *
 * @param families bases and widths of their priors, with their prior odds; several if the signals choose the basis.
 * @param onRun called before each run of a model.
 */
internal class AnyLight(
    private val families: List<Choice.Family>,
    private val frames: Frames,
    private val penalties: Penalties,
    private val onRun: () -> Unit,
) {
    private class LampHypothesis(val guess: LampGuess, val family: Choice.Family) {
        /** ln of its prior odds. */
        val logPrior: Double get() = guess.belief + family.belief
    }

    /**
     * The curves that explain the signals under lights that are not named.
     *
     * @param guesses the possible kinds of the lights.
     * @param of (n, 681) reflectances whose signals are predicted.
     * @throws InvalidArgument a basis without a prior, which has no evidence; else as [Recover.recover].
     * @throws org.camssf.NotConverged as [Recover.recover], for a hypothesis of enough weight.
     */
    fun recover(guesses: List<LampGuess>, of: DoubleArray): Ssf {
        if (families.any { it.engine.basis == OnnxEngine.PAPER }) {
            throw InvalidArgument(
                "The ${OnnxEngine.PAPER} basis has no prior, so the light cannot be estimated.",
                "Name the lamp, or take the basis phones.",
            )
        }
        val narrowed = narrowed(families, guesses)
        if (families.size == 1) return weighed(narrowed, guesses, of)
        fun named(found: Ssf) = found.kinds.map { Lamp.kindOf(it) == null }
        fun engine(found: Ssf) = families.first { it.engine.basis == found.basis }.engine
        fun chosen(fading: Double): Pair<Ssf, FamilyTest> {
            val seen = guesses.map { it.faded(fading) }
            val found = weighed(narrowed, seen, faded(of, fading))
            val best = seen.first { it.kinds == found.kinds }
            onRun()
            val learned = Recover.recover(engine(found), best.observation, frames, penalties)
            return found to UnfamiliarCamera.test(engine(found), best.observation, learned, named(found))
        }
        var answer = chosen(0.0)
        var fading = 0.0
        if (!answer.second.passed) {
            fading = FadedChart.fading { amounts ->
                val faded = amounts.flatMap { amount -> guesses.map { it.faded(amount) } }
                val hypotheses = faded.flatMap { guess -> narrowed.map { LampHypothesis(guess, it) } }
                val log = joint(hypotheses, evidences(hypotheses, onRun)).chunked(guesses.size * narrowed.size)
                DoubleArray(amounts.size) { Choice.logSum(log[it]) }
            }
            if (fading > 0.0) answer = chosen(fading)
        }
        val (found, test) = answer
        val possible = guesses.map { it.faded(fading) }
        fun known(answer: Ssf) = possible.first { it.kinds == answer.kinds }.observation.known
        return UnfamiliarCamera.mixed(found, test, ::known) {
            val own = families.first { it.engine.basis == found.basis }
            val wider = listOf(Choice.Family(own.engine, UnfamiliarCamera.WIDER, own.belief))
            val wide = weighed(wider, possible, faded(of, fading))
            wide.chosen(found.choice, wide.lights, wide.kinds, wide.between, wide.halfWidthOfBasis)
        }.withFamilyTest(test, fading)
    }

    /** The mixture of the hypotheses of these families. */
    private fun weighed(families: List<Choice.Family>, guesses: List<LampGuess>, of: DoubleArray): Ssf {
        val hypotheses = families.flatMap { family -> guesses.map { LampHypothesis(it, family) } }
        val nats = evidences(hypotheses, onRun)
        val likely = Choice.probabilities(joint(hypotheses, nats))
        val compared = hypotheses.mapIndexed { i, each ->
            Hypothesis(each.family.engine.basis, nats[i], likely[i], each.guess.kinds)
        }
        val weights = Choice.posteriorWeights(compared)
        val least = min(SOLVED, weights.max())
        val kept = weights.indices.filter { weights[it] >= least }
        val answers = answers(kept.map { hypotheses[it] })
        val mixture = Mixture(answers, kept.map { weights[it] })
        val seen = posteriors(kept.map { hypotheses[it] })
        val lights = guesses[0].kinds.indices.map { j ->
            if (guesses[0].kinds[j].isEmpty()) null else found(seen.map { it[j] }, mixture.shares, compared, j)
        }
        val best = hypotheses[kept[mixture.best]].guess
        val white = best.observation.known.whiteReflectance.values
        // The product of curve and light has a much smaller error than each factor: mix products, do not multiply
        // means.
        val predicted = mixture.mean { predictSignals(it.sharedValues, of, it.sharedLamp, white) }
        val lamp = mixture.mean { levelled(it.sharedLamp) }
        val ssf = mixture.ssf(best.observation.known, lamp, predicted)
        val own = answers.indices.filter { answers[it].basis == ssf.basis }
        val width = Mixture(own.map { answers[it] }, own.map { mixture.shares[it] }).halfWidth()
        return ssf.chosen(compared, lights, best.kinds, mixture.between(), width)
    }

    /**
     * The answers of hypotheses; one of a narrowed prior has the bands of the learned one.
     *
     * Under an unnamed light a wide prior draws the curves off the family's mean, since the signals determine only the
     * product of light and curve; but a camera may be as far from that mean as the learned width says. The code is given
     * in units of the learned width: s = μ + w Ψ x = μ + Ψ (w x).
     */
    private fun answers(hypotheses: List<LampHypothesis>): List<Ssf> {
        fun solved(some: List<LampHypothesis>, width: (LampHypothesis) -> Double): List<Ssf> {
            onRun()
            val problems = some.map { Problem(it.family.engine, it.guess.observation, width(it)) }
            return Recover.recover(problems, frames, penalties)
        }
        val own = solved(hypotheses) { if (it.guess.tabulated) max(it.family.scale, 1.0) else it.family.scale }
        val narrow = hypotheses.indices.filter {
            hypotheses[it].family.scale < 1.0 && !hypotheses[it].guess.tabulated
        }
        if (narrow.isEmpty()) return own
        val wide = narrow.zip(solved(narrow.map { hypotheses[it] }) { 1.0 }).toMap()
        return own.mapIndexed { i, answer ->
            wide[i]?.let { answer.withBandsOf(it, hypotheses[i].family.scale) } ?: answer
        }
    }

    /** Posterior of each shot's lamp under each hypothesis; its smooth error is expressed as modes too. */
    private fun posteriors(hypotheses: List<LampHypothesis>): List<List<LampPosterior>> {
        onRun()
        val problems = hypotheses.map {
            Problem(it.family.engine, LampPosterior.byModes(it.guess.observation), it.family.scale)
        }
        return problems.zip(Recover.modes(problems)).map { (problem, modes) ->
            LampPosterior.of(problem.observation.known, modes)
        }
    }

    /** Shot j's light: the mixture of the solved hypotheses' posteriors; `kinds` sums over all hypotheses. */
    private fun found(
        seen: List<LampPosterior>,
        shares: List<Double>,
        compared: List<Hypothesis>,
        j: Int,
    ): EstimatedLamp {
        val mean = DoubleArray(Grid.SIZE) { at -> seen.indices.sumOf { shares[it] * seen[it].power[at] } }
        val std = DoubleArray(Grid.SIZE) { at ->
            sqrt(
                seen.indices.sumOf { i ->
                    val off = seen[i].power[at] - mean[at]
                    shares[i] * (seen[i].variance[at] + off * off)
                },
            )
        }
        val kelvin = seen.indices.sumOf { shares[it] * seen[it].kelvin }
        val spread = seen.indices.sumOf { i ->
            val off = seen[i].kelvin - kelvin
            shares[i] * (seen[i].kelvinVariance + off * off)
        }
        val shares = compared.groupBy { Lamp.kindOf(it.kinds[j]) ?: EstimatedLamp.NAMED }
            .mapValues { (_, own) -> min(own.sumOf { it.probability }, 1.0) }
        val called = EstimatedLamp.NAMED in shares
        val names = if (called) shares.keys else Bundled.families
        val other = if (called) 0.0 else NO_KIND
        val kinds = names.associateWith { (1.0 - other) * (shares[it] ?: 0.0) + other / names.size }
        return EstimatedLamp(kinds, mean, std, kelvin, sqrt(spread))
    }

    /** Scales lamps (k, 681) to mean 1 each. */
    private fun levelled(lamp: DoubleArray): DoubleArray {
        val levels = DoubleArray(lamp.size / Grid.SIZE) { j ->
            (0 until Grid.SIZE).sumOf { lamp[j * Grid.SIZE + it] } / Grid.SIZE
        }
        return DoubleArray(lamp.size) { lamp[it] / levels[it / Grid.SIZE] }
    }

    companion object {
        /** Width of a phones' prior for the curves, relative to the learned one, where no light is named. */
        private val NARROW get() = Rules.shipped.number("lamp.narrow")

        /** Smallest probability, by its own shot alone, of a kind that is combined with those of other shots. */
        private val SCREENED get() = Rules.shipped.number("lamp.screened")

        /** Most combinations of several shots' lamps that are weighed. */
        private val COMBINED get() = Rules.shipped.number("lamp.combined").toInt()

        /** The families, with a narrower prior of phones where no light is named. */
        private fun narrowed(families: List<Choice.Family>, guesses: List<LampGuess>): List<Choice.Family> {
            if (guesses.any { guess -> guess.kinds.any { it.isEmpty() } }) return families
            return families.map {
                val scale = if (Choice.MAKERS_OF[it.engine.basis] == "phones") NARROW else 1.0
                Choice.Family(it.engine, scale * it.scale, it.belief)
            }
        }

        /** The kinds of one shot's light that are probable enough to be combined with those of other shots. */
        fun likelyKinds(
            families: List<Choice.Family>,
            guesses: List<LampGuess>,
            onRun: () -> Unit,
        ): List<Pair<String, Double>> {
            val hypotheses =
                narrowed(families, guesses).flatMap { family -> guesses.map { LampHypothesis(it, family) } }
            val likely = Choice.probabilities(joint(hypotheses, evidences(hypotheses, onRun)))
            return guesses.map { it.kinds[0] }.map { kind ->
                kind to hypotheses.indices.filter { hypotheses[it].guess.kinds[0] == kind }.sumOf { likely[it] }
            }.filter { it.second >= SCREENED }
        }

        /**
         * The combinations of the shots' kinds, at most COMBINED of them: the most probable by each shot alone, in the
         * order of the kinds; of equally probable ones the first stay.
         */
        fun combined(kinds: List<List<Pair<String, Double>>>): List<List<String>> =
            kinds.fold(listOf(emptyList<String>() to 1.0)) { some, own ->
                val every = some.flatMap { (before, p) -> own.map { (kind, share) -> before + kind to p * share } }
                val best = every.indices.sortedByDescending { every[it].second }.take(COMBINED)
                best.sorted().map { every[it] }
            }.map { it.first }

        /** ln of the evidence of each hypothesis; those of one family are computed together. */
        private fun evidences(hypotheses: List<LampHypothesis>, onRun: () -> Unit): DoubleArray {
            val found = DoubleArray(hypotheses.size)
            for ((family, own) in hypotheses.indices.groupBy { hypotheses[it].family }) {
                for (some in own.chunked(Recover.stackOf(hypotheses[0].guess.kinds.size))) {
                    onRun()
                    val observations = some.map { hypotheses[it].guess.observation }
                    val nats = Recover.logEvidences(family.engine, observations, family.scale)
                    some.forEachIndexed { i, at -> found[at] = nats[i] }
                }
            }
            return found
        }

        /** The same plus ln of the prior odds. */
        private fun joint(hypotheses: List<LampHypothesis>, nats: DoubleArray): List<Double> =
            hypotheses.mapIndexed { i, each -> nats[i] + each.logPrior }

        /** Prior probability of a light that is of no kind; any kind may be taken for it. */
        private val NO_KIND get() = Rules.shipped.number("lamp.no_kind")

        /** Hypotheses of a smaller weight are left out of the mixture. */
        private val SOLVED get() = Rules.shipped.number("lamp.solved")

        /** Largest number of shots with an unnamed light. */
        val MOST: Int get() = Rules.shipped.whole("lamp.most")
    }
}
