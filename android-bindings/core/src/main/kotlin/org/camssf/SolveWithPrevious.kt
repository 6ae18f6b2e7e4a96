package org.camssf

import org.camssf.documents.PreviousShots
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
 * Solves a capture together with the shots of a previous result; if they contradict the new ones, the new ones alone.
 * Python's `camssf.calibration._solve_with`.
 */
internal class SolveWithPrevious(
    private val engines: List<Engine>,
    private val capture: MeasuredCapture,
    private val settings: CalibrationOptions,
    private val reporter: ProgressReporter,
    private val previous: CalibrationResult,
) {
    private val name = previous.source.name

    fun run(): Solution {
        if (settings.lightPerPatch != null || engines[0].basis == OnnxEngine.PAPER) {
            throw InvalidArgument(
                "A previous result cannot be used on a basis without a prior, or with lightPerPatch.",
                "Leave one of the two out.",
            )
        }
        val files = capture.files + ("previous result: $name" to previous.source.sha256)
        val own = MeasuredCapture(capture.shots, capture.chart, capture.whiteReflectance, files)
        val new = own.shots.size
        val joint = PreviousShots(name, previous.verdict, previous.measured).joined(own)
        val (checks, refused) = try {
            val found = Solve(engines, joint, settings, reporter, new).run()
            val verdict = found.verdict
            if (verdict.outcome != Status.REFUSED && UnitDrift.contradiction(verdict.checks, emptyList()) == null) {
                return found.with(found.verdict, found.assumptions + entered(new))
            }
            verdict.checks to if (verdict.outcome == Status.REFUSED) Reasons.refusal(verdict) else null
        } catch (error: Refusal) {
            emptyList<Check>() to error
        }
        val alone = Solve(engines, own, settings, reporter).run()
        if (alone.verdict.outcome == Status.REFUSED) return alone
        val why = UnitDrift.contradiction(checks, alone.verdict.checks)
            ?: refused?.reason
            ?: return alone // the new photos alone do not fit either, and their verdict says so
        val drift = checks.filter { it.name == UnitDrift.DRIFT }
        val verdict = Verdict(Status.DOUBTFUL, listOf(why) + alone.verdict.reasons, alone.verdict.checks + drift)
        return alone.with(verdict, alone.assumptions)
    }

    private fun entered(new: Int) = Assumption(
        "previous_result",
        "the shots after number $new are those of $name: same unit, same chart.",
    )

    private fun Solution.with(verdict: Verdict, assumptions: List<Assumption>) =
        Solution(capture, signals, ssf, predictions, scores, verdict, assumptions, uncertainty)
}
