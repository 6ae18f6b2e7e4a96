package org.camssf

import org.camssf.documents.PreviousShots
import org.camssf.documents.Provenance
import org.camssf.documents.Solution
import org.camssf.photo.Assumption
import org.camssf.photo.MeasuredCapture
import org.camssf.recovery.Engine
import org.camssf.recovery.OnnxEngine
import org.camssf.verdict.Check
import org.camssf.verdict.Reasons
import org.camssf.verdict.Status
import org.camssf.verdict.UnitDrift
import org.camssf.verdict.Verdict

/**
 * Solves a capture together with the shots of a previous result, whose own answer stays unless the common one is
 * accepted: Python's `camssf.calibration._solve_with`.
 *
 * @param previous an accepted result; checked by [run].
 * @param completed the result of a solution.
 */
internal class SolveWithPrevious(
    private val engines: List<Engine>,
    private val capture: MeasuredCapture,
    private val settings: CalibrationOptions,
    private val reporter: ProgressReporter,
    private val previous: CalibrationResult,
    private val completed: (Solution) -> CalibrationResult,
) {
    private val source = previous.source
    private val ownHash = mapOf("previous result: ${source.name}" to source.sha256)

    fun run(): CalibrationResult {
        if (settings.lightPerPatch != null || engines[0].basis == OnnxEngine.PAPER) {
            throw InvalidArgument(
                "A previous result cannot be used on a basis without a prior, or with lightPerPatch.",
                "Leave one of the two out.",
            )
        }
        val own = MeasuredCapture(capture.shots, capture.chart, capture.whiteReflectance, capture.files + ownHash)
        val new = own.shots.size
        val joint = PreviousShots(source.name, previous.verdict, previous.measured).joined(own)
        var checks = emptyList<Check>()
        val leftOut = try {
            val together = Solve(engines, joint, settings, reporter, new).run()
            val verdict = together.verdict
            if (verdict.outcome == Status.ACCEPTED) return completed(together.with(entered(new)))
            checks = verdict.checks
            if (verdict.outcome == Status.REFUSED) Reasons.refusal(verdict).reason else verdict.reasons[0]
        } catch (error: Refusal) {
            error.reason
        }
        val alone = Solve(engines, own, settings, reporter).run()
        if (alone.verdict.outcome == Status.REFUSED) return completed(alone)
        val why = UnitDrift.contradiction(checks, alone.verdict.checks)
        return kept(previous as Recovered, why, leftOut, checks.filter { it.name == UnitDrift.DRIFT })
    }

    /**
     * The previous result, with what was found about the new photos, which did not enter.
     *
     * @param why the reason for which it is doubtful, if there is one.
     * @param leftOut the first reason for which the new photos did not enter.
     */
    private fun kept(stored: Recovered, why: Reason?, leftOut: Reason, drift: List<Check>): Recovered {
        val photos = capture.shots.map { it.photo }
        val unused = photos.associate { "not used: ${it.name}, ${it.sha256.take(HASH)}" to it.sha256 }
        val files = stored.provenance.files + ownHash + unused
        val status = if (why == null) Status.ACCEPTED else Status.DOUBTFUL
        val others = stored.verdict.checks.filter { it.name != UnitDrift.DRIFT }
        val names = photos.withIndex().joinToString { (j, photo) -> "shot ${j + 1}: ${photo.name}" }
        val stays = previousResult(
            "the answer is that of ${source.name}; the new photos ($names) did not enter: ${leftOut.message}",
        )
        val whole = stored.capture
        val made = stored.provenance
        return Recovered(
            MeasuredCapture(whole.shots, whole.chart, whole.whiteReflectance, files), stored.answer,
            Verdict(status, listOfNotNull(why), others + drift), stored.assumptions + stays,
            Provenance(made.version, made.engine, made.model, made.basis, files),
        )
    }

    private fun entered(new: Int) =
        previousResult("the shots after number $new are those of ${source.name}: same unit, same chart.")

    private fun previousResult(message: String) = Assumption("previous_result", message)

    private fun Solution.with(assumption: Assumption) =
        Solution(capture, signals, ssf, predictions, scores, verdict, assumptions + assumption, uncertainty)

    private companion object {
        /** Digits of a photo's hash that tell files of one name apart. */
        const val HASH = 8
    }
}
