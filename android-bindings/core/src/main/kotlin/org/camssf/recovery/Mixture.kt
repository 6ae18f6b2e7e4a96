package org.camssf.recovery

import org.camssf.Grid
import kotlin.math.max
import kotlin.math.sqrt

/**
 * Mixes solutions for the same signals by the law of total variance.
 *
 * Curves of peak 1 are mixed, s̄ = Σ w s, and their variance is Σ w (σ² + (s - s̄)²).
 *
 * @param weights of any positive sum.
 */
internal class Mixture(private val answers: List<Ssf>, weights: List<Double>) {
    val shares: List<Double> = weights.map { it / weights.sum() }
    private val parts = answers.indices.map { Part(answers[it], shares[it]) }

    /** Index of the most probable solution. */
    val best: Int = shares.indices.maxByOrNull { shares[it] }!!

    /** (681, 3) mean curves of peak 1. */
    private val mean = DoubleArray(3 * Grid.SIZE) { at -> parts.sumOf { it.share * it.curves[at] } }

    /**
     * The mixture; what depends on one basis or one lamp is that of the most probable solution.
     *
     * @param known the known quantities of that solution; its first lamp fixes the scale.
     * @param lamp (k, 681) of the mixture.
     * @param predicted (k, n, 3); null to predict from the mean curves.
     */
    fun ssf(known: Known, lamp: DoubleArray, predicted: DoubleArray? = null): Ssf {
        val white = known.whiteReflectance.values
        val likeliest = answers[best]
        val (values, std) = scaled(known)
        val seen = predicted ?: predictSignals(values, known.reflectance.values, lamp, white)
        return likeliest.mixed(values, std, seen, lamp, mean { it.sharedGainCode }, proof())
    }

    /**
     * The mixture of the answers of two widths of one prior: curves and bands are mixed, and under lights that are not
     * named the predictions; all else is the likelier's.
     *
     * @param known of an answer: what was known under its hypothesis.
     */
    fun ofTwoWidths(known: (Ssf) -> Known): Ssf {
        val likelier = answers[best]
        val own = known(likelier)
        val (values, std) = scaled(own)
        val predicted = if (likelier.kinds.isEmpty()) {
            val white = own.whiteReflectance.values
            predictSignals(values, own.reflectance.values, likelier.sharedLamp, white)
        } else {
            mean { it.sharedPredicted }
        }
        val inside = DoubleArray(3) { c -> sumOf(likelier, c) / (0 until Grid.SIZE).sumOf { variance(3 * it + c) } }
        val between = likelier.between?.let { own -> DoubleArray(3) { own[it] * inside[it] } }
        return likelier.ofTwoWidths(values, std, predicted, proof(), between)
    }

    /** Σ over the grid of the variance of an answer's curve of peak 1. */
    private fun sumOf(answer: Ssf, c: Int): Double = answer.deviation(c)!!.sumOf { it * it }

    /** The largest of each gap, and the most steps, of the answers. */
    private fun proof(): Ssf.Proof {
        val steps = answers.map { it.sharedFinishSteps }
            .reduce { a, b -> IntArray(a.size) { max(a[it], b[it]) } }
        return Ssf.Proof(largest { it.sharedGap }, largest { it.sharedLayersGap }, steps, answers[best].logEvidence)
    }

    /** Mean curves and their standard deviations, such that Σ ρ_w L s dλ = 1 for the first lamp. */
    private fun scaled(known: Known): Pair<DoubleArray, DoubleArray?> {
        val white = known.whiteReflectance.values
        val scale = DoubleArray(3) { c ->
            (0 until Grid.SIZE).sumOf { white[it] * known.lamp.values[it] * Grid.STEP * mean[3 * it + c] }
        }
        val std = answers[best].sharedStd?.let {
            DoubleArray(mean.size) { at -> sqrt(variance(at)) / scale[at % 3] }
        }
        return DoubleArray(mean.size) { mean[it] / scale[it % 3] } to std
    }

    /** [Ssf.halfWidth] of the mixture. */
    fun halfWidth(): Double {
        val visible = (40..640).flatMap { m -> (0..2).map { 3 * m + it } }
        return BAND * visible.sumOf { at -> sqrt(variance(at)) } / visible.size
    }

    private fun variance(at: Int): Double = parts.sumOf { part ->
        val off = part.curves[at] - mean[at]
        part.share * (part.bands!![at] * part.bands[at] + off * off)
    }

    /** (3) share of each channel's variance that is between the solutions. */
    fun between(): DoubleArray = DoubleArray(3) { c ->
        val (apart, own) = listOf<(Part, Int) -> Double>(
            { part, at -> (part.curves[at] - mean[at]).let { it * it } },
            { part, at -> part.bands!![at] * part.bands[at] },
        ).map { square -> (0 until Grid.SIZE).sumOf { m -> parts.sumOf { it.share * square(it, 3 * m + c) } } }
        apart / (apart + own)
    }

    /** Σ w v, where `of` returns v of each solution. */
    fun mean(of: (Ssf) -> DoubleArray): DoubleArray {
        val each = answers.map(of)
        return DoubleArray(each[0].size) { at -> each.indices.sumOf { shares[it] * each[it][at] } }
    }

    private fun largest(of: (Ssf) -> DoubleArray): DoubleArray =
        answers.map(of).reduce { a, b -> DoubleArray(a.size) { max(a[it], b[it]) } }

    /** A solution at peak 1, and its weight. */
    private class Part(of: Ssf, val share: Double) {
        private val peak = DoubleArray(3) { c -> (0 until Grid.SIZE).maxOf { of.sharedValues[3 * it + c] } }
        val curves = DoubleArray(3 * Grid.SIZE) { of.sharedValues[it] / peak[it % 3] }
        val bands = of.sharedStd?.let { std -> DoubleArray(std.size) { std[it] / peak[it % 3] } }
    }
}
