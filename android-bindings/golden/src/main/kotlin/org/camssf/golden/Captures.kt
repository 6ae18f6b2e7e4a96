package org.camssf.golden

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.boolean
import kotlinx.serialization.json.double
import kotlinx.serialization.json.int
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.CalibrationOptions
import org.camssf.CaptureFit
import org.camssf.Grid
import org.camssf.ProgressReporter
import org.camssf.Rivals
import org.camssf.Solve
import org.camssf.photo.ChartPose
import org.camssf.photo.ColourMatrix
import org.camssf.photo.LensShading
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Normalise
import org.camssf.photo.PatchMask
import org.camssf.photo.Photo
import org.camssf.photo.Signals
import org.camssf.recovery.Engine
import org.camssf.recovery.EstimatedLamp
import org.camssf.recovery.Tensor
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.camssf.verdict.Reasons
import org.camssf.verdict.Status

/** The stages that begin with the patch statistics of a whole capture: what a phone does after measuring. */
internal class Captures(private val forms: Forms, private val frames: Statistics) {
    private val square = doubleArrayOf(0.0, 0.0, 100.0, 0.0, 100.0, 100.0, 0.0, 100.0)

    fun calibrate(case: GoldenCase, engines: List<Engine>): Map<String, Any?> {
        val capture = capture(case)
        val done = Solve(engines, capture, settings(case), ProgressReporter.NOBODY).run()
        if (done.verdict.outcome == Status.REFUSED) throw Reasons.refusal(done.verdict)
        val ssf = done.ssf
        fun columns(of: (Int) -> DoubleArray): Tensor {
            val channels = List(3) { of(it) }
            return Tensor(DoubleArray(3 * Grid.SIZE) { channels[it % 3][it / 3] }, Grid.SIZE, 3)
        }
        val (k, n) = capture.shots.size to capture.chart.patches.size
        return mapOf(
            "signals" to Tensor(done.signals.sharedValues, k, n, 3),
            "used" to usedOf(done.signals),
            "ssf" to columns { ssf.curve(it) },
            "ssf_std" to if (ssf.sharedStd == null) null else onNodes { ssf.deviation(it)!! },
            "predicted" to Tensor(ssf.sharedPredicted, k, n, 3),
            "gap" to Tensor(ssf.sharedGap, 3),
            "channel_gain" to Tensor(ssf.sharedGain, 3),
            "rmsre_percent" to Tensor(done.scores.sharedRmsre, 3),
            "codes" to JsonArray(done.verdict.reasons.map { JsonPrimitive(it.code) }),
        )
    }

    /** Curves and light where nobody named a lamp, and the verdict on both, even where it refuses. */
    fun light(case: GoldenCase, engines: List<Engine>): Map<String, Any?> {
        val capture = capture(case)
        val done = Solve(engines, capture, settings(case), ProgressReporter.NOBODY).run()
        val ssf = done.ssf
        val lights = ssf.lights.filterNotNull()
        val reasons = done.verdict.reasons
        fun words(of: List<String>) = JsonArray(of.map { JsonPrimitive(it) })
        fun numbers(of: List<Double>) = if (of.isEmpty()) null else Tensor(of.toDoubleArray(), of.size)
        fun powers(of: (EstimatedLamp) -> DoubleArray): Tensor {
            val all = lights.flatMap { light -> of(light).filterIndexed { at, _ -> at % 10 == 0 } }
            return Tensor(all.toDoubleArray(), lights.size, NODES)
        }
        val weighed = ssf.choice.map { JsonArray(listOf(JsonPrimitive(it.basis)) + words(it.kinds)) }
        val kinds = lights.flatMap { it.kinds.values }.toDoubleArray()
        return mapOf(
            "weighed" to JsonArray(weighed),
            "log_evidence" to numbers(ssf.choice.map { it.logEvidence }),
            "probability" to numbers(ssf.choice.map { it.probability }),
            "basis" to ssf.basis,
            "prior_scale" to ssf.priorScale,
            "chart_fading" to Tensor.scalar(ssf.chartFading),
            "length" to ssf.familyTest?.let { Tensor(doubleArrayOf(it.length, it.longest), 2) },
            "likeliest" to words(ssf.kinds),
            "ssf" to onNodes { ssf.curve(it) },
            "ssf_std" to onNodes { ssf.deviation(it)!! },
            "predicted" to Tensor(ssf.sharedPredicted, capture.shots.size, capture.chart.patches.size, 3),
            "gap" to Tensor(ssf.sharedGap, 3),
            "rmsre_percent" to Tensor(done.scores.sharedRmsre, 3),
            "kinds" to Tensor(kinds, lights.size, kinds.size / lights.size),
            "power" to powers { it.sharedPower },
            "power_std" to powers { it.sharedStd },
            "kelvin" to numbers(lights.map { it.kelvin }),
            "kelvin_std" to numbers(lights.map { it.kelvinStd }),
            "status" to done.verdict.outcome.word,
            "codes" to words(reasons.map { it.code }),
            "messages" to words(reasons.map { it.message }),
            "values" to numbers(reasons.map { it.value ?: 0.0 }),
            "thresholds" to numbers(reasons.map { it.threshold ?: 0.0 }),
            "said" to words(done.assumptions.filter { it.code == "lamp" }.map { it.message }),
        )
    }

