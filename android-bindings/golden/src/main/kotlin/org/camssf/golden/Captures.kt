package org.camssf.golden

import kotlinx.serialization.json.int
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.CalibrationOptions
import org.camssf.CaptureFit
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
import org.camssf.spectra.Lamp
import org.camssf.verdict.Reasons
import org.camssf.verdict.Status

/** The stages that begin with the patch statistics of a whole capture: what a phone does after measuring. */
internal class Captures(private val forms: Forms) {
    private val square = doubleArrayOf(0.0, 0.0, 100.0, 0.0, 100.0, 100.0, 0.0, 100.0)
    private val pose = ChartPose(
        "classic24",
        DoubleArray(8) { square[it] * if (it % 2 == 0) 6 else 4 },
        DoubleArray(8 * 24) { square[it % 8] + 100 * if (it % 2 == 0) it / 8 % 6 else it / 8 / 6 },
        0, "by hand", 1.0, emptyList(),
    )

    fun signals(case: GoldenCase): Map<String, Any?> {
        val patches = List(case.text("patches").toInt()) { "patch ${it + 1}" }
        val found = Normalise.all(case.list("shots").map { forms.means(it) }, patches, case.text("white").toInt())
        return measured(found) + mapOf(
            "standard_error" to found.sharedError,
            "assumptions" to found.assumptions.map { it.code },
        )
    }

    private fun measured(signals: Signals): Map<String, Any?> = mapOf(
        "signals" to signals.sharedValues,
        "used" to signals.sharedUsed.toList().chunked(signals.patches),
    )

    fun calibrate(case: GoldenCase, engines: List<Engine>): Map<String, Any?> {
        val done = Solve(engines, capture(case), settings(case), ProgressReporter.NOBODY).run()
        if (done.verdict.outcome == Status.REFUSED) throw Reasons.refusal(done.verdict)
        val ssf = done.ssf
        return measured(done.signals) + mapOf(
            "ssf" to curves(1) { ssf.curve(it) },
            "ssf_std" to if (ssf.sharedStd == null) null else curves(10) { ssf.deviation(it)!! },
            "predicted" to ssf.sharedPredicted,
            "gap" to ssf.sharedGap,
            "channel_gain" to ssf.sharedGain,
            "rmsre_percent" to done.scores.sharedRmsre,
            "codes" to done.verdict.reasons.map { it.code },
        )
    }

    /** Curves and light where a lamp is unnamed, and the verdict on both, even where it refuses. */
    fun light(case: GoldenCase, engines: List<Engine>): Map<String, Any?> {
        val done = Solve(engines, capture(case), settings(case), ProgressReporter.NOBODY).run()
        val ssf = done.ssf
        val lights = ssf.lights.filterNotNull()
        fun nodes(of: (EstimatedLamp) -> DoubleArray) =
            lights.map { light -> of(light).filterIndexed { at, _ -> at % 10 == 0 } }
        return chosen(ssf) + judgement(done.verdict) + mapOf(
            "weighed" to ssf.choice.map { listOf(it.basis) + it.kinds },
            "length" to ssf.familyTest?.let { listOf(it.length, it.longest) },
            "likeliest" to ssf.kinds,
            "rmsre_percent" to done.scores.sharedRmsre,
            "kinds" to lights.map { it.kinds.values.toList() },
            "power" to nodes { it.sharedPower },
            "power_std" to nodes { it.sharedStd },
            "kelvin" to lights.map { it.kelvin },
            "kelvin_std" to lights.map { it.kelvinStd },
            "said" to done.assumptions.filter { it.code == "lamp" }.map { it.message },
        )
    }

    /** Gains of every rival lamp, shot by shot. */
    fun rivals(case: GoldenCase, engines: List<Engine>): Map<String, Any?> {
        val capture = capture(case)
        val table = capture.chart
        val signals = Normalise.all(capture.shots.map { it.means }, table.patches, table.white)
        val fit = CaptureFit(engines, capture, signals, settings(case))
        val used = PatchMask(capture.shots.size, table.patches.size, signals.sharedUsed)
        val ssf = fit.curves(used, settings(case).gamma?.let { doubleArrayOf(it) })
        return mapOf("gains" to Rivals.of(fit, ssf, used) { }.map { it.gain }.toDoubleArray())
    }

    private fun settings(case: GoldenCase): CalibrationOptions =
        CalibrationOptions.Builder().l2(case.number("l2")).gamma(case.number("gamma"))
            .nonnegative(case.flag("nonnegative")).lightPerPatch(case.number("light_per_patch")).build()

    private fun capture(case: GoldenCase): MeasuredCapture {
        val tolerance = case.number("chart_tolerance")!!
        val table = case.classic(case.text("white").toInt()) { n -> DoubleArray(n) { tolerance } }
        val (make, model) = listOf("make", "model").map { if (case.has(it)) case.text(it) else "golden" }
        val stated = case.list("colour_matrices")
        fun photo(matrices: List<ColourMatrix> = emptyList()) =
            Photo("golden", 600, 400, 1, null, null, false, make, model, "", matrices)
        val (unnamed, torch) = listOf("unnamed", "torch").map { name ->
            case.list(name).map { it.jsonPrimitive.int - 1 }
        }
        val called = case.list("called").map { it.jsonPrimitive.content }
        val lamps = case.lamps()
        val shots = case.list("shots").mapIndexed { j, entry ->
            val means = forms.means(entry)
            val light = when (j) {
                in unnamed -> Lamp.auto()
                in torch -> Lamp.torch()
                else -> called.getOrNull(j)?.takeIf { it.isNotEmpty() }?.let(::told) ?: lamps[j]
            }
            val matrices = stated.getOrNull(j)?.jsonArray.orEmpty().map { it.jsonObject }.map {
                ColourMatrix(it.text("light"), numbers(it.getValue("values")))
            }
            val (white, dark) = listOf(means.white, means.dark).map { frame -> frame?.let { photo() } }
            MeasuredShot(light, photo(matrices), white, dark, pose, means, LensShading.AS_STORED)
        }
        return MeasuredCapture(shots, table, case.number("white_reflectance"))
    }

    /** The light that a name stands for, or a name and its tolerance, `D55,2%`. */
    private fun told(text: String): Lamp =
        Lamp.read(text.substringBefore(",")).withTolerance(text.substringAfter(",", ""))
}
