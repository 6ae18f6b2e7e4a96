package org.camssf

import org.camssf.documents.Solution
import org.camssf.fit.Predictions
import org.camssf.fit.Scores
import org.camssf.fit.Uncertainty
import org.camssf.fit.UncertaintySource
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.Normalise
import org.camssf.photo.PatchMask
import org.camssf.photo.PatchTable
import org.camssf.photo.Signals
import org.camssf.recovery.Engine
import org.camssf.recovery.Ssf
import org.camssf.verdict.CameraWhite
import org.camssf.verdict.Case
import org.camssf.verdict.Causes
import org.camssf.verdict.Judge
import org.camssf.verdict.Status
import org.camssf.verdict.UnitDrift
import org.camssf.verdict.VerdictInputs

/**
 * Computes curves, scores and verdict from measured patches, in the order of Python's `camssf.calibration.solve`.
 *
 * @param new number of new shots before those of a previous result; null if there is none.
 * @param leftOut 0-based, the patch that is left out of the fit.
 */
internal class Solve(
    private val engines: List<Engine>,
    private val capture: MeasuredCapture,
    private val settings: CalibrationOptions,
    private val reporter: ProgressReporter,
    private val new: Int? = null,
    private val leftOut: Int? = null,
) {
    private val table = capture.chart
    private val n = table.patches.size
    private val k = capture.shots.size

    /**
     * Runs all stages of solving. If one patch is the likeliest cause of a misfit, the capture is solved without it;
     * that answer is taken unless it is refused, or another patch is blamed in turn.
     *
     * @throws CalibrationException a stage refuses, or the settings are invalid.
     */
    fun run(): Solution {
        val allowed = allowed()
        val measured = Normalise.all(capture.shots.map { it.means }, table.patches, table.white)
        val signals = measured.restrictedTo(BooleanArray(n) { allowed[it] && it != leftOut })
        val freeFit = CaptureFit(engines, capture, signals, settings).withRawWhite()
        if (freeFit.paper && settings.lightPerPatch != null) {
            throw InvalidArgument(
                "the basis has no prior, so light that differs between patches cannot be estimated.",
                "Take the basis auto, phones or cameras.",
            )
        }
        val used = PatchMask(k, n, signals.sharedUsed)
        checkEnough(used.selected.size)
        val gamma = settings.gamma?.let { doubleArrayOf(it) }
        val ssf = curves(freeFit, Stage.SOLVING, used, gamma)
        val likeliest = freeFit.likeliestTable(ssf, used)
        if (likeliest !== table) {
            val other = capture.with(chart = likeliest)
            return Solve(engines, other, settings, reporter, new, leftOut).run()
        }
        val fit = freeFit.conditionedOn(ssf)
        val explained = fit.explain(listOf(used), listOf(ssf))?.single()
        val predictedStd = explained?.let { PatchTable(k, n, it.predictedStd) }
        val unseen = crossValidate(fit, used, allowed, ssf, predictedStd)
        val scores = scores(fit, signals, ssf, unseen)
        val alone = capture.shots.indices.filter { k > 1 && ssf.sharedStd != null }
            .map { curves(fit, Stage.VALIDATING, used.ofShot(it), gamma) }
        val inputs =
            VerdictInputs(engines[0], signals, fit.table, fit.lamps, ssf, fit.white, fit.whiteTolerance, fit.gains)
        val family = freeFit.priorOdds.keys.firstOrNull().takeIf { engines.size > 1 }
        val unnamed = freeFit.lamps.map { it.unnamed }
        val drift = new?.let { UnitDrift.probability(inputs, ssf.basis, it) }
        val judged = Judge.judge(
            Case(inputs, capture.shots, alone, neutrals(), family, unnamed, drift) {
                Rivals.of(freeFit.withChartOf(ssf), ssf, used, new ?: k) { reporter.begin(Stage.JUDGING) }
            },
        )
        val verdict = Causes.withLight(judged) { j ->
            val own = PatchMask(1, n, signals.only(j).sharedUsed)
            curves(freeFit.withChartOf(ssf).unnamed(j), Stage.JUDGING, own, null)
        }
        val blamed = Causes.blamedPatch(verdict, table).takeIf { leftOut == null }
        val rest = blamed?.let { withoutPatch(it) }
        if (rest != null) return rest
        val level = fit.level(ssf)
        val assumptions = signals.assumptions + Assumptions.of(capture, ssf, level, leftOut)
        fun rows(table: PatchTable) = Rows(table.values, k, n, 3)
        val predictions = Predictions(
            signals.sharedUsed, Rows(level, k, n), rows(predicted(ssf)), predictedStd?.let(::rows),
            rows(unseen.values), unseen.std?.let(::rows),
        )
        val widths = uncertainty(fit, signals, fit.budget(used, ssf, explained), ssf, alone)
        return Solution(capture, signals, ssf, predictions, scores, verdict, assumptions, widths)
    }

    /**
     * The band's width, its width with each shot alone, and its budget; null on a basis without a prior, which has no
     * band.
     */
    private fun uncertainty(
        fit: CaptureFit,
        signals: Signals,
        shares: Map<String, DoubleArray>?,
        ssf: Ssf,
        alone: List<Ssf>,
    ): Uncertainty? {
        if (shares == null) return null
        // Shares inside the most probable hypothesis, and the share of the variance that is between the hypotheses.
        val between = ssf.between
        val inside = DoubleArray(3) { 1.0 - (between?.get(it) ?: 0.0) }
        val own = shares.mapValues { (_, share) -> DoubleArray(3) { inside[it] * share[it] } }
        val all = own + if (between == null) emptyMap() else mapOf("which lamp" to between)
        val sizes = BudgetWords.sizes(fit, signals, settings.lightPerPatch)
        val budget = all.map { (source, share) -> UncertaintySource(source, sizes.getValue(source), share) }
        return Uncertainty(ssf.halfWidth, ssf.halfWidthWithoutPhoto, alone.map { it.halfWidth }, budget)
    }

    /** The answer without a patch; null if it is refused, or blames another patch. */
    private fun withoutPatch(patch: Int): Solution? = try {
        Solve(engines, capture, settings, reporter, new, patch).run().takeIf {
            it.verdict.outcome != Status.REFUSED && Causes.blamedPatch(it.verdict, table) == null
        }
    } catch (_: CalibrationException) {
        null
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
        used: PatchMask,
        gamma: DoubleArray?,
    ): Ssf {
        reporter.begin(stage)
        return fit.curves(used, gamma) { reporter.proceed() }
    }

    /**
     * Predictions of patches by fits that did not use them, NaN elsewhere; one standard deviation of the true signals
     * minus these, null without a prior; and the method in words.
     */
    private inner class CrossValidation(bands: Boolean) {
        val values = PatchTable(k, n) { _, _, _ -> Double.NaN }
        val std = if (bands) PatchTable(k, n) { _, _, _ -> Double.NaN } else null
        var method = ""

        /** Takes over the predictions of a patch, in another level of the light. */
        fun take(predicted: PatchTable, bands: PatchTable?, shot: Int, patch: Int, level: Double) {
            for (c in 0..2) {
                values[shot, patch, c] = predicted[shot, patch, c] * level
                if (bands != null) std?.set(shot, patch, c, bands[shot, patch, c] * level)
            }
        }
    }

    private fun predicted(ssf: Ssf) = PatchTable(k, n, ssf.sharedPredicted)

    private fun crossValidate(
        fit: CaptureFit,
        used: PatchMask,
        allowed: BooleanArray,
        ssf: Ssf,
        bands: PatchTable?,
    ): CrossValidation {
        val found = CrossValidation(bands != null)
        // Without a white frame the white patch is the reference: its signal is 1 for any curves.
        val rest = (0 until n).filter { !allowed[it] && (fit.framed || it != table.white) }
        if (rest.isNotEmpty()) {
            for (j in 0 until k) for (i in rest) found.take(predicted(ssf), bands, j, i, 1.0)
            found.method = "${rest.size} patches that did not enter the fit"
            return found
        }
        val selected = used.selected
        val level = fit.level(ssf)
        val folds = List(FOLDS) { fold -> selected.filterIndexed { at, _ -> at % FOLDS == fold } }
        val masks = folds.map { used.without(it) }
        reporter.begin(Stage.VALIDATING)
        val answers = fit.folds(masks, ssf.sharedGamma) { reporter.check() }
        reporter.begin(Stage.VALIDATING)
        val explained = fit.explain(masks, answers)
        for ((fold, out) in folds.withIndex()) {
            val without = answers[fold]
            val own = fit.level(without)
            val band = explained?.let { PatchTable(k, n, it[fold].predictedStd) }
            for (j in 0 until k) {
                for (i in out.filter { used[j, it] }) {
                    // Each fold estimates its own illumination. Its predictions are rescaled to the full fit's.
                    found.take(predicted(without), band, j, i, level[j * n + i] / own[j * n + i])
                }
            }
        }
        found.method = "each of ${selected.size} patches, by a fit that left its quarter of the chart out"
        return found
    }

    private fun scores(fit: CaptureFit, signals: Signals, ssf: Ssf, unseen: CrossValidation): Scores {
        val fitted = predicted(ssf)
        val counts = BooleanArray(k * n) { unseen.values.isFinite(it / n, it % n) }
        val predicted =
            PatchTable(k, n) { j, i, c -> if (counts[j * n + i]) unseen.values[j, i, c] else fitted[j, i, c] }
        val levelled = signals.levelled(fit.level(ssf))
        return Scores.of(levelled, predicted.values, fit.table, fit.lamps, counts, unseen.method)
    }

    /** The camera's white points from each shot's file. */
    private fun neutrals(): List<List<CameraWhite>> = capture.shots.map { shot ->
        shot.photo.colourMatrices.map { CameraWhite(Rivals.lamp(it.light).sharedValues, it.sharedWhite) }
    }

    companion object {
        /**
         * Number of folds of the cross-validation: each patch is predicted by a fit without the patches of its fold.
         */
        val FOLDS get() = Rules.shipped.whole("calibration.folds")
    }
}
