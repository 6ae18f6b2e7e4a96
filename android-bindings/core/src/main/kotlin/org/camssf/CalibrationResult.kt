package org.camssf

import org.camssf.documents.Answer
import org.camssf.documents.BasisChoice
import org.camssf.documents.Convergence
import org.camssf.documents.CurvesCsv
import org.camssf.documents.Provenance
import org.camssf.documents.ResultForm
import org.camssf.fit.Predictions
import org.camssf.fit.Scores
import org.camssf.fit.Uncertainty
import org.camssf.model.Models
import org.camssf.photo.Assumption
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Normalise
import org.camssf.photo.PartialCapture
import org.camssf.photo.Signals
import org.camssf.recovery.BAND
import org.camssf.recovery.EstimatedLamp
import org.camssf.recovery.halfWidth
import org.camssf.short
import org.camssf.spectra.SourceFile
import org.camssf.verdict.Verdict

/**
 * The outcome of a capture, [Recovered] or [Refused]: from a calibration, or from its text by [SavedResult.read].
 * Immutable; safe to pass between threads.
 *
 * @property verdict accepted, doubtful or refused, with reasons.
 * @property provenance versions and hashes of what made it.
 */
public sealed class CalibrationResult(
    public val verdict: Verdict,
    assumptions: List<Assumption>,
    public val provenance: Provenance,
    internal val measured: PartialCapture?,
    private val file: SourceFile?,
) {
    /** Assumptions made where information was missing; empty if refused. */
    public val assumptions: List<Assumption> = assumptions.frozen()

    /** Name and hash of its text. */
    internal val source: SourceFile by lazy {
        file ?: SourceFile(SavedResult.NAMELESS, Models.sha256(toJson().toByteArray()))
    }

    internal abstract val answer: Answer?

    /**
     * The result as a document, "camssf/2", on one line: what was measured, the answer and the verdict, for
     * [SavedResult.read], for `camssf report`, or `camssf solve` to solve it anew. It has no time stamp and no serial
     * number: the same capture gives the same text. Any thread but the main one: it takes 0.1 s.
     */
    public fun toJson(): String = ResultForm.write(measured, answer, verdict, assumptions, provenance)
}

/** The camera's curves, accepted or doubtful. */
public class Recovered internal constructor(
    /** The measured shots. */
    public val capture: MeasuredCapture,
    override val answer: Answer,
    verdict: Verdict,
    assumptions: List<Assumption>,
    provenance: Provenance,
    file: SourceFile? = null,
) : CalibrationResult(verdict, assumptions, provenance, PartialCapture(capture), file) {
    /** The curve of a channel, of peak 1. */
    public fun curve(channel: Channel): Curve = Curve(answer.curves.values[channel.ordinal])

    /** One standard deviation of [curve]; null on a basis without a prior. */
    public fun deviation(channel: Channel): Curve? = answer.curves.std?.let { Curve(it[channel.ordinal]) }

    /** Half-width of the 95 % band about [curve], 1.96 standard deviations; null on a basis without a prior. */
    public fun band(channel: Channel): Curve? =
        answer.curves.std?.get(channel.ordinal)?.let { std -> Curve(DoubleArray(std.size) { BAND * std[it] }) }

    /** Mean half-width of the 95 % bands, 400 to 700 nm, in parts of the peak; 0 on a basis without a prior. */
    public val halfWidth: Double get() = answer.curves.std?.let { halfWidth(it) } ?: 0.0

    /** (3) raw white signal of each channel relative to green; ones where no frame was given. */
    public val channelGain: Rows get() = Rows(answer.curves.channelGain, 3)

    /** The basis of the curves, and what it was compared with. */
    public val basis: BasisChoice get() = answer.basis

    /** Duality gap and penalties. */
    public val convergence: Convergence get() = answer.convergence

    /** The signals that the curves predict, also of patches that the fit did not use. */
    public val predictions: Predictions get() = answer.predictions

    /** Of each shot the estimated light, null where its lamp was named; empty if all were. */
    public val lights: List<EstimatedLamp?> get() = answer.lights

    /** How well the curves predict patches that the fit did not use. */
    public val scores: Scores get() = answer.scores

    /** Width and sources of the band; null on a basis without a prior. */
    public val uncertainty: Uncertainty? get() = answer.uncertainty

    /** The measured signals, Eq. (5), and which of them the fit used. */
    public val signals: Signals by lazy {
        Normalise.all(capture.shots.map { it.means }, capture.chart.patches, capture.chart.white)
            .using(answer.predictions.sharedUsed)
    }

    /** The curves as CSV: wavelength_nm,red,green,blue with peak 1, then the standard deviations if there are any. */
    public fun toCsv(): String = CurvesCsv.of(answer.curves)

    override fun toString(): String = "Recovered($verdict, basis=$basis, halfWidth=${short(halfWidth)})"
}

/**
 * A capture from which no curves can be recovered.
 *
 * @property error the reason; its advice says what to do next.
 */
public class Refused internal constructor(
    public val error: Refusal,
    verdict: Verdict,
    provenance: Provenance,
    measured: PartialCapture?,
    file: SourceFile? = null,
) : CalibrationResult(verdict, emptyList(), provenance, measured, file) {
    override val answer: Answer? get() = null

    /** The shots that were measured before the refusal. */
    public val shots: List<MeasuredShot> = measured?.shots.orEmpty().frozen()

    override fun toString(): String = "Refused($error)"
}
