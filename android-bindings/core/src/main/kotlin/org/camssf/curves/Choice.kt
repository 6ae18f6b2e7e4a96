package org.camssf.curves

import org.camssf.Grid
import org.camssf.Rules
import kotlin.math.exp
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.sqrt

/**
 * Evidence → the basis that answers: phones, cameras, or a mixture of both, by their marginal likelihood.
 *
 * Which family a camera belongs to, and whether it lies as near to it as those that the basis was learned from, is weighed
 * by the evidence of each hypothesis. A clear winner answers alone; else the answers are mixed by their probabilities, and
 * their bands by the law of total variance. Python's camssf.curves.choice, in its order.
 */
internal object Choice {
    const val AUTO = "auto"

    /** The bases that `auto` chooses from, in this order. */
    val FAMILIES = listOf("phones", "cameras")

    /** How much wider a camera may lie than those that its basis was learned from. */
    val SCALES: List<Double> get() = listOf(1.0, Rules.shipped.number("choice.wide"))

    /** What is believed of the second scale beforehand. */
    private val UNUSUAL get() = Rules.shipped.number("choice.unusual")

    /** Odds at which a basis answers alone. */
    private val CLEAR get() = Rules.shipped.number("choice.clear")

    /** An answer of a smaller weight moves no curve. */
    private const val NEGLIGIBLE = 1e-6

    /** What a file's own word for the maker says of the basis beforehand: odds by basis, never a proof. */
    fun believed(make: String): Map<String, Double> {
        val name = make.lowercase()
        return Rules.shipped.makers.filterValues { makers -> makers.any { name.startsWith(it) } }.mapValues { CLEAR }
    }

    /**
     * The curves that explain the signals, on the basis that they speak for.
     *
     * @param engines of [FAMILIES], in this order.
     * @param prior the odds of each family beforehand; equal where nothing is said.
     * @throws org.camssf.CalibrationException as [Recover.recover] does, of any of the four answers.
     */
    fun recover(
        engines: List<Engine>,
        evidence: Evidence,
        frames: Frames?,
        penalties: Penalties,
        prior: Map<String, Double>,
    ): Ssf {
        val answers = engines.flatMap { engine ->
            SCALES.map { Recover.recover(engine, evidence, frames, penalties, it) }
        }
        val beliefs = engines.flatMap { engine ->
            listOf(1.0 - UNUSUAL, UNUSUAL).map { ln((prior[engine.basis] ?: 1.0) * it) }
        }
        return choose(evidence.known, answers, beliefs)
    }

    /**
     * One answer of several to the same signals, each with ln of what was believed of it beforehand. A basis that is
     * [CLEAR] times as probable as all others answers alone, with its own scales mixed.
     */
    fun choose(known: Known, answers: List<Ssf>, beliefs: List<Double>): Ssf {
        val likely = probabilities(answers.mapIndexed { i, each -> each.logEvidence!! + beliefs[i] })
        val told = answers.mapIndexed { i, each ->
            Weight(each.basis, each.priorScale, each.logEvidence!!, likely[i])
        }
        val share = told.groupBy { it.basis }.mapValues { (_, own) -> own.sumOf { it.probability } }
        val winner = share.maxByOrNull { it.value }!!
        val clear = winner.value >= CLEAR * (1.0 - winner.value)
        val weights = told.map { if (clear && it.basis != winner.key) 0.0 else it.probability }
        return mixed(known, answers, weights.map { it / weights.sum() }).chosen(told)
    }

    /** e^l / Σ e^l without overflow. */
    private fun probabilities(logarithms: List<Double>): List<Double> {
        val largest = logarithms.max()
        val weights = logarithms.map { exp(it - largest) }
        return weights.map { it / weights.sum() }
    }

    /**
     * The mixture of answers to the same signals; all that belongs to a basis is the likeliest answer's.
     *
     * Curves of peak 1 are mixed, s̄ = Σ w s, and their variance is Σ w (σ² + (s - s̄)²).
     */
    private fun mixed(known: Known, answers: List<Ssf>, weights: List<Double>): Ssf {
        val kept = answers.indices.filter { weights[it] > NEGLIGIBLE }
        val best = answers[kept.maxByOrNull { weights[it] }!!]
        if (kept.size == 1) return best
        val total = kept.sumOf { weights[it] }
        val parts = kept.map { Part(answers[it], weights[it] / total) }
        val mean = DoubleArray(3 * Grid.SIZE) { at -> parts.sumOf { it.share * it.curves[at] } }
        val lamp = DoubleArray(best.sharedLamp.size) { at -> parts.sumOf { it.share * it.of.sharedLamp[at] } }
        val white = known.whiteReflectance.values
        val scale = DoubleArray(3) { c ->
            (0 until Grid.SIZE).sumOf { white[it] * known.lamp.values[it] * Grid.STEP * mean[3 * it + c] }
        }
        val std = best.sharedStd?.let {
            DoubleArray(mean.size) { at ->
                val variance = parts.sumOf { part ->
                    val off = part.curves[at] - mean[at]
                    part.share * (part.bands!![at] * part.bands[at] + off * off)
                }
                sqrt(variance) / scale[at % 3]
            }
        }
        val values = DoubleArray(mean.size) { mean[it] / scale[it % 3] }
        fun largest(of: (Ssf) -> DoubleArray): DoubleArray =
            parts.map { of(it.of) }.reduce { a, b -> DoubleArray(a.size) { max(a[it], b[it]) } }
        val steps = parts.map { it.of.sharedFinishSteps }
            .reduce { a, b -> IntArray(a.size) { max(a[it], b[it]) } }
        val proof = Ssf.Proof(largest { it.sharedGap }, largest { it.sharedLayersGap }, steps, best.logEvidence)
        val predicted = respond(values, known.reflectance.values, lamp, white)
        return best.mixed(values, std, predicted, lamp, proof)
    }

    /** An answer at peak 1, and its weight. */
    private class Part(val of: Ssf, val share: Double) {
        private val peak = DoubleArray(3) { c -> (0 until Grid.SIZE).maxOf { of.sharedValues[3 * it + c] } }
        val curves = DoubleArray(3 * Grid.SIZE) { of.sharedValues[it] / peak[it % 3] }
        val bands = of.sharedStd?.let { std -> DoubleArray(std.size) { std[it] / peak[it % 3] } }
    }
}
