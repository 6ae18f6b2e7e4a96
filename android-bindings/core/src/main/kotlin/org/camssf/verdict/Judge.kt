package org.camssf.verdict

import org.camssf.Reason
import org.camssf.Rules
import org.camssf.photo.Agreement
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Signals
import org.camssf.recovery.BasisConstants
import org.camssf.recovery.Choice
import org.camssf.recovery.Ssf
import org.camssf.recovery.UnfamiliarCamera
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import kotlin.math.abs
import kotlin.math.max
import kotlin.math.sqrt

/**
 * The inputs of a verdict: k shots, the answer, the answer to each shot alone (empty for one shot), and for each shot
 * the camera's white points from its file.
 *
 * @property family the basis that the maker's name in the file suggests, if any, where the signals choose the basis.
 * @property unnamed for each shot, whether its light is unnamed; empty if all are named.
 * @property drift [UnitDrift.probability] of the new shots against those of a previous result; null if there is none.
 * @property rivals computes the gains of other lamps; not called if the capture is already refused.
 */
internal class Case(
    val inputs: VerdictInputs,
    val shots: List<MeasuredShot>,
    val alone: List<Ssf>,
    val neutrals: List<List<CameraWhite>>,
    val family: String?,
    val unnamed: List<Boolean> = emptyList(),
    val drift: Double? = null,
    val rivals: () -> List<Rival>,
) {
    /** The inputs of each shot alone, with the answer to it. */
    val single: List<VerdictInputs> = shots.indices.map { j -> inputs.only(j, alone.getOrNull(j) ?: inputs.ssf) }

    /** The causes of a shot; null on a basis without a prior, and with fewer than `verdict.fewest` used patches. */
    fun causes(j: Int, rivals: List<Rival>, witnesses: Set<String>): Causes? {
        val one = single[j]
        val enough = one.signals.sharedUsed.count { it } >= Rules.shipped.whole("verdict.fewest")
        if (!enough || !weighable) return null
        return Causes.weigh(one, shots[j], j, rivals.filter { it.shot == j }.map { it.gain }, witnesses)
    }

    /** Whether causes can be weighed: on a learned basis. */
    val weighable: Boolean get() = inputs.ssf.sharedStd != null && BasisConstants.of(inputs.ssf.basis) != null

    /**
     * Rules 1 to 3 for each shot alone. With fewer than `verdict.fewest` used patches T is 0 and there are no
     * explanations.
     */
    fun each(): List<GoodnessOfFit> {
        val fewest = Rules.shipped.whole("verdict.fewest")
        return shots.mapIndexed { j, shot ->
            if (single[j].signals.sharedUsed.count { it } < fewest) {
                GoodnessOfFit(0.0, 0.0, fewest, emptyList())
            } else {
                single[j].goodnessOfFit(shot)
            }
        }
    }
}

/** Patches of a shot that enter the fit. */
internal fun used(signals: Signals, shot: Int): List<Int> =
    (0 until signals.patches).filter { signals.sharedUsed[shot * signals.patches + it] }

/**
 * Applies all rules of docs/verdict.md to an answer, as in Python. RMSRE is not used: both of its sides contain the
 * same lamp, so it stays small when the lamp is wrong.
 */
internal object Judge {
    private val MISFIT_REFUSES get() = Rules.shipped.number("verdict.misfit_refuses")
    private val POOR_POSE get() = Rules.shipped.number("verdict.poor_pose")
    private val BAND_TOO_WIDE get() = Rules.shipped.number("verdict.band_too_wide")
    private val OTHER_MAKERS get() = Rules.shipped.number("verdict.other_makers")

