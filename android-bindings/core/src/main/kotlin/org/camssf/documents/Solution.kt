package org.camssf.documents

import org.camssf.fit.Scores
import org.camssf.photo.Assumption
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.Signals
import org.camssf.recovery.Ssf
import org.camssf.verdict.Verdict

/** A source's share (3) in the variance of the curves, and its size in words. */
internal class Share(val source: String, val size: String, val share: DoubleArray)

/**
 * How wide the band is, mean half-width of the visible part in parts of the peak, and why.
 *
 * @property alone the same with each shot alone; empty where there is one.
 * @property budget shares that add up to 1.
 */
internal class Uncertainty(val halfWidth: Double, val alone: List<Double>, val budget: List<Share>)

/**
 * What curves say of patches beside `Ssf.predicted`, (k, n, 3) each.
 *
 * @property level (k, n) times this, signals are what the answer says that even light would have given.
 * @property std one standard deviation of the true signals less `Ssf.predicted`; null without a prior.
 * @property unseen predictions of fits that had not seen the patch; NaN where every fit had.
 * @property unseenStd as `std`, of `unseen`.
 */
internal class Predictions(
    val level: DoubleArray,
    val std: DoubleArray?,
    val unseen: DoubleArray,
    val unseenStd: DoubleArray?,
)

/**
 * Everything one calibration found: what a result document tells.
 *
 * @property uncertainty null where there is no band.
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
