package org.camssf.photo

/**
 * Statistics of one frame in the central part of each of n patches. Arrays are row-major, columns R, G, B. Each
 * call copies one (24 patches: 0.6 kB), so the caller may modify it. Safe to pass between threads.
 */
public class FrameMeans internal constructor(
    internal val sharedMean: DoubleArray,
    internal val sharedError: DoubleArray,
    private val ownCount: LongArray,
    internal val sharedClipped: DoubleArray,
    private val ownDead: DoubleArray,
    private val ownGradient: DoubleArray,
    private val ownGreens: DoubleArray,
) {
    /** (n, 3) DN, black level included; green is the mean of its two positions' means. */
    public val mean: DoubleArray get() = sharedMean.copyOf()

    /** (n, 3) standard error of the mean, DN, from the scatter of the samples. */
    public val standardError: DoubleArray get() = sharedError.copyOf()

    /** (n, 3) number of samples used. */
    public val count: LongArray get() = ownCount.copyOf()

    /** (n, 3) share of samples at or above the white level, 0 to 1. */
    public val clipped: DoubleArray get() = sharedClipped.copyOf()

    /** (n, 3) share of samples rejected as dust or hot pixels, 0 to 1. */
    public val dead: DoubleArray get() = ownDead.copyOf()

    /** (n, 3) relative change of the signal from edge to edge of the measured part, 1. */
    public val gradient: DoubleArray get() = ownGradient.copyOf()

    /** (n, 2) mean of the green on R's rows and of the green on B's rows, DN. */
    public val greens: DoubleArray get() = ownGreens.copyOf()

    override fun toString(): String = "FrameMeans(${sharedMean.size / 3} patches)"
}
