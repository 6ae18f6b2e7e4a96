package org.camssf.golden

import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.boolean
import kotlinx.serialization.json.double
import kotlinx.serialization.json.doubleOrNull
import kotlinx.serialization.json.int
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.photo.ChartPose
import org.camssf.photo.LensShading
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Signals
import org.camssf.recovery.Engine
import org.camssf.recovery.FamilyTest
import org.camssf.recovery.Hypothesis
import org.camssf.recovery.Ssf
import org.camssf.spectra.Lamp
import org.camssf.verdict.CameraWhite
import org.camssf.verdict.Case
import org.camssf.verdict.Causes
import org.camssf.verdict.Judge
import org.camssf.verdict.Rival
import org.camssf.verdict.UnitDrift
import org.camssf.verdict.VerdictInputs

/** The stage verdict: the judge, and the numbers of its rules 1 to 3. */
internal class VerdictStage(private val engine: Engine, private val forms: Forms) {
    fun verdict(case: GoldenCase): Map<String, Any?> {
        val y = case.tensor("signals")
        val (k, n) = y.shape
        val white = case.values("white")
        val used = case.list("used").flatMap { row -> row.jsonArray.map { it.jsonPrimitive.boolean } }
        case.list("white_is_patch") // Kotlin's judge does not need it.
        val signals = Signals(
            k, n, y.values, case.values("standard_error"), white, white, case.values("dark"), used.toBooleanArray(),
            emptyList(),
        )
        val lamps = case.lamps()
        val choice = case.list("choice").map { entry ->
            val (basis, probability) = entry.jsonArray.map { it.jsonPrimitive }
            Hypothesis(basis.content, 0.0, probability.double)
        }
        val basis =
            choice.maxByOrNull { it.probability }?.basis ?: case.find("basis")?.jsonPrimitive?.content ?: "golden"
        val solution = mapOf("ssf" to case["ssf"], "code" to case["code"], "predicted" to case["predicted"])
        val answers = Answers(case, basis, choice)
        val table = case.classic(18) { case.values("chart_tolerance") }
        val verdictInputs = VerdictInputs(
            engine, signals, table, lamps, answers.of(solution), case.values("white_reflectance"),
            case.number("white_tolerance")!!, case.gains(),
        )
        val rivals = case.list("rivals").map { entry ->
            val (shot, name, gain) = entry.jsonArray.map { it.jsonPrimitive }
            Rival(shot.int, name.content, gain.double)
        }
        val weighed = Case(
            verdictInputs,
            shots(case, lamps, n),
            case.list("alone").map { answers.of(it.jsonObject) },
            case.list("neutrals").map { shot -> shot.jsonArray.map { neutral(it) } },
            if (case.has("family")) case.text("family") else null,
            List(k) { case.flag("unnamed") ?: false },
            drift = case.number("new")?.let { UnitDrift.probability(verdictInputs, basis, it.toInt()) },
        ) { rivals }
        return outputs(weighed)
    }

    /** Answers that differ in curves, code and predictions alone. */
    private inner class Answers(case: GoldenCase, private val basis: String, private val choice: List<Hypothesis>) {
        private val std = if (case.has("ssf_std")) case.values("ssf_std") else null
        private val lamp = case.values("lamp")
        private val spread = if (case.has("code_variance")) diagonal(case.values("code_variance")) else null
        private val fading = case.number("chart_fading") ?: 0.0
        private val test = case.find("family_test")?.jsonArray?.map { it.jsonPrimitive.doubleOrNull }
            ?.let { (length, residual, longest, largest) -> FamilyTest(length!!, residual, longest!!, largest!!) }

        fun of(solution: Map<String, JsonElement>): Ssf {
            fun values(name: String) = forms.resolve(solution.getValue(name)).values
            val curves = Ssf.Curves(values("ssf"), std, values("code"), spread, values("predicted"), lamp)
            val proof = Ssf.Proof(DoubleArray(3), DoubleArray(1), IntArray(1), null)
            val ones = DoubleArray(3) { 1.0 }
            val ssf = Ssf(curves, proof, ones, DoubleArray(3), 1.0, basis, comparison = Ssf.Comparison(choice))
            return test?.let { ssf.withFamilyTest(it, fading) } ?: ssf
        }

        private fun diagonal(of: DoubleArray) =
            DoubleArray(of.size * of.size) { if (it / of.size == it % of.size) of[it % of.size] else 0.0 }
    }

    private fun shots(case: GoldenCase, lamps: List<Lamp>, n: Int): List<MeasuredShot> {
        val centres = case.values("centres")
        return case.list("shots").mapIndexed { j, entry ->
            val quads = DoubleArray(8 * n) { centres[2 * (j * n + it / 8) + it % 2] + SQUARE[it % 8] }
            val pose = ChartPose("classic24", SQUARE, quads, 0, "by hand", 1.0, emptyList())
            val means = forms.means(entry)
            val (bright, dark) = listOf(means.white, means.dark).map { frame -> PHOTO.takeIf { frame != null } }
            MeasuredShot(lamps[j], PHOTO, bright, dark, pose, means, LensShading.AS_STORED)
        }
    }

    private fun neutral(entry: JsonElement): CameraWhite {
        val (light, white) = entry.jsonArray
        return CameraWhite(forms.resolve(light).values, numbers(white))
    }

    private fun outputs(case: Case): Map<String, Any?> {
        val verdict = Judge.judge(case)
        val joint = case.inputs.goodnessOfFit()
        val each = case.each()
        val suspects = each.map { it.bestExplanation() }
        return judgement(verdict) + mapOf(
            "checks" to verdict.checks.map { "${it.name} ${it.beyond} ${it.shot ?: "whole"}" },
            "checked" to verdict.checks.map { listOf(it.value, it.limit, it.refuses ?: 0.0) },
            "fatal" to verdict.reasons.map { it.fatal },
            "causes" to case.shots.indices.flatMap { j ->
                listOf(emptySet(), Causes.BY_WHITE).flatMap { witnesses ->
                    case.causes(j, case.rivals(), witnesses)?.probability?.values.orEmpty()
                }
            },
            "named" to
                suspects.map { one -> one?.let { it.cause.word + it.patch?.let { patch -> " $patch" }.orEmpty() } },
            "residual" to joint.residual,
            "prior" to joint.prior,
            "count" to joint.count,
            "z" to listOf(joint.z) + each.map { it.z },
            "gains" to each.flatMap { one -> one.explanations.map { it.gain } },
        )
    }

    private companion object {
        val SQUARE = doubleArrayOf(-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0)
    }
}
