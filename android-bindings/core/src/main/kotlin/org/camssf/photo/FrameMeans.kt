package org.camssf.photo

/**
 * One frame's statistics in the central part of each of n patches. Arrays are row-major, columns R, G, B; each call
 * copies one (24 patches: 0.6 kB), so what a caller writes changes nothing here. Safe to pass between threads.
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
    /** (n, 3) DN, black level still in it; green is the mean of its two positions' means. */
    public val mean: DoubleArray get() = sharedMean.copyOf()

    /** (n, 3) DN, standard error of that mean, from the samples themselves. */
    public val standardError: DoubleArray get() = sharedError.copyOf()

    /** (n, 3) samples that entered. */
    public val count: LongArray get() = ownCount.copyOf()

    /** (n, 3) share of samples at or above the white level, 0 to 1. */
    public val clipped: DoubleArray get() = sharedClipped.copyOf()

    /** (n, 3) share of samples rejected as dust or hot pixels, 0 to 1. */
    public val dead: DoubleArray get() = ownDead.copyOf()

    /** (n, 3) relative change of the signal from edge to edge of the measured part, 1. */
    public val gradient: DoubleArray get() = ownGradient.copyOf()

    /** (n, 2) mean of the green on the red's rows and on the blue's rows, DN. */
    public val greens: DoubleArray get() = ownGreens.copyOf()
}
