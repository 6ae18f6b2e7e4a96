package org.camssf.fit

import org.camssf.Rows
import org.camssf.frozen
import org.camssf.short

/**
 * One source of the curves' errors.
 *
 * @property source for example "noise" or "lamp".
 * @property size how large its error is, in words.
 */
public class UncertaintySource internal constructor(
    public val source: String,
    public val size: String,
    internal val sharedShare: DoubleArray,
) {
    /** (3) its share of the variance of the curves R, G, B; the shares of all sources add up to 1. */
    public val share: Rows get() = Rows(sharedShare, 3)

    override fun toString(): String = "$source: $size"
}

/**
 * Width of the uncertainty band and its budget. Half-widths are means over 400 to 700 nm, relative to the peak.
 *
 * @property halfWidth of the 95 % band.
 * @property halfWidthWithoutPhoto the same of the basis's mean camera before any photo: what is known of a typical
 *   camera; null if the basis has no prior.
 */
public class Uncertainty internal constructor(
    public val halfWidth: Double,
    public val halfWidthWithoutPhoto: Double?,
    alone: List<Double>,
    budget: List<UncertaintySource>,
) {
    /** Half-width with each shot alone; empty if there is only one shot. */
    public val alone: List<Double> = alone.frozen()

    /** The error sources. */
    public val budget: List<UncertaintySource> = budget.frozen()

    override fun toString(): String = "Uncertainty(halfWidth=${short(halfWidth)}, $budget)"
}
