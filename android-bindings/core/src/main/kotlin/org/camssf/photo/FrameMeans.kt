package org.camssf.photo

/**
 * Statistics of one frame in the central part of each of n patches. Arrays are row-major, columns R, G, B. Each
 * call copies one (24 patches: 0.6 kB), so the caller may modify it. Safe to pass between threads.
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
    public fun copyMean(): DoubleArray = sharedMean.copyOf()

    /** (n, 3) standard error of the mean, DN, from the scatter of the samples. */
    public fun copyStandardError(): DoubleArray = sharedError.copyOf()

    /** (n, 3) number of samples used. */
    public fun copyCount(): LongArray = sharedCount.copyOf()

    /** (n, 3) share of samples at or above the white level, 0 to 1. */
    public fun copyClipped(): DoubleArray = sharedClipped.copyOf()

    /** (n, 3) share of samples rejected as dust or hot pixels, 0 to 1. */
    public fun copyDead(): DoubleArray = sharedDead.copyOf()

    /** (n, 3) relative change of the signal from edge to edge of the measured part, 1. */
    public fun copyGradient(): DoubleArray = sharedGradient.copyOf()

    /** (n, 2) mean of the green on R's rows and of the green on B's rows, DN. */
    public fun copyGreens(): DoubleArray = sharedGreens.copyOf()

    override fun toString(): String = "FrameMeans(${sharedMean.size / 3} patches)"
}
