package org.camssf.documents

import org.camssf.curves.Ssf
import org.camssf.evidence.Scores
import org.camssf.evidence.Verdict
import org.camssf.photo.Assumption
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.Signals

/**
 * Everything one calibration found: what a result document tells.
 *
 * @property unseen (k, n, 3) predictions of fits that had not seen the patch; NaN where every fit had.
 * @property alone mean half-width of the band with each shot alone, in parts of the peak; null where there is no band.
 */
internal class Solution(
    val capture: MeasuredCapture,
    val signals: Signals,
    val ssf: Ssf,
    val unseen: DoubleArray,
    val scores: Scores,
    val verdict: Verdict,
    val assumptions: List<Assumption>,
    val alone: List<Double>?,
)
