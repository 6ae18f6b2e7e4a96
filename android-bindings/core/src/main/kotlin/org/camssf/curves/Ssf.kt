package org.camssf.curves

import org.camssf.Grid

/**
 * The recovered spectral sensitivity functions. Arrays are row-major, columns R, G, B; do not write into them.
 *
 * @property values (681, 3) on [Grid], scaled so that Σ ρ_w L s dλ = 1 for the first lamp; [curve] gives peak 1.
 * @property std (681, 3) posterior standard deviation of the curve of peak 1, times its peak; null where the basis has
 *   no prior.
 * @property code (r, 3) coefficients.
 * @property predicted (k, n, 3) the signals that these curves give under [lamp], 1.
 * @property gap (3) relative duality gap of each channel's problem: the proof that came with the answer.
 * @property gamma (3) the l1 penalty of each channel's problem.
 * @property l2 the quadratic penalty.
 * @property channelGain (3) raw white signal of each channel relative to green; ones where no frame was given.
 * @property basis its name, "cameras" or "gaussian".
 * @property lamp (k, 681) each shot's lamp as the answer takes it: as given, but for what the signals say of its modes.
 */
public class Ssf internal constructor(
    public val values: DoubleArray,
    public val std: DoubleArray?,
    public val code: DoubleArray,
    public val predicted: DoubleArray,
    public val gap: DoubleArray,
    public val gamma: DoubleArray,
    public val l2: Double,
    public val channelGain: DoubleArray,
    public val basis: String,
    public val lamp: DoubleArray,
) {
    /** The curve (681) of a channel, 0 red, 1 green, 2 blue, its peak 1. */
    public fun curve(channel: Int): DoubleArray {
        val peak = peak(channel)
        return DoubleArray(Grid.SIZE) { values[3 * it + channel] / peak }
    }

    /** One standard deviation (681) of [curve]; null where the basis has no prior. */
    public fun deviation(channel: Int): DoubleArray? {
        val peak = peak(channel)
        return std?.let { std -> DoubleArray(Grid.SIZE) { std[3 * it + channel] / peak } }
    }

    /** Half-width (681) of the 95 % band about [curve], 1.96 standard deviations; null where there is none. */
    public fun band(channel: Int): DoubleArray? =
        deviation(channel)?.let { std -> DoubleArray(std.size) { 1.96 * std[it] } }

    private fun peak(channel: Int): Double {
        require(channel in 0..2) { "there are three channels, 0 to 2, none is $channel" }
        return (0 until Grid.SIZE).maxOf { values[3 * it + channel] }
    }

    /** What this answer says of shot j alone, of n patches. */
    internal fun only(j: Int, n: Int): Ssf = Ssf(
        values,
        std,
        code,
        predicted.copyOfRange(3 * n * j, 3 * n * (j + 1)),
        gap,
        gamma,
        l2,
        channelGain,
        basis,
        lamp.copyOfRange(Grid.SIZE * j, Grid.SIZE * (j + 1)),
    )

    internal fun predicting(predicted: DoubleArray): Ssf =
        Ssf(values, std, code, predicted, gap, gamma, l2, channelGain, basis, lamp)
}
