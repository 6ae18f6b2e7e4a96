package org.camssf

import org.camssf.colour.LearnedBasis
import org.camssf.documents.Predictions
import org.camssf.documents.Share
import org.camssf.documents.Solution
import org.camssf.documents.Uncertainty
import org.camssf.fit.Scores
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.Normalise
import org.camssf.photo.Signals
import org.camssf.recovery.Engine
import org.camssf.recovery.Ssf
import org.camssf.verdict.CameraWhite
import org.camssf.verdict.Case
import org.camssf.verdict.Judge
import org.camssf.verdict.UnitDrift
import org.camssf.verdict.VerdictInputs
import kotlin.math.max

/**
 * Computes curves, scores and verdict from measured patches, in the order of Python's `camssf.calibration.solve`.
 *
 * @param new number of new shots before those of a previous result; null if there is none.
 */
internal class Solve(
    private val engines: List<Engine>,
    private val capture: MeasuredCapture,
    private val settings: Settings,
    private val tell: Tell,
    private val new: Int? = null,
) {
    private val table = capture.chart
    private val n = table.patches.size
    private val k = capture.shots.size

    /**
     * Runs all stages of solving.
     *
     * @throws CalibrationException a stage refuses, or the settings are invalid.
     */
    fun run(): Solution {
        val allowed = allowed()
        val signals =
            Normalise.all(capture.shots.map { it.means }, table.patches, table.white).restrictedTo(allowed)
        val freeFit = CaptureFit(engines, capture, signals, settings).withRawWhite()
        if (freeFit.paper && settings.lightPerPatch != null) {
            throw InvalidArgument(
                "the basis has no prior, so light that differs between patches cannot be estimated.",
                "Take the basis auto, phones or cameras.",
            )
        }
        checkEnough(freeFit.selected(signals.sharedUsed).size)
        val gamma = settings.gamma?.let { doubleArrayOf(it) }
        val ssf = curves(freeFit, Stage.SOLVING, signals.sharedUsed, gamma)
        val likeliest = freeFit.likeliestTable(ssf, signals.sharedUsed)
        if (likeliest !== table) {
            val other = MeasuredCapture(capture.shots, likeliest, capture.whiteReflectance, capture.files)
            return Solve(engines, other, settings, tell, new).run()
        }
        val fit = freeFit.conditionedOn(ssf)
        val predictedStd = fit.bands(signals.sharedUsed, ssf)
        val unseen = crossValidate(fit, signals, allowed, ssf, predictedStd)
        val scores = scores(fit, signals, ssf, unseen)
        val alone = capture.shots.indices.filter { k > 1 && ssf.sharedStd != null }.map { shot ->
            val own = BooleanArray(k * n) { signals.sharedUsed[it] && it / n == shot }
            curves(fit, Stage.VALIDATING, own, gamma)
        }
        val inputs = VerdictInputs(signals, fit.table, fit.lamps, ssf, fit.white, fit.whiteTolerance, fit.gains)
        val family = freeFit.priorOdds.keys.firstOrNull().takeIf { engines.size > 1 }
        val unnamed = freeFit.lamps.map { it.unnamed }
        val drift = new?.let { UnitDrift.probability(inputs, LearnedBasis.of(ssf.basis)!!, it) }
        val verdict = Judge.judge(
            Case(inputs, capture.shots, alone, neutrals(), family, unnamed, drift) {
                Rivals.of(freeFit.withChartOf(ssf), ssf, signals.sharedUsed, new ?: k) { tell.begin(Stage.JUDGING) }
            },
        )
        val level = fit.level(ssf)
        val assumptions = signals.assumptions + Assumptions.of(capture, ssf, level)
        val predictions = Predictions(level, predictedStd, unseen.values, unseen.std)
        val widths = uncertainty(fit, signals, ssf, alone)
        return Solution(capture, signals, ssf, predictions, scores, verdict, assumptions, widths)
    }

    /**
     * The band's width, its width with each shot alone, and its budget; null on a basis without a prior, which has no
     * band.
     */
    private fun uncertainty(fit: CaptureFit, signals: Signals, ssf: Ssf, alone: List<Ssf>): Uncertainty? {
        val shares = fit.budget(signals.sharedUsed, ssf) ?: return null
        val used = signals.sharedUsed
        val noise = (0 until 3 * k * n).filter { used[it / 3] }.map {
            signals.sharedError[it] / max(signals.sharedValues[it], FAINTEST)
        }
        val chart = short(Rules.shipped.number("covariance.chart_correlation"))
        val sizes = mapOf(
            "noise" to "standard errors of the signals, median ${percent(median(noise.toDoubleArray()), 2)}",
            "chart" to "${percent(median(table.sharedTolerance), 1)} a patch, smooth over $chart nm, " +
                "the same under every lamp",
            "white" to "${percent(fit.whiteTolerance, 1)}, smooth over $chart nm",
            "lamp" to fit.lamps.joinToString { percent(it.tolerance, 1) } +
                ", smooth over ${short(Rules.shipped.number("covariance.lamp_correlation"))} nm",
            "lamp modes" to fit.lamps.joinToString { "${it.name}: ${it.sharedModes.size}" },
            "uneven light" to evenness(fit),
            "unseen" to "the part of the prior's variance that the signals do not reduce",
            "which lamp" to "the difference between the results for each kind of light",
        )
        // Shares inside the most probable hypothesis, and the share of the variance that is between the hypotheses.
        val between = ssf.between
        val inside = DoubleArray(3) { 1.0 - (between?.get(it) ?: 0.0) }
        val own = shares.mapValues { (_, share) -> DoubleArray(3) { inside[it] * share[it] } }
        val all = own + if (between == null) emptyMap() else mapOf("which lamp" to between)
        val budget = all.map { (source, share) -> Share(source, sizes.getValue(source), share) }
        return Uncertainty(ssf.halfWidth, ssf.halfWidthWithoutPhoto, alone.map { it.halfWidth }, budget)
    }

    private fun evenness(fit: CaptureFit): String {
        settings.lightPerPatch?.let { return "${percent(it, 1)} from patch to patch, the same for all channels" }
        if (fit.gains.modes.values.isEmpty()) return "none: a white frame was taken"
        val (plane, bowl) = listOf("plane", "bowl").map { percent(Rules.shipped.number("gains.$it"), 0) }
        return "$plane of plane and $bowl of bowl across the chart, no white frame"
    }

    /** Mask (n) of the patches that may enter the fit. */
    private fun allowed(): BooleanArray {
        val numbers = settings.fit ?: return BooleanArray(n) { true }
        if (numbers.isEmpty() || numbers.any { it !in 1..n }) {
            throw InvalidArgument(
                "the patches of this chart are numbered 1 to $n; got ${numbers.take(30).joinToString()}.",
                "Write 7 to 18.",
            )
        }
        return BooleanArray(n) { it + 1 in numbers }
    }

    private fun checkEnough(selected: Int) {
        if (selected >= 3) return
        throw InvalidArgument(
            "only $selected patches are left for the fit.",
            "Name more patches to fit, or leave that out.",
        )
    }

    /** Reports the stage, which may end a cancelled run, then fits. */
    private fun curves(
        fit: CaptureFit,
        stage: Stage,
        used: BooleanArray,
        gamma: DoubleArray?,
    ): Ssf {
        tell.begin(stage)
        return fit.curves(used, gamma) { tell.proceed() }
    }

    /**
     * Predictions (k, n, 3) of patches by fits that did not use them, NaN elsewhere; one standard deviation of the
     * true signals minus these, null without a prior; and the method in words.
     */
    private class CrossValidation(val values: DoubleArray, val std: DoubleArray?, val method: String)

    private fun crossValidate(
        fit: CaptureFit,
        signals: Signals,
        allowed: BooleanArray,
        ssf: Ssf,
        bands: DoubleArray?,
    ): CrossValidation {
        val values = DoubleArray(3 * k * n) { Double.NaN }
        val std = bands?.let { DoubleArray(3 * k * n) { Double.NaN } }
        fun take(from: Ssf, band: DoubleArray?, shot: Int, patch: Int) {
            val at = 3 * (shot * n + patch)
            from.sharedPredicted.copyInto(values, at, at, at + 3)
            if (std != null) band?.copyInto(std, at, at, at + 3)
        }
        // Without a white frame the white patch is the reference: its signal is 1 for any curves.
        val rest = (0 until n).filter { !allowed[it] && (fit.framed || it != table.white) }
        if (rest.isNotEmpty()) {
            for (j in 0 until k) for (i in rest) take(ssf, bands, j, i)
            return CrossValidation(values, std, "${rest.size} patches that did not enter the fit")
        }
        val used = signals.sharedUsed
        val selected = fit.selected(used)
        val level = fit.level(ssf)
        val folds = FOLDS
        for (fold in 0 until folds) {
            val out = selected.filterIndexed { at, _ -> at % folds == fold }
            val others = BooleanArray(k * n) { used[it] && it % n !in out }
            val without = curves(fit, Stage.VALIDATING, others, ssf.sharedGamma)
            val own = fit.level(without)
            val band = fit.bands(others, without)
            for (j in 0 until k) {
                for (i in out) {
                    val at = j * n + i
                    if (!used[at]) continue
                    take(without, band, j, i)
                    // Each fold estimates its own illumination. Its predictions are rescaled to the full fit's.
                    for (c in 3 * at until 3 * at + 3) {
                        values[c] *= level[at] / own[at]
                        if (std != null) std[c] *= level[at] / own[at]
                    }
                }
            }
        }
        val method = "each of ${selected.size} patches, by a fit that left its quarter of the chart out"
        return CrossValidation(values, std, method)
    }

    private fun scores(fit: CaptureFit, signals: Signals, ssf: Ssf, unseen: CrossValidation): Scores {
        val counts = BooleanArray(k * n) { i -> (0..2).all { unseen.values[3 * i + it].isFinite() } }
        val predicted =
            DoubleArray(unseen.values.size) { if (counts[it / 3]) unseen.values[it] else ssf.sharedPredicted[it] }
        return Scores.of(signals.levelled(fit.level(ssf)), predicted, fit.table, fit.lamps, counts, unseen.method)
    }

    /** The camera's white points from each shot's file. */
    private fun neutrals(): List<List<CameraWhite>> = capture.shots.map { shot ->
        shot.photo.colourMatrices.map { CameraWhite(Rivals.lamp(it.light).sharedValues, it.white) }
    }

    companion object {
        /**
         * Number of folds of the cross-validation: each patch is predicted by a fit without the patches of its fold.
         */
        val FOLDS get() = Rules.shipped.whole("calibration.folds")

        private val FAINTEST get() = Rules.shipped.number("calibration.faintest")
    }
}
