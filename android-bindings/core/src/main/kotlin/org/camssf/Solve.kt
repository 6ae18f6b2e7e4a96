package org.camssf

import org.camssf.curves.Engine
import org.camssf.curves.Ssf
import org.camssf.documents.Solution
import org.camssf.evidence.Case
import org.camssf.evidence.Foretold
import org.camssf.evidence.Judge
import org.camssf.evidence.Scores
import org.camssf.evidence.Told
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.Normalise
import org.camssf.photo.Signals

/** Measured patches → curves, scores and verdict, arranged as Python's `camssf.calibration.solve` does it. */
internal class Solve(
    private val engines: List<Engine>,
    private val capture: MeasuredCapture,
    private val settings: Settings,
    private val tell: Tell,
) {
    private val table = capture.chart
    private val n = table.patches.size
    private val k = capture.shots.size

    /**
     * All of it.
     *
     * @throws CalibrationException there is no answer, or the settings are wrong.
     */
    fun run(): Solution {
        val asked = asked()
        val signals =
            Normalise.all(capture.shots.map { it.means }, table.patches, table.white).askedFor(asked)
        val asking = Fit(engines, capture, signals, settings)
        checkEnough(asking.taken(signals.sharedUsed).size)
        val gamma = settings.gamma?.let { doubleArrayOf(it) }
        val ssf = curves(asking, SOLVING, signals.sharedUsed, gamma)
        val fit = asking.settled(ssf)
        val unseen = unseen(fit, signals, asked, ssf)
        val scores = scores(fit, signals, ssf, unseen)
        val alone = capture.shots.indices.filter { k > 1 && ssf.sharedStd != null }.map { shot ->
            val own = BooleanArray(k * n) { signals.sharedUsed[it] && it / n == shot }
            curves(fit, VALIDATING, own, gamma)
        }
        val told = Told(signals, table, fit.lamps, ssf, fit.white, fit.whiteTolerance)
        val family = fit.believed.keys.firstOrNull()
        val verdict = Judge.judge(
            Case(told, capture.shots, alone, foretold(), family) {
                Rivals.of(asking, ssf, signals.sharedUsed) { tell(JUDGING.first, JUDGING.second) }
            },
        )
        val assumptions = signals.assumptions + Assumptions.of(capture, fit.paper)
        val widths = alone.map { it.halfWidth }.takeIf { ssf.sharedStd != null }
        return Solution(capture, signals, ssf, unseen.values, scores, verdict, assumptions, widths)
    }

    /** Which of the n patches shall enter the fit. */
    private fun asked(): BooleanArray {
        val numbers = settings.fit ?: return BooleanArray(n) { true }
        if (numbers.isEmpty() || numbers.any { it !in 1..n }) {
            throw InvalidArgument(
                "the patches of this chart are numbered 1 to $n; got ${numbers.take(30).joinToString()}.",
                "Write 7 to 18.",
            )
        }
        return BooleanArray(n) { it + 1 in numbers }
    }

    private fun checkEnough(taken: Int) {
        if (taken >= 3) return
        throw InvalidArgument(
            "only $taken patches are left for the fit.",
            "Name more patches to fit, or leave that out.",
        )
    }

    /** A fit, told first: a chance to cancel. */
    private fun curves(
        fit: Fit,
        stage: Pair<String, Double>,
        used: BooleanArray,
        gamma: DoubleArray?,
    ): Ssf {
        tell(stage.first, stage.second)
        return fit.curves(used, gamma)
    }

    /** Predictions (k, n, 3) of patches that the fit had not seen, NaN elsewhere, and how that was done in words. */
    private class Unseen(val values: DoubleArray, val how: String)

    private fun unseen(fit: Fit, signals: Signals, asked: BooleanArray, ssf: Ssf): Unseen {
        val values = DoubleArray(3 * k * n) { Double.NaN }
        fun take(from: Ssf, shot: Int, patch: Int) {
            val at = 3 * (shot * n + patch)
            from.sharedPredicted.copyInto(values, at, at, at + 3)
        }
        // The white patch's signal is 1 whatever the curves, where it stood in for the white frame.
        val rest = (0 until n).filter { !asked[it] && (fit.framed || it != table.white) }
        if (rest.isNotEmpty()) {
            for (j in 0 until k) for (i in rest) take(ssf, j, i)
            return Unseen(values, "${rest.size} patches that did not enter the fit")
        }
        val used = signals.sharedUsed
        val taken = fit.taken(used)
        val folds = FOLDS
        for (fold in 0 until folds) {
            val out = taken.filterIndexed { at, _ -> at % folds == fold }
            val others = BooleanArray(k * n) { used[it] && it % n !in out }
            val without = curves(fit, VALIDATING, others, ssf.sharedGamma)
            for (j in 0 until k) for (i in out) if (used[j * n + i]) take(without, j, i)
        }
        return Unseen(values, "each of ${taken.size} patches, by a fit that left its quarter of the chart out")
    }

    private fun scores(fit: Fit, signals: Signals, ssf: Ssf, unseen: Unseen): Scores {
        val counts = BooleanArray(k * n) { i -> (0..2).all { unseen.values[3 * i + it].isFinite() } }
        val predicted =
            DoubleArray(unseen.values.size) { if (counts[it / 3]) unseen.values[it] else ssf.sharedPredicted[it] }
        return Scores.of(signals, predicted, table, fit.lamps, counts, unseen.how)
    }

    /** What each shot's file foretells of its white. */
    private fun foretold(): List<List<Foretold>> = capture.shots.map { shot ->
        shot.photo.neutrals.map { Foretold(Rivals.lamp(it.light).sharedValues, it.white) }
    }

    private companion object {
        /** All patches enter the fit; each is predicted by a fit that left its quarter of the chart out. */
        val FOLDS get() = Rules.shipped.whole("calibration.folds")

        val SOLVING = "solving" to 0.9
        val VALIDATING = "validating" to 0.95
        val JUDGING = "judging" to 0.98
    }
}
