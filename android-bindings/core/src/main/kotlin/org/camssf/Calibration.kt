package org.camssf

import org.camssf.documents.CurvesCsv
import org.camssf.documents.ResultJson
import org.camssf.documents.Solution
import org.camssf.fit.Scores
import org.camssf.photo.Assumption
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.PartialCapture
import org.camssf.photo.Signals
import org.camssf.recovery.Ssf
import org.camssf.verdict.Verdict

/**
 * Options of solving; null takes the default.
 *
 * @param fit 1-based numbers of the patches that enter the fit; null for all, which are then cross-validated fold by
 *   fold. The list is copied.
 * @property l2 the quadratic penalty λ₂.
 * @property gamma the l1 penalty γ. On the paper's basis null chooses it by the discrepancy principle: the largest γ
 *   whose residual is not above the measured noise.
 * @property nonnegative whether all coefficients are ≥ 0; null: only on the paper's basis.
 * @property lightPerPatch relative difference of the light from patch to patch, one standard deviation, if each patch
 *   was photographed separately; 8 % is 0.08. Null if the patches were in one photo.
 * @property previous a stored result of this unit under a named lamp; null if there is none.
 */
public class Settings @JvmOverloads constructor(
    fit: List<Int>? = null,
    public val l2: Double? = null,
    public val gamma: Double? = null,
    public val nonnegative: Boolean? = null,
    public val lightPerPatch: Double? = null,
    public val previous: PreviousResult? = null,
) {
    /** 1-based numbers of the patches that enter the fit; null for all. */
    public val fit: List<Int>? = fit?.frozen()

    private fun parts() = listOf(fit, l2, gamma, nonnegative, lightPerPatch, previous)

    override fun equals(other: Any?): Boolean = other is Settings && parts() == other.parts()

    override fun hashCode(): Int = parts().hashCode()

    override fun toString(): String =
        "Settings(fit=$fit, l2=$l2, gamma=$gamma, nonnegative=$nonnegative, lightPerPatch=$lightPerPatch, " +
            "previous=$previous)"
}

/** The outcome of a capture: [Calibrated] or [Refused]. Immutable; safe to pass between threads. */
public sealed class Calibration {
    /** Accepted, doubtful or refused, with reasons. */
    public abstract val verdict: Verdict

    /** Assumptions made where information was missing; empty if refused. */
    public abstract val assumptions: List<Assumption>

    /**
     * The result as a document, "camssf/2", on one line: what was measured, the answer and the verdict, for
     * `camssf report`, or `camssf solve` to solve it anew. It has no time stamp and no serial number: the same capture
     * gives the same text.
     */
    public abstract fun toJson(): String
}

/**
 * The camera's curves, accepted or doubtful.
 *
 * @property ssf the curves, their bands, their duality gap and the channels' gain.
 * @property signals the measured signals, Eq. (5).
 * @property scores how well the curves predict patches that the fit did not use.
 */
public class Calibrated internal constructor(
    private val solution: Solution,
    private val model: String,
    private val basis: String?,
) : Calibration() {
    public val ssf: Ssf get() = solution.ssf
    public val signals: Signals get() = solution.signals
    public val scores: Scores get() = solution.scores

    /**
     * (k, n) factor 1 - ĥ that corrects the signals to even light, 1; the product compares with [Ssf.predicted]. Ones
     * if the fit had no gain modes, as with a white frame. A copy.
     */
    public fun copyLevel(): DoubleArray = solution.predictions.level.copyOf()
    override val verdict: Verdict get() = solution.verdict
    override val assumptions: List<Assumption> = solution.assumptions.frozen()

    /** The measured shots. */
    public val capture: MeasuredCapture get() = solution.capture

    override fun toJson(): String = ResultJson.of(solution, model, basis)

    override fun toString(): String = "Calibrated($verdict, $ssf)"

    /** The curves as CSV: wavelength_nm,red,green,blue with peak 1, then the standard deviations if there are any. */
    public fun toCsv(): String = CurvesCsv.of(solution.ssf)
}

/**
 * A capture from which no curves can be recovered.
 *
 * @property error the reason; its advice says what to do next.
 */
public class Refused internal constructor(
    public val error: Refusal,
    override val verdict: Verdict,
    private val partial: PartialCapture,
) : Calibration() {
    override val assumptions: List<Assumption> get() = emptyList()

    override fun toJson(): String = ResultJson.of(partial, verdict)

    override fun toString(): String = "Refused($error)"
}
