package org.camssf.fit

import org.camssf.Rows

/**
 * Predictions of the patches' signals, (k, n, 3) each unless stated otherwise. Safe to pass between threads.
 *
 * @property level (k, n) factor 1 - ĥ that corrects the signals to even light; the product compares with [values].
 *   Ones if the fit had no gain modes, as with a white frame.
 * @property values signals predicted from the curves.
 * @property std one standard deviation of the true signals minus [values]; null on a basis without a prior.
 * @property unseen cross-validated predictions, by fits without the patch; NaN if every fit used it.
 * @property unseenStd as [std], for [unseen].
 */
public class Predictions internal constructor(
    internal val sharedUsed: BooleanArray,
    public val level: Rows,
    public val values: Rows,
    public val std: Rows?,
    public val unseen: Rows,
    public val unseenStd: Rows?,
) {
    /** Whether the patch entered the fit; both from 0. */
    public fun isUsed(shot: Int, patch: Int): Boolean = sharedUsed[shot * level.sides[1] + patch]

    override fun toString(): String = "Predictions(${level.sides[0]} shots, ${level.sides[1]} patches)"
}
