package org.camssf.photo

import org.camssf.Rows

/**
 * Statistics of one frame in the central part of each of n patches, columns R, G, B. Safe to pass between threads.
 */
public class FrameMeans internal constructor(
    internal val sharedMean: DoubleArray,
    internal val sharedError: DoubleArray,
    internal val sharedCount: LongArray,
    internal val sharedClipped: DoubleArray,
    internal val sharedDead: DoubleArray,
    internal val sharedGradient: DoubleArray,
    internal val sharedGreens: DoubleArray,
) {
    /** (n, 3) DN, black level included; green is the mean of its two positions' means. */
    public val mean: Rows get() = rows(sharedMean, 3)

    /** (n, 3) standard error of the mean, DN, from the scatter of the samples. */
    public val standardError: Rows get() = rows(sharedError, 3)

    /** (n, 3) number of samples used. */
    public val count: Rows get() = rows(DoubleArray(sharedCount.size) { sharedCount[it].toDouble() }, 3)

    /** (n, 3) share of samples at or above the white level, 0 to 1. */
    public val clipped: Rows get() = rows(sharedClipped, 3)

    /** (n, 3) share of samples rejected as dust or hot pixels, 0 to 1. */
    public val dead: Rows get() = rows(sharedDead, 3)

    /** (n, 3) relative change of the signal from edge to edge of the measured part, 1. */
    public val gradient: Rows get() = rows(sharedGradient, 3)

    /** (n, 2) mean of the green on R's rows and of the green on B's rows, DN. */
    public val greens: Rows get() = rows(sharedGreens, 2)

    private fun rows(values: DoubleArray, columns: Int) = Rows(values, values.size / columns, columns)

    override fun toString(): String = "FrameMeans(${sharedMean.size / 3} patches)"
}
