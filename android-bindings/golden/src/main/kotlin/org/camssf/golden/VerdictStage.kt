package org.camssf.golden

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.boolean
import kotlinx.serialization.json.contentOrNull
import kotlinx.serialization.json.double
import kotlinx.serialization.json.doubleOrNull
import kotlinx.serialization.json.int
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.Grid
import org.camssf.photo.ChartPose
import org.camssf.photo.LensShading
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Photo
import org.camssf.photo.Signals
import org.camssf.recovery.Engine
import org.camssf.recovery.FamilyTest
import org.camssf.recovery.Gains
import org.camssf.recovery.Hypothesis
import org.camssf.recovery.Ssf
import org.camssf.recovery.Tensor
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.camssf.verdict.CameraWhite
import org.camssf.verdict.Case
import org.camssf.verdict.Judge
import org.camssf.verdict.Rival
import org.camssf.verdict.UnitDrift
import org.camssf.verdict.VerdictInputs

/** Gain modes of a case; null where it has none. */
internal fun gains(inputs: JsonObject, forms: Forms): Gains? {
    val modes = inputs["gain_modes"] ?: return null
    return Gains(forms.resolve(modes), number(inputs.getValue("gain_own"))!!)
}

/** The stage verdict: the judge, and the numbers of its rules 1 to 3. */
internal class VerdictStage(
    private val engine: Engine,
    private val forms: Forms,
    private val frames: Statistics,
) {
    fun verdict(case: GoldenCase): Map<String, Any?> {
        val inputs = case.inputs
        fun given(name: String) = forms.resolve(inputs.getValue(name))
        val y = given("signals")
        val (k, n) = y.shape
        val white = given("white").values
        val used = inputs.getValue("used").jsonArray.flatMap { row -> row.jsonArray.map { it.jsonPrimitive.boolean } }
        val signals = Signals(
            k, n, y.values, given("standard_error").values, white, white, given("dark").values, used.toBooleanArray(),
            emptyList(),
        )
        val table = ChartTable(
            "classic24",
            "golden",
            ChartTable.read("classic24").layout,
            List(n) { "patch ${it + 1}" },
            Grid.wavelengths.values,
            given("reflectance").values,
            given("chart_tolerance").values,
            18,
            "golden/spectra",
        )
        val lamp = given("lamp")
        val modes = given("lamp_modes")
        val tolerance = given("lamp_tolerance").values
        val lamps = List(k) { j ->
            val own = List(modes.shape[1]) { row(modes, j * modes.shape[1] + it) }
            Lamp("golden", row(lamp, j), tolerance[j], own, "golden/spectra")
        }
        val std = inputs.getValue("ssf_std").takeIf { it != JsonNull }?.let { forms.resolve(it).values }
        val proof = Ssf.Proof(DoubleArray(3), DoubleArray(1), IntArray(1), null)
        val choice = (inputs["choice"] as? JsonArray).orEmpty().map { entry ->
            val (basis, probability) = entry.jsonArray.map { it.jsonPrimitive }
            Hypothesis(basis.content, 0.0, probability.double)
        }
        val basis = choice.maxByOrNull { it.probability }?.basis
            ?: inputs["basis"]?.jsonPrimitive?.content ?: "golden"
        val test = (inputs["family_test"] as? JsonArray)?.map { it.jsonPrimitive.doubleOrNull }
            ?.let { (length, residual, longest, largest) -> FamilyTest(length!!, residual, longest!!, largest!!) }
        val fading = inputs["chart_fading"]?.jsonPrimitive?.double ?: 0.0
        val variance = inputs["code_variance"]?.let { forms.resolve(it).values }
        val spread = variance?.let { own ->
            DoubleArray(own.size * own.size) { if (it / own.size == it % own.size) own[it % own.size] else 0.0 }
        }
        fun answer(of: JsonObject): Ssf {
            fun value(name: String) = forms.resolve(of.getValue(name)).values
            val curves = Ssf.Curves(value("ssf"), std, value("code"), spread, value("predicted"), lamp.values)
            val ssf =
                Ssf(
                    curves, proof,
                    DoubleArray(3) {
                        1.0
                    },
                    DoubleArray(3), 1.0, basis, comparison = Ssf.Comparison(choice),
                )
            return test?.let { ssf.withFamilyTest(it, fading) } ?: ssf
        }
        val verdictInputs = VerdictInputs(
            engine,
            signals,
            table,
            lamps,
            answer(inputs),
            given("white_reflectance").values,
            given("white_tolerance").values[0],
            gains(inputs, forms),
        )
        val weighed = Case(
            verdictInputs,
            shots(inputs, lamps, n),
            inputs.getValue("alone").jsonArray.map { answer(it.jsonObject) },
            inputs.getValue("neutrals").jsonArray.map { shot -> shot.jsonArray.map { neutral(it) } },
            inputs["family"]?.jsonPrimitive?.contentOrNull,
            List(k) { inputs["unnamed"]?.jsonPrimitive?.boolean ?: false },
            drift = inputs["new"]?.let { UnitDrift.probability(verdictInputs, basis, it.jsonPrimitive.int) },
        ) {
            inputs.getValue("rivals").jsonArray.map { entry ->
                val (shot, name, gain) = entry.jsonArray.map { it.jsonPrimitive }
                Rival(shot.int, name.content, gain.double)
            }
        }
        return outputs(weighed)
    }

    private fun shots(inputs: JsonObject, lamps: List<Lamp>, n: Int): List<MeasuredShot> {
        val centres = forms.resolve(inputs.getValue("centres")).values
        val photo = Photo("golden", 600, 400, 1, null, null, false, "golden", "golden", "")
        return inputs.getValue("shots").jsonArray.mapIndexed { j, entry ->
            val quads = DoubleArray(8 * n) { centres[2 * (j * n + it / 8) + it % 2] + SQUARE[it % 8] }
            val pose = ChartPose("classic24", SQUARE, quads, 0, "by hand", 1.0, emptyList())
            val means = frames.means(entry.jsonObject)
            val (bright, dark) = listOf(means.white, means.dark).map { frame -> photo.takeIf { frame != null } }
            MeasuredShot(lamps[j], photo, bright, dark, pose, means, LensShading.AS_STORED)
        }
    }

    private fun neutral(entry: JsonElement): CameraWhite {
        val (light, white) = entry.jsonArray
        return CameraWhite(forms.resolve(light).values, forms.resolve(white).values)
    }

    private fun outputs(case: Case): Map<String, Any?> {
        val verdict = Judge.judge(case)
        val joint = case.inputs.goodnessOfFit()
        val each = case.each()
        fun numbers(of: List<Double>) = if (of.isEmpty()) null else Tensor(of.toDoubleArray(), of.size)
        return mapOf(
            "status" to verdict.outcome.word,
            "codes" to JsonArray(verdict.reasons.map { JsonPrimitive(it.code) }),
            "messages" to JsonArray(verdict.reasons.map { JsonPrimitive(it.message) }),
            "advice" to JsonArray(verdict.reasons.map { JsonPrimitive(it.advice) }),
            "checks" to JsonArray(
                verdict.checks.map { JsonPrimitive("${it.name} ${it.beyond} ${it.shot ?: "whole"}") },
            ),
            "checked" to Tensor(
                verdict.checks.flatMap { listOf(it.value, it.limit, it.refuses ?: 0.0) }.toDoubleArray(),
                verdict.checks.size,
                3,
            ),
            "fatal" to JsonArray(verdict.reasons.map { JsonPrimitive(it.fatal) }),
            "values" to numbers(verdict.reasons.map { it.value ?: 0.0 }),
            "thresholds" to numbers(verdict.reasons.map { it.threshold ?: 0.0 }),
            "causes" to numbers(
                case.shots.indices.flatMap { j ->
                    case.causes(j, case.rivals(), emptySet())?.probability?.values.orEmpty()
                },
            ),
            "named" to JsonArray(
                each.map { one ->
                    val suspect = one.bestExplanation()
                    val patch = suspect?.patch?.let { " $it" }.orEmpty()
                    JsonPrimitive(suspect?.let { it.cause.word + patch })
                },
            ),
            "residual" to Tensor.scalar(joint.residual),
            "prior" to Tensor.scalar(joint.prior),
            "count" to joint.count,
            "z" to numbers(listOf(joint.z) + each.map { it.z }),
            "gains" to numbers(each.flatMap { one -> one.explanations.map { it.gain } }),
        )
    }

    private fun row(tensor: Tensor, at: Int): DoubleArray =
        tensor.values.copyOfRange(at * Grid.SIZE, (at + 1) * Grid.SIZE)

    private companion object {
        val SQUARE = doubleArrayOf(-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0)
    }
}