    /** Gains of every rival lamp, shot by shot. */
    fun rivals(case: GoldenCase, engines: List<Engine>): Map<String, Any?> {
        val capture = capture(case)
        val table = capture.chart
        val signals = Normalise.all(capture.shots.map { it.means }, table.patches, table.white)
        val fit = CaptureFit(engines, capture, signals, settings(case))
        val k = capture.shots.size
        val used = PatchMask(k, table.patches.size, signals.sharedUsed)
        val ssf = fit.curves(used, settings(case).gamma?.let { doubleArrayOf(it) })
        val found = Rivals.of(fit, ssf, used) { }
        return mapOf("gains" to Tensor(found.map { it.gain }.toDoubleArray(), k, found.size / k))
    }

    private fun maybe(case: GoldenCase, name: String): Double? = number(case.inputs.getValue(name))

    private fun settings(case: GoldenCase): CalibrationOptions {
        val nonnegative = (case.inputs.getValue("nonnegative") as JsonPrimitive).takeIf { it !is JsonNull }
        val differs = case.inputs["light_per_patch"]?.let { number(it) }
        return CalibrationOptions.Builder().l2(maybe(case, "l2")).gamma(maybe(case, "gamma"))
            .nonnegative(nonnegative?.boolean).lightPerPatch(differs).build()
    }

    private fun capture(case: GoldenCase): MeasuredCapture {
        fun given(name: String) = forms.resolve(case.inputs.getValue(name))
        val reflectance = given("reflectance")
        val n = reflectance.shape[0]
        val table = ChartTable(
            "classic24",
            "golden",
            ChartTable.read("classic24").layout,
            List(n) { "patch ${it + 1}" },
            Grid.wavelengths.values,
            reflectance.values,
            DoubleArray(n) { maybe(case, "chart_tolerance")!! },
            case.inputs.getValue("white").jsonPrimitive.int,
            "golden/spectra",
        )
        val pose = ChartPose(
            "classic24",
            DoubleArray(8) { square[it] * if (it % 2 == 0) 6 else 4 },
            DoubleArray(8 * 24) {
                val patch = it / 8
                square[it % 8] + 100 * if (it % 2 == 0) patch % 6 else patch / 6
            },
            0,
            "by hand",
            1.0,
            emptyList(),
        )
        val (make, model) = listOf("make", "model").map { (case.inputs[it] as? JsonPrimitive)?.content ?: "golden" }
        val photo = Photo("golden", 600, 400, 1, null, null, false, make, model, "")
        val stated = case.inputs["colour_matrices"] as? JsonArray
        fun matrices(j: Int) = stated?.get(j)?.jsonArray.orEmpty().map { each ->
            val values = each.jsonObject.getValue("values").jsonArray.map { it.jsonPrimitive.double }
            ColourMatrix(each.jsonObject.getValue("light").jsonPrimitive.content, values.toDoubleArray())
        }
        fun with(matrices: List<ColourMatrix>) =
            Photo("golden", 600, 400, 1, null, null, false, make, model, "", matrices)
        val (lamp, modes, tolerance) = listOf("lamp", "lamp_modes", "lamp_tolerance").map { given(it) }
        val (unnamed, torch) = listOf("unnamed", "torch").map { name ->
            (case.inputs[name] as? JsonArray).orEmpty().map { it.jsonPrimitive.int - 1 }
        }
        val called = (case.inputs["called"] as? JsonArray).orEmpty().map { it.jsonPrimitive.content }
        val shots = case.inputs.getValue("shots").jsonArray.mapIndexed { j, entry ->
            val means = frames.means(entry.jsonObject)
            val own = List(modes.shape[1]) { row(modes, j * modes.shape[1] + it) }
            val named = Lamp("golden", row(lamp, j), tolerance.values[j], own, "golden/spectra")
            val light = when (j) {
                in unnamed -> Lamp.auto()
                in torch -> Lamp.torch()
                else -> called.getOrNull(j)?.takeIf { it.isNotEmpty() }?.let(::told) ?: named
            }
            val (white, dark) = listOf(means.white, means.dark).map { frame -> photo.takeIf { frame != null } }
            MeasuredShot(light, with(matrices(j)), white, dark, pose, means, LensShading.AS_STORED)
        }
        return MeasuredCapture(shots, table, maybe(case, "white_reflectance"))
    }

    /** The light that a name stands for, or a name and its tolerance, `D55,2%`. */
    private fun told(text: String): Lamp =
        Lamp.read(text.substringBefore(",")).withTolerance(text.substringAfter(",", ""))

    private fun row(tensor: Tensor, at: Int): DoubleArray =
        tensor.values.copyOfRange(at * Grid.SIZE, (at + 1) * Grid.SIZE)
}

/** Every tenth point of the grid. */
internal const val NODES = 69

/** Curves of three channels on the 5-nm nodes. */
internal fun onNodes(of: (Int) -> DoubleArray): Tensor {
    val channels = List(3) { of(it) }
    return Tensor(DoubleArray(3 * NODES) { channels[it % 3][10 * (it / 3)] }, NODES, 3)
}

/** (k, n) as nested lists. */
internal fun usedOf(signals: Signals): JsonElement {
    val used = signals.sharedUsed
    return JsonArray(
        List(signals.shots) { j ->
            JsonArray(List(signals.patches) { JsonPrimitive(used[j * signals.patches + it]) })
        },
    )
}