    fun judge(case: Case): Verdict {
        val inputs = case.inputs
        val found = inputs.goodnessOfFit()
        val each = case.each()
        val checks = Checks()
        val reasons = ArrayList<Reason>()
        reasons += explanations(found, each, inputs.table, checks)
        case.shots.forEachIndexed { j, shot ->
            reasons += ExposureAndNoise(inputs.signals, j, shot.means, inputs.table, checks).reasons()
            reasons += Processed.reasons(shot.means, j, checks)
            reasons += disagreeing(j, case.single[j], checks)
        }
        val whites = case.shots.indices.map { j ->
            val unnamed = case.unnamed.getOrElse(j) { false }
            Light.whiteBalanceMismatch(j, lampName(case, j), unnamed, case.neutrals[j], case.single[j], checks)
        }
        whites.forEach { reasons += it }
        val faded = faded(inputs.ssf, checks)
        reasons += faded
        reasons += bandTooWide(inputs.ssf, checks)
        reasons += otherMakers(inputs.ssf, case.family, checks)
        // A previous result says what camera it is.
        val aloneInUnnamed = case.unnamed.any { it } && case.drift == null
        if (aloneInUnnamed) reasons += Light.unnamed(inputs.ssf.choice, case.family, checks)
        // Likeliest some lamp of a kind: not named, or by its kind, or by a wrong name.
        val ofSomeKind = case.drift == null && inputs.ssf.kinds.any { Lamp.kindOf(it) != null }
        if (aloneInUnnamed || ofSomeKind) reasons += typical(inputs.ssf, checks)
        val rivals = if (case.weighable || reasons.none { it.fatal }) case.rivals() else emptyList()
        val doubted = whites.indices.filter { whites[it].isNotEmpty() }
        if (reasons.none { it.fatal } && (case.shots.size == 1 || each.none { it.bestExplanation() != null })) {
            reasons += Light.rivalLamp(rivals, case.shots.map { it.lamp.name }, doubted, checks)
        }
        reasons += unusual(inputs.ssf, case.unnamed, checks)
        case.drift?.let {
            val uncertain = case.unnamed.any { each -> each } || inputs.ssf.kinds.isNotEmpty()
            reasons += drifted(it, uncertain, checks)
        }
        val causes = if (reasons.isEmpty()) {
            emptyList()
        } else {
            val ofTable = if (faded.isEmpty()) emptySet() else setOf("table")
            Causes.blamedShots(reasons, case.shots.size).mapNotNull { j ->
                case.causes(j, rivals, ofTable + if (j in doubted) Causes.BY_WHITE else emptySet())
            }
        }
        val clearest = causes.minByOrNull { it.probability.getValue(Causes.NONE) }
        val named = clearest?.run { putFirst(reasons, each[shot], inputs.table, lampName(case, shot)) } ?: reasons
        // First those that refuse: the error is the first one's, also in a stored result.
        return Verdict(Status.of(named), named.sortedBy { !it.fatal }, checks.all)
    }

    /** The lamp's name: of an unnamed light, the likeliest kind. */
    private fun lampName(case: Case, j: Int): String {
        val estimated = case.single[j].lamps[0].name
        val unnamed = case.unnamed.getOrElse(j) { false }
        return if (unnamed) Lamp.kindOf(estimated) ?: estimated else case.shots[j].lamp.name
    }

    /** Applies the thresholds of rules 2 and 3: reports each shot's best explanation, or that there is none. */
    private fun explanations(
        found: GoodnessOfFit,
        each: List<GoodnessOfFit>,
        table: ChartTable,
        checks: Checks,
    ): List<Reason> {
        val excess = found.total / found.count
        val misfitRefuses = found.total > MISFIT_REFUSES * found.count
        each.forEachIndexed { j, one ->
            one.strongestExplanation()?.let { (strongest, enough) ->
                checks.note("explanation", strongest.gain, j, enough)
            }
            one.offset?.let { checks.note("black", it.gain, j) }
        }
        val reasons = each.mapIndexedNotNull { j, one ->
            val explanation = one.bestExplanation() ?: return@mapIndexedNotNull null
            val value = if (misfitRefuses) excess else explanation.gain
            val words = words(explanation, table) + ("shot" to j + 1)
            val enough = one.strongestExplanation()!!.second
            val bound = if (explanation.gain > enough) enough else GoodnessOfFit.BLACK
            Reasons.because(accusation(explanation), value, words, misfitRefuses, bound.takeUnless { misfitRefuses })
        }
        val worst = each.maxOfOrNull { it.z } ?: found.z
        val largest = max(found.z, worst)
        checks.note("goodness_of_fit", largest)
        checks.note("misfit_refuses", excess)
        if (reasons.isNotEmpty() || !(misfitRefuses || largest > GoodnessOfFit.GOODNESS_OF_FIT)) return reasons
        val name = if (each.size > 1 && worst <= GoodnessOfFit.GOODNESS_OF_FIT) "contradiction" else "unexplained"
        val value = if (misfitRefuses) excess else largest
        return listOf(Reasons.because(name, value, mapOf("size" to sqrt(excess)), misfitRefuses))
    }

    /** The reason's name for an explanation. */
    private fun accusation(explanation: Explanation): String =
        if (explanation.cause == Cause.VEIL && !(explanation.amount > 0)) "bright_dark" else explanation.cause.word

    /** Values of that reason's placeholders. */
    private fun words(explanation: Explanation, table: ChartTable): Map<String, Any> = when (explanation.cause) {
        Cause.VEIL, Cause.BLACK -> mapOf("amount" to abs(explanation.amount))
        Cause.TONE -> mapOf("exponent" to 1 + explanation.amount)
        Cause.PATCH -> mapOf("patch" to table.patches[explanation.patch!!])
        Cause.WHITE, Cause.LIGHT -> emptyMap()
    }

