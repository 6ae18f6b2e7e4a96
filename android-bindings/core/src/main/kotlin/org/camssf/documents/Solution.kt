package org.camssf.documents

import org.camssf.fit.Scores
import org.camssf.photo.Assumption
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.Signals
import org.camssf.recovery.Ssf
import org.camssf.verdict.Verdict

/** Share (3) of an error source in the variance of the curves R, G, B, and the size of the error in words. */
internal class Share(val source: String, val size: String, val share: DoubleArray)

/**
 * Width of the uncertainty band and its budget. Half-widths are means over the visible range, relative to the peak.
 *
 * @property alone half-width with each shot alone; empty if there is only one shot.
 * @property budget the error sources; their shares add up to 1.
 */
internal class Uncertainty(
    val halfWidth: Double,
    val halfWidthWithoutPhoto: Double?,
    val alone: List<Double>,
    val budget: List<Share>,
)

/**
 * Predictions for patches in addition to `Ssf.predicted`, (k, n, 3) each unless stated otherwise.
 *
 * @property level (k, n) light correction: signals times this are those under even illumination, according to the
 *   fit.
 * @property std one standard deviation of the true signals minus `Ssf.predicted`; null without a prior.
 * @property unseen cross-validated predictions, by fits without the patch; NaN if every fit used it.
 * @property unseenStd as `std`, for `unseen`.
 */
internal class Predictions(
    val level: DoubleArray,
    val std: DoubleArray?,
    val unseen: DoubleArray,
    val unseenStd: DoubleArray?,
)

/**
 * All results of one calibration, as written to a result document.
 *
 * @property uncertainty null if there is no band.
 */
internal class Solution(
    val capture: MeasuredCapture,
    val signals: Signals,
    val ssf: Ssf,
    val predictions: Predictions,
    val scores: Scores,
    val verdict: Verdict,
    val assumptions: List<Assumption>,
    val uncertainty: Uncertainty?,
)
