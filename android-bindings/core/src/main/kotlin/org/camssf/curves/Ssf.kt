package org.camssf.curves

import org.camssf.Grid

/**
 * The recovered spectral sensitivity functions. Arrays are row-major, columns R, G, B; each call copies one (16 kB for a
 * curve of three channels), so what a caller writes changes nothing here: keep the array in a loop. Safe to pass between
 * threads.
 *
 * @property l2 the quadratic penalty.
 * @property basis its name, "cameras" or "gaussian".
 */
public class Ssf internal constructor(
    internal val sharedValues: DoubleArray,
    internal val sharedStd: DoubleArray?,
    internal val sharedCode: DoubleArray,
    internal val sharedPredicted: DoubleArray,
    internal val sharedGap: DoubleArray,
    internal val sharedGamma: DoubleArray,
    public val l2: Double,
    internal val sharedGain: DoubleArray,
    public val basis: String,
    internal val sharedLamp: DoubleArray,
) {
    /** (681, 3) on [Grid], scaled so that Σ ρ_w L s dλ = 1 for the first lamp; [curve] gives peak 1. */
    public val values: DoubleArray get() = sharedValues.copyOf()

    /** (681, 3) posterior standard deviation of the curve of peak 1, times its peak; null where the basis has no prior. */
    public val std: DoubleArray? get() = sharedStd?.copyOf()

    /** (r, 3) coefficients. */
    public val code: DoubleArray get() = sharedCode.copyOf()

    /** (k, n, 3) the signals that these curves give under [lamp], 1. */
    public val predicted: DoubleArray get() = sharedPredicted.copyOf()

    /** (3) relative duality gap of each channel's problem: the proof that came with the answer. */
    public val gap: DoubleArray get() = sharedGap.copyOf()

    /** (3) the l1 penalty of each channel's problem. */
    public val gamma: DoubleArray get() = sharedGamma.copyOf()

    /** (3) raw white signal of each channel relative to green; ones where no frame was given. */
    public val channelGain: DoubleArray get() = sharedGain.copyOf()

    /** (k, 681) each shot's lamp as the answer takes it: as given, but for what the signals say of its modes. */
    public val lamp: DoubleArray get() = sharedLamp.copyOf()

    /** The curve (681) of a channel, 0 red, 1 green, 2 blue, its peak 1. */
    public fun curve(channel: Int): DoubleArray {
        val peak = peak(channel)
        return DoubleArray(Grid.SIZE) { sharedValues[3 * it + channel] / peak }
    }

    /** One standard deviation (681) of [curve]; null where the basis has no prior. */
    public fun deviation(channel: Int): DoubleArray? {
        val peak = peak(channel)
        return sharedStd?.let { std -> DoubleArray(Grid.SIZE) { std[3 * it + channel] / peak } }
    }

    /** Half-width (681) of the 95 % band about [curve], 1.96 standard deviations; null where there is none. */
    public fun band(channel: Int): DoubleArray? =
        deviation(channel)?.let { std -> DoubleArray(std.size) { 1.96 * std[it] } }

    private fun peak(channel: Int): Double {
        require(channel in 0..2) { "there are three channels, 0 to 2, none is $channel" }
        return (0 until Grid.SIZE).maxOf { sharedValues[3 * it + channel] }
    }

    /** What this answer says of shot j alone, of n patches. */
    internal fun only(j: Int, n: Int): Ssf = with(
        sharedPredicted.copyOfRange(3 * n * j, 3 * n * (j + 1)),
        sharedLamp.copyOfRange(Grid.SIZE * j, Grid.SIZE * (j + 1)),
    )

    /** The same curves, which predict these signals (k, n, 3). */
    internal fun predicting(predicted: DoubleArray): Ssf = with(predicted, sharedLamp)

    private fun with(predicted: DoubleArray, lamp: DoubleArray): Ssf = Ssf(
        sharedValues,
        sharedStd,
        sharedCode,
        predicted,
        sharedGap,
        sharedGamma,
        l2,
        sharedGain,
        basis,
        lamp,
    )

    /** Mean half-width of the 95 % band, 400 to 700 nm, in parts of the peak; 0 where there is none. */
    internal val halfWidth: Double
        get() {
            val bands = List(3) { band(it) ?: return 0.0 }
            return (40..640).sumOf { m -> bands.sumOf { it[m] } } / (3 * 601)
        }
}
