package org.camssf.colour

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.double
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.Camssf
import org.camssf.Rows
import org.camssf.forms.Forms
import org.camssf.json.JsonText
import org.camssf.photo.CaptureForm
import org.camssf.photo.ChartPose
import org.camssf.photo.FrameMeans
import org.camssf.photo.LensShading
import org.camssf.photo.MeasuredShot
import org.camssf.photo.PartialCapture
import org.camssf.photo.PatchMeans
import org.camssf.photo.Photo
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import java.io.File

/** The result of the golden case colour/named as a whole document, its patches without signals. */
internal object GoldenResult {
    private val golden: JsonObject =
        Json.parseToJsonElement(File(System.getProperty("camssf.root"), "golden/cases/colour/named.json").readText())
            .jsonObject.getValue("inputs").jsonObject.getValue("result").jsonObject
    private val chart = ChartTable.read("classic24")
    private const val N = 24

    private fun numbers(of: JsonElement) = of.jsonArray.map { it.jsonPrimitive.double }.toDoubleArray()

    private fun curves(name: String): List<DoubleArray> =
        COLOURS.map { numbers(golden.getValue(name).jsonObject.getValue(it)) }

    /** The curves, each of peak 1. */
    val curves: List<DoubleArray> = curves("ssf")

    private fun plain(curves: List<DoubleArray>) =
        Forms.plain("Curves", "red" to curves[0], "green" to curves[1], "blue" to curves[2])

    private fun capture(lamp: Lamp): PartialCapture {
        val none = DoubleArray(3 * N)
        val frame = FrameMeans(none, none, LongArray(3 * N) { 1 }, none, none, none, DoubleArray(2 * N))
        val means = PatchMeans(frame, null, null, DoubleArray(3), 16000.0)
        val photo = Photo("a.dng", 40, 30, 1, null, null, false, "golden", "phone", "0".repeat(64))
        val pose = ChartPose("classic24", DoubleArray(8), DoubleArray(8 * N), 0, "by hand", 1.0, emptyList())
        val shot = MeasuredShot(lamp, photo, null, null, pose, means, LensShading.AS_STORED)
        return PartialCapture(chart, listOf(lamp), listOf(shot))
    }

    /**
     * The text, without the hash of its content.
     *
     * @param lights of an unnamed lamp, power and standard deviation.
     */
    fun text(lamp: Lamp = Lamp.read("D55"), lights: List<Pair<DoubleArray, DoubleArray>> = emptyList()): String {
        val answer = Forms.plain(
            "Answer",
            "basis" to golden.getValue("basis").jsonPrimitive.content,
            "engine" to "onnx",
            "curves" to plain(curves),
            "std" to plain(curves("ssf_std")),
            "channel_gain" to numbers(golden.getValue("channel_gain")),
            "code_covariance" to numbers(golden.getValue("code_covariance") as JsonArray),
            "gamma" to DoubleArray(3),
            "l2" to 1.0,
            "proof" to Forms.plain(
                "Proof", "gap" to DoubleArray(3), "layers_gap" to DoubleArray(1), "finish_steps" to IntArray(1),
            ),
            "used" to listOf(List(N) { true }),
            "level" to Rows(DoubleArray(N) { 1.0 }, 1, N),
            "predicted" to Rows(DoubleArray(3 * N), 1, N, 3),
            "unseen" to Rows(DoubleArray(3 * N), 1, N, 3),
            "lights" to lights.map { (power, std) ->
                Forms.plain(
                    "EstimatedLamp", "kinds" to mapOf("daylight" to 1.0), "power" to power, "std" to std,
                    "kelvin" to 5500.0, "kelvin_std" to 100.0,
                )
            },
            "scores" to Forms.plain(
                "Scores", "rmsre_percent" to DoubleArray(3), "unseen" to "none", "rmse" to null, "delta_e00" to 0.0,
            ),
        )
        return JsonText.write(
            Forms.plain(
                "Document", "format" to Forms.FORMAT, "version" to Camssf.VERSION,
                "capture" to CaptureForm.plain(capture(lamp)), "answer" to answer,
                "verdict" to Forms.plain("Verdict", "status" to "accepted"),
            ),
        )
    }

    private val COLOURS get() = listOf("red", "green", "blue")
}
