package org.camssf

import org.camssf.documents.CurvesCsv
import org.camssf.documents.ResultJson
import org.camssf.documents.Solution
import org.camssf.fit.Scores
import org.camssf.photo.Assumption
import org.camssf.photo.Begun
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.Signals
import org.camssf.recovery.Ssf
import org.camssf.verdict.Verdict

/**
 * How to solve; null takes the default.
 *
 * @param fit 1-based numbers of the patches that enter the fit; null for all, validated fold by fold; copied.
 * @property l2 the quadratic penalty λ₂.
 * @property gamma the l1 penalty γ; on the paper's basis null chooses it by the discrepancy principle: the largest γ whose
 *   residual is not above the measured noise.
 * @property nonnegative coefficients ≥ 0; null asks for it on the paper's basis.
 * @property lightPerPatch how much the light may differ from patch to patch where each was photographed for itself, 8 % is
 *   0.08; null where they stood in one photo.
 */
public class Settings @JvmOverloads constructor(
    fit: List<Int>? = null,
    public val l2: Double? = null,
    public val gamma: Double? = null,
    public val nonnegative: Boolean? = null,
    public val lightPerPatch: Double? = null,
) {
    /** 1-based numbers of the patches that enter the fit; null for all. */
    public val fit: List<Int>? = fit?.frozen()
}

/** Called with a stage in words and the part done, 0 to 1, on the thread that calibrates. */
public fun interface Progress {
    /** One step. */
    public fun report(stage: String, part: Double)
}

/** What came of a capture: [Calibrated], or [Refused]. Nobody can change it; safe to pass between threads. */
public sealed class Calibration {
    /** Accepted, doubtful or refused, with reasons. */
    public abstract val verdict: Verdict

    /** What was assumed where something was missing. */
    public abstract val assumptions: List<Assumption>

    /**
     * The result as "camssf-result/1", which `camssf report` and `camssf validate` read. It holds no time stamp: the same
     * capture gives the same text.
     */
    public abstract fun toJson(): String
}

/**
 * The camera's curves, accepted or doubtful.
 *
 * @property ssf the curves, their bands, their duality gap and the channels' gain.
 * @property signals what was measured: Eq. (5).
 * @property scores how well the curves explain patches that they have not seen.
 */
public class Calibrated internal constructor(private val solution: Solution, private val model: String) :
    Calibration() {
    public val ssf: Ssf get() = solution.ssf
    public val signals: Signals get() = solution.signals
    public val scores: Scores get() = solution.scores

    /**
     * (k, n) times this, the signals are what the answer says that even light would have given, 1: to be held against the
     * predictions. Ones where a white frame says how the light fell; a copy at each call.
     */
    public val level: DoubleArray get() = solution.predictions.level.copyOf()
    override val verdict: Verdict get() = solution.verdict
    override val assumptions: List<Assumption> = solution.assumptions.frozen()

    /** The measured shots. */
    public val capture: MeasuredCapture get() = solution.capture

    override fun toJson(): String = ResultJson.of(solution, model)

    /** The curves as CSV: wavelength_nm,red,green,blue at peak 1, then the standard deviations where known. */
    public fun toCsv(): String = CurvesCsv.of(solution.ssf)
}

/**
 * A capture that carries no answer.
 *
 * @property error why; its advice says what to do next.
 */
public class Refused internal constructor(
    public val error: CalibrationException,
    override val verdict: Verdict,
    private val begun: Begun,
) : Calibration() {
    override val assumptions: List<Assumption> get() = emptyList()

    override fun toJson(): String = ResultJson.of(begun, verdict)
}