    /** Checks whether the signals were explained by a faded chart only; it is weighed if the family test fails. */
    private fun faded(ssf: Ssf, checks: Checks): List<Reason> {
        val amount = ssf.chartFading
        val test = ssf.familyTest ?: return emptyList()
        if (test.passed && amount == 0.0) return emptyList()
        checks.note("chart_fading", amount)
        if (amount <= Rules.shipped.number("verdict.chart_fading")) return emptyList()
        return listOf(Reasons.because("faded", amount, mapOf("amount" to amount)))
    }

    /** Rule 8: checks whether a photo in unnamed light says more than what is known of any phone without it. */
    private fun typical(ssf: Ssf, checks: Checks): List<Reason> {
        val without = ssf.halfWidthWithoutPhoto ?: return emptyList()
        if (ssf.sharedStd == null || ssf.familyTest?.passed == false) return emptyList()
        val ratio = (ssf.halfWidthOfBasis ?: ssf.halfWidth) / without
        checks.note("band_ratio", ratio)
        val limit = Rules.shipped.number("verdict.band_ratio")
        if (ratio <= limit) return emptyList()
        val most = Rules.shipped.number("verdict.band_ratio_typical")
        val typical = ratio > most
        val words = mapOf("ratio" to ratio, "limit" to if (typical) most else limit)
        return listOf(Reasons.because(if (typical) "typical" else "one_light", ratio, words))
    }

    /** Checks whether the camera is unlike those of its basis, by its code and by its lamp (rule 7). */
    private fun unusual(ssf: Ssf, unnamed: List<Boolean>, checks: Checks): List<Reason> {
        val test = ssf.familyTest
        val length = (if (test == null) UnfamiliarCamera.codeLength(ssf) else test.length) ?: return emptyList()
        val limit = test?.longest ?: UnfamiliarCamera.longestCode(ssf.basis, unnamed.none { it })
        checks.note("improbable_curves", length, limit = limit)
        val words = mapOf("size" to length, "basis" to ssf.basis)
        val reasons = ArrayList<Reason>()
        if (length > limit) reasons += Reasons.because("improbable_curves", length, words, threshold = limit)
        val residual = test?.lampResidual ?: return reasons
        checks.note("lamp_residual", residual, limit = test.largest)
        if (residual > test.largest) {
            reasons += Reasons.because("lamp_residual", residual, words, threshold = test.largest)
        }
        return reasons
    }

    /** Checks whether the camera belongs to another family than those of its maker (rule 7). */
    private fun otherMakers(ssf: Ssf, family: String?, checks: Checks): List<Reason> {
        if (ssf.choice.isEmpty()) return emptyList()
        val others = ssf.choice.filter { family != null && Choice.MAKERS_OF[it.basis] != family }
        val other = others.sumOf { it.probability }
        checks.note("other_makers", other)
        if (other <= OTHER_MAKERS) return emptyList()
        return listOf(Reasons.because("other_makers", other, mapOf("basis" to ssf.basis)))
    }

    /** Checks whether the unit has changed since its previous result (rule 10). */
    private fun drifted(drift: Double, unnamed: Boolean, checks: Checks): List<Reason> {
        val limit = Rules.shipped.number(if (unnamed) "verdict.unit_drift_unnamed" else "verdict.unit_drift")
        checks.note(UnitDrift.DRIFT, drift, limit = limit)
        if (drift <= limit) return emptyList()
        return listOf(Reasons.because("drift", drift, mapOf("probability" to drift), threshold = limit))
    }

    /**
     * Checks the patches' colours against the chart's, for a simple camera model under the answer's lamp (rule 9).
     */
    private fun disagreeing(j: Int, inputs: VerdictInputs, checks: Checks): List<Reason> {
        val power = inputs.ssf.sharedLamp
        val score = Agreement.of(inputs.signals.sharedValues, inputs.table.genericSignals(power))
        checks.note("poor_pose", score, j)
        if (score >= POOR_POSE) return emptyList()
        return listOf(Reasons.because("pose", score, mapOf("shot" to j + 1, "score" to score)))
    }

    /**
     * Checks that the 95 % band is narrow enough to tell cameras apart; that of an unfamiliar camera is wide anyway.
     */
    private fun bandTooWide(ssf: Ssf, checks: Checks): List<Reason> {
        if (ssf.sharedStd == null || ssf.familyTest?.passed == false) return emptyList()
        val width = ssf.halfWidth
        checks.note("band_too_wide", width)
        return if (width > BAND_TOO_WIDE) {
            listOf(Reasons.because("band_too_wide", width, mapOf("width" to width)))
        } else {
            emptyList()
        }
    }
}
