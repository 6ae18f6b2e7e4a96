package org.camssf.recovery

import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.Rules
import kotlin.math.ln
import kotlin.math.min
import kotlin.math.sqrt

/**
 * A hypothesis on the lights.
 *
 * @property kinds of each shot, "" where its lamp was named.
 * @property evidence the signals, with the lamps as these kinds have them.
 */
internal class LampGuess(val kinds: List<String>, val observation: Observation) {
    /** ln of how probable it is beforehand. */
    val belief: Double get() = kinds.filter { it.isNotEmpty() }.sumOf { ln(Rules.shipped.number("lamp.$it")) }
}

/**
 * Evidence under a light that nobody named → the curves, and the light, by the evidence of each kind: Python's
 * camssf.recovery.unnamed_light, in its order.
 *
 * One hypothesis is the kind of every unnamed shot, a basis and how wide its prior is taken. The model weighs all of them;
 * those that matter are believed, and mixed by the law of total variance (docs/maths.md, "A light that nobody named").
 *
 * @param asked bases and widths, with what is believed of them beforehand.
 * @param tell called before each run of a model.
 */
internal class AnyLight(
    private val asked: List<Choice.Family>,
    private val frames: Frames,
    private val penalties: Penalties,
    private val tell: () -> Unit,
) {
    private class LampHypothesis(val guess: LampGuess, val family: Choice.Family)

    /**
     * The curves that explain the signals, whatever the light was.
     *
     * @param guesses what the lights may be.
     * @param of (n, 681) reflectances whose signals are predicted.
     * @throws InvalidArgument a basis without a prior, which weighs nothing; else as [Recover.recover].
     * @throws org.camssf.NotConverged as [Recover.recover] does, of an answer that matters.
     */
    fun recover(guesses: List<LampGuess>, of: DoubleArray): Ssf {
        if (asked.any { it.engine.basis == OnnxEngine.PAPER }) {
            throw InvalidArgument(
                "The ${OnnxEngine.PAPER} basis has no prior, so it cannot tell one light from another.",
                "Name the lamp, or take the basis phones.",
            )
        }
        val hypotheses = asked.flatMap { family -> guesses.map { LampHypothesis(it, family) } }
        val attempts = hypotheses.map { each ->
            tell()
            Recover.attempt(each.family.engine, each.guess.observation, frames, penalties, each.family.scale)
        }
        val nats = attempts.map { it.logEvidence }
        val likely = Choice.probabilities(
            hypotheses.mapIndexed { i, each -> nats[i] + (each.guess.belief + each.family.belief) },
        )
        val told = hypotheses.mapIndexed { i, each ->
            Hypothesis(each.family.engine.basis, each.family.scale, nats[i], likely[i], each.guess.kinds)
        }
        val weights = Choice.posteriorWeights(told)
        val least = min(SOLVED, weights.max())
        val kept = weights.indices.filter { weights[it] >= least }
        val answers = kept.map { attempts[it].checkConverged() }
        val mixture = Mixture(answers, kept.map { weights[it] })
        val seen = kept.map { light(hypotheses[it]) }
        val lights = guesses[0].kinds.indices.map { j ->
            if (guesses[0].kinds[j].isEmpty()) null else found(seen.map { it[j] }, mixture.shares, told, j)
        }
        val best = hypotheses[kept[mixture.best]].guess
        val white = best.observation.known.whiteReflectance.values
        // The product of curve and light is known far better than each: means of products, not products of means.
        val predicted = mixture.mean { predictSignals(it.sharedValues, of, it.sharedLamp, white) }
        val lamp = mixture.mean { levelled(it.sharedLamp) }
        val ssf = mixture.ssf(best.observation.known, lamp, predicted)
        return ssf.chosen(told, lights, best.kinds, mixture.between())
    }

    /** Each shot's lamp under a hypothesis: its smooth error is asked as modes, too. */
    private fun light(of: LampHypothesis): List<LampPosterior> {
        tell()
        val asked = LampPosterior.byModes(of.guess.observation)
        return LampPosterior.of(asked.known, Recover.modes(of.family.engine, asked, of.family.scale))
    }

    /** Shot j's light: the mixture of the posteriors; probabilities are those of all hypotheses. */
    private fun found(
        seen: List<LampPosterior>,
        shares: List<Double>,
        told: List<Hypothesis>,
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
        val kinds = told.groupBy { it.kinds[j] }.mapValues { (_, own) -> min(own.sumOf { it.probability }, 1.0) }
        return EstimatedLamp(kinds, mean, std, kelvin, sqrt(spread))
    }

    /** Lamps (k, 681), each of mean 1. */
    private fun levelled(lamp: DoubleArray): DoubleArray {
        val levels = DoubleArray(lamp.size / Grid.SIZE) { j ->
            (0 until Grid.SIZE).sumOf { lamp[j * Grid.SIZE + it] } / Grid.SIZE
        }
        return DoubleArray(lamp.size) { lamp[it] / levels[it / Grid.SIZE] }
    }

    companion object {
        /** A hypothesis of less weight is not solved. */
        private val SOLVED get() = Rules.shipped.number("lamp.solved")

        /** Shots whose light nobody named. */
        val MOST: Int get() = Rules.shipped.whole("lamp.most")
    }
}
