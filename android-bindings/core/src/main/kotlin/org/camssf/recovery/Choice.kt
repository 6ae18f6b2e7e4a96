package org.camssf.recovery

import org.camssf.Rules
import kotlin.math.exp
import kotlin.math.ln

/**
 * Chooses the basis, or a mixture of bases, by their marginal likelihoods.
 *
 * The posterior probability of each family of cameras follows from its evidence and its prior odds. A basis with odds
 * of at least [CLEAR] is used alone; otherwise the solutions are mixed by probability, and their bands by the law of
 * total variance (docs/maths.md, "Which basis"). Where the camera seems to belong to no family, the chart may have faded
 * ([FadedChart]); by the probability of such a camera the answer is mixed with that of a wider prior
 * ([UnfamiliarCamera]). Python's camssf.recovery.hypotheses, in its order.
 */
internal object Choice {
    const val AUTO = "auto"

    /** The bases that `auto` chooses from, in this order. */
    val FAMILIES = listOf("phones", "cameras", "ryyb")

    /** Who makes cameras of a family: makers of phones or of cameras, as in the rules' `makers`. */
    val MAKERS_OF = mapOf("phones" to "phones", "cameras" to "cameras", "ryyb" to "phones")

    /** Prior odds of an RYYB sensor against another one in a phone. */
    private val RYYB get() = Rules.shipped.number("choice.ryyb")

    /** Prior odds of phones or cameras if the file names a maker of them. */
    val MAKER get() = Rules.shipped.number("choice.maker")

    /** Posterior odds at which a basis is used alone. */
    val CLEAR get() = Rules.shipped.number("choice.clear")

    /** Solutions of a smaller weight are left out of a mixture. */
    private val NEGLIGIBLE get() = Rules.shipped.number("choice.negligible")

    /**
     * Prior odds by basis: [MAKER] if maker and model start with one of its entries in the rules' `makers`. The model
     * separates makers that build both phones and cameras.
     */
    fun priorOdds(make: String, model: String): Map<String, Double> {
        val name = "$make $model".lowercase()
        return Rules.shipped.makers.filterValues { makers -> makers.any { name.startsWith(it) } }.mapValues { MAKER }
    }

    /** A basis, the width of its prior relative to the learned one, and ln of the prior odds of both. */
    class Family(val engine: Engine, val scale: Double, val belief: Double)

    /**
     * The hypotheses of `auto` at the learned width; `prior` holds the prior odds of phones and cameras, 1 if missing.
     */
    fun families(engines: List<Engine>, prior: Map<String, Double>): List<Family> = engines.map { engine ->
        val odds = prior[MAKERS_OF[engine.basis]] ?: 1.0
        Family(engine, 1.0, ln(odds * if (engine.basis == "ryyb") RYYB else 1.0))
    }

    /**
     * The curves that explain the signals, on the basis or the mixture that their evidence chooses.
     *
     * @param engines of [FAMILIES], in this order.
     * @param prior prior odds of phones and cameras; 1 if missing.
     * @throws org.camssf.CalibrationException as [Recover.recover], for any of the hypotheses.
     */
    fun recover(
        engines: List<Engine>,
        observation: Observation,
        frames: Frames?,
        penalties: Penalties,
        prior: Map<String, Double>,
    ): Ssf {
        val families = families(engines, prior)
        val named = List(observation.signals.shape[0]) { true }
        fun engine(found: Ssf) = engines.first { it.basis == found.basis }
        fun chosen(given: Observation): Pair<Ssf, FamilyTest> {
            val problems = families.map { Problem(it.engine, given, it.scale) }
            val answers = Recover.recover(problems, frames, penalties)
            val found = choose(given.known, answers, families.map { it.belief })
            return found to UnfamiliarCamera.test(engine(found), given, found, named)
        }
        var answer = chosen(observation)
        var fading = 0.0
        if (!answer.second.passed) {
            fading = FadedChart.fading { amounts ->
                val given = amounts.map { observation.faded(it) }
                val nats = families.map { Recover.logEvidences(it.engine, given, it.scale) to it.belief }
                DoubleArray(amounts.size) { i -> logSum(nats.map { (own, belief) -> own[i] + belief }) }
            }
            if (fading > 0.0) answer = chosen(observation.faded(fading))
        }
        val given = observation.faded(fading)
        val (found, test) = answer
        return UnfamiliarCamera.mixed(found, test, { given.known }) {
            Recover.recover(engine(found), given, frames, penalties, UnfamiliarCamera.WIDER).chosen(found.choice)
        }.withFamilyTest(test, fading)
    }

    /** ln Σ e^l without overflow. */
    fun logSum(logarithms: List<Double>): Double {
        val largest = logarithms.max()
        return largest + ln(logarithms.sumOf { exp(it - largest) })
    }

    /** Combines several solutions for the same signals; `beliefs` are the ln of their prior odds. */
    fun choose(known: Known, answers: List<Ssf>, beliefs: List<Double>): Ssf {
        val likely = probabilities(answers.mapIndexed { i, each -> each.logEvidence!! + beliefs[i] })
        val compared = answers.mapIndexed { i, each ->
            Hypothesis(each.basis, each.logEvidence!!, likely[i])
        }
        val weights = posteriorWeights(compared)
        val kept = answers.indices.filter { weights[it] >= NEGLIGIBLE }
        if (kept.size == 1) return answers[kept[0]].chosen(compared)
        val mixture = Mixture(kept.map { answers[it] }, kept.map { weights[it] })
        return mixture.ssf(known, mixture.mean { it.sharedLamp }).chosen(compared)
    }

    /** Mixture weights: if the posterior odds of one basis reach [CLEAR], the other bases get weight 0. */
    fun posteriorWeights(compared: List<Hypothesis>): List<Double> {
        val share = compared.groupBy { it.basis }.mapValues { (_, own) -> own.sumOf { it.probability } }
        val winner = share.maxByOrNull { it.value }!!
        val clear = winner.value >= CLEAR * (1.0 - winner.value)
        val weights = compared.map { if (clear && it.basis != winner.key) 0.0 else it.probability }
        return weights.map { it / weights.sum() }
    }

    /** e^l / Σ e^l without overflow. */
    fun probabilities(logarithms: List<Double>): List<Double> {
        val largest = logarithms.max()
        val weights = logarithms.map { exp(it - largest) }
        return weights.map { it / weights.sum() }
    }
}
