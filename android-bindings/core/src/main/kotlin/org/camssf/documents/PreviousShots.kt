package org.camssf.documents

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.boolean
import kotlinx.serialization.json.contentOrNull
import kotlinx.serialization.json.double
import kotlinx.serialization.json.doubleOrNull
import kotlinx.serialization.json.int
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.InvalidArgument
import org.camssf.UnitDiffers
import org.camssf.photo.ChartPose
import org.camssf.photo.FrameMeans
import org.camssf.photo.LensShading
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Normalise
import org.camssf.photo.Normalised
import org.camssf.photo.PatchMeans
import org.camssf.photo.Photo
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.camssf.spectra.list
import org.camssf.spectra.numbers
import org.camssf.spectra.part
import org.camssf.spectra.text
import java.math.BigDecimal
import kotlin.math.max
import kotlin.math.sqrt

/** Takes the named shots of a stored result as further shots of a new capture: Python's camssf.documents.previous. */
internal class PreviousShots(private val name: String, private val document: JsonObject) {
    private val entries = document.list("shots").map { it.jsonObject }

    /** Behind `PreviousResult.joined`. */
    fun joined(capture: MeasuredCapture): MeasuredCapture {
        check(capture)
        val table = capture.chart
        val named = entries.filterNot { unnamed(it) }.map { shot(it, table) }
        return MeasuredCapture(capture.shots.map { evened(it, table) } + named, table, null, capture.files)
    }

    private fun unnamed(entry: JsonObject) = entry.part("lamp").text("name") in Lamp.UNNAMED

    private fun check(capture: MeasuredCapture) {
        val verdict = document.part("verdict")
        val status = verdict.text("status")
        if (status != "accepted") {
            val why = verdict.list("reasons").firstOrNull()?.jsonObject?.text("message").orEmpty()
            throw InvalidArgument("The previous result $name was $status: $why", AGAIN)
        }
        if (entries.all { unnamed(it) }) throw InvalidArgument("The previous result $name names no lamp.", AGAIN)
        checkChart(capture.chart)
        checkUnit(capture.shots[0].photo)
        val hashes = entries.map { it.part("photo").text("sha256") }
        val twin = capture.shots.firstOrNull { it.photo.sha256 in hashes } ?: return
        throw InvalidArgument("${twin.photo.name} is already in the previous result $name.", "Take a new photo.")
    }

    /** Names and files must be equal: errors of one chart are common to all its photos. */
    private fun checkChart(ours: ChartTable) {
        val theirs = document.part("chart")
        val files = document.part("hashes").part("inputs").filterKeys { it.startsWith(CHART_FILE) }
            .mapValues { it.value.jsonPrimitive.content }
        val own = ours.file?.let { mapOf(CHART_FILE + it.name to it.sha256) }.orEmpty()
        if (theirs.text("name") == ours.name && theirs.text("layout") == ours.layout.name && files == own) return
        throw InvalidArgument(
            "The previous result $name was measured on the chart ${theirs.text("name")}, not on ${ours.name}.",
            "Photograph the same chart again, and give the same table.",
        )
    }

    /** Compares what both files state; a result does not hold serial numbers. */
    private fun checkUnit(photo: Photo) {
        val camera = document.part("camera")
        val stored = entries[0].part("photo")
        fun stated(word: String) = camera[word]?.jsonPrimitive?.contentOrNull.orEmpty()
        val pairs = listOf(
            Triple("make", stated("make"), photo.make),
            Triple("model", stated("model"), photo.model),
            Triple("unique_model", stated("unique_model"), photo.uniqueModel),
            Triple(
                "size",
                "${whole(stored, "width")} × ${whole(stored, "height")}",
                "${photo.width} × ${photo.height}",
            ),
        )
        val differ = pairs.filter { (_, there, here) -> there.isNotEmpty() && here.isNotEmpty() && there != here }
        if (differ.isEmpty()) return
        val words = differ.joinToString("; ") { (word, there, here) -> "$word $there against $here" }
        throw UnitDiffers(
            "The previous result $name is of another camera than ${photo.name}: $words.",
            "Give the result of this unit, or calibrate it anew without a previous result.",
        )
    }

    /** A shot of the document, relative to the white patch; [Normalise] gives its signals and their errors again. */
    private fun shot(entry: JsonObject, table: ChartTable): MeasuredShot {
        val patches = entry.list("patches").map { it.jsonObject }
        val n = table.patches.size
        if (patches.size != n) {
            val words = "A shot of the previous result has ${patches.size} patches, the chart has $n."
            throw InvalidArgument(words, AGAIN)
        }
        fun column(word: String) = DoubleArray(3 * n).also { all ->
            patches.forEachIndexed { i, patch -> triple(patch, word).copyInto(all, 3 * i) }
        }
        val y = column("signal")
        val stated = column("standard_error")
        val dark = column("dark")
        val white = column("white")
        val w = 3 * table.white
        val b = DoubleArray(3) { white[w + it] - dark[w + it] }
        // Without a white frame se_y² = (se_C² + y² se_Cw²) / b², so that se_w² = 2 se_Cw² / b².
        val framed = entry.text("white_reference") == "white frame"
        val error = DoubleArray(3 * n) {
            val common = y[it] * stated[w + it % 3]
            if (framed) stated[it] else sqrt(max(stated[it] * stated[it] - common * common / 2.0, 0.0))
        }
        val chart = frame(
            DoubleArray(3 * n) { dark[it] + b[it % 3] * y[it] }, DoubleArray(3 * n) { b[it % 3] * error[it] },
            column("clipped"), column("dead"), column("gradient"),
        )
        val still = DoubleArray(3 * n)
        val own = frame(dark, still, still, still, still).takeIf { entry.text("dark_reference") == "dark frame" }
        val black = DoubleArray(3) { c -> (0 until n).sumOf { dark[3 * it + c] } / n }
        val wasFramed = entry["white"] is JsonObject
        val means =
            PatchMeans(chart, null, own, black, entry.getValue("saturation").jsonPrimitive.double, wasFramed)
        val photo = photo(entry.part("photo"))
        fun other(role: String) = (entry[role] as? JsonObject)?.let { photo(entry.part("photo"), it) }
        val shading = entry["lens_shading"]?.jsonPrimitive?.content ?: LensShading.AS_STORED.word
        val frames = listOf("white", "dark").map { other(it) }
        return MeasuredShot(
            lamp(entry.part("lamp")), photo, frames[0], frames[1], pose(entry.part("pose")), means,
            LensShading.of(shading),
        )
    }

    private fun triple(patch: JsonObject, word: String) =
        patch.numbers(word).also { require(it.size == 3) { "$word of a patch" } }

    /** A photo's metadata; `frame` replaces name and hash. */
    private fun photo(entry: JsonObject, frame: JsonObject = entry): Photo {
        val camera = document.part("camera")
        return Photo(
            frame.text("name"), whole(entry, "width"), whole(entry, "height"), whole(entry, "orientation"),
            entry["exposure"]?.jsonPrimitive?.doubleOrNull, entry["iso"]?.jsonPrimitive?.doubleOrNull,
            entry.getValue("gain_map").jsonPrimitive.boolean, camera.text("make"), camera.text("model"),
            frame.text("sha256"), uniqueModel = camera["unique_model"]?.jsonPrimitive?.contentOrNull.orEmpty(),
        )
    }

    private fun pose(entry: JsonObject) = ChartPose(
        entry.text("layout"), flat(entry.list("corners")), flat(entry.list("patches")), whole(entry, "quarter_turns"),
        entry.text("method"), entry.getValue("score").jsonPrimitive.double,
        entry.list("notes").map { it.jsonPrimitive.content },
    )

    /** The numbers of nested lists, in order. */
    private fun flat(values: JsonElement): DoubleArray =
        if (values !is JsonArray) {
            doubleArrayOf(values.jsonPrimitive.double)
        } else {
            values.flatMap { flat(it).toList() }.toDoubleArray()
        }

    private fun whole(entry: JsonObject, word: String) = entry.getValue(word).jsonPrimitive.int

    companion object {
        private const val CHART_FILE = "chart table: "
        private const val AGAIN =
            "Give the result of an accepted calibration of this unit, under a lamp that you named."

        /** A named lamp. Documents do not hold modes: those of a kind and of a temperature follow from the name. */
        private fun lamp(entry: JsonObject): Lamp {
            if (entry["power"] == null) {
                val words = "The previous result is of an older version, which did not store the lamp."
                throw InvalidArgument(words, AGAIN)
            }
            val name = entry.text("name")
            val source = entry.text("source")
            val tolerance = entry.getValue("tolerance").jsonPrimitive.double
            val kind = Lamp.auto().kinds.firstOrNull { it.name == name }
            val lamp = Lamp(name, entry.numbers("power"), tolerance, kind?.sharedModes.orEmpty(), source)
            val kelvin = entry["tolerance_kelvin"]?.jsonPrimitive?.double ?: return lamp
            val varied = lamp.withTolerance("${BigDecimal(kelvin).toPlainString()}K")
            val modes = varied.sharedModes
            return Lamp(name, varied.sharedValues, tolerance, modes, source, null, varied.toleranceKelvin)
        }

        /**
         * The shot without its white frame, its chart photo as in even light: b_w y in place of b y, b = W - D. It
         * needs no gain modes.
         */
        fun evened(shot: MeasuredShot, table: ChartTable): MeasuredShot {
            val means = shot.means
            if (means.white == null) return shot
            val signals = when (val one = Normalise.one(means, table.patches, table.white, 1)) {
                is Normalised.Sound -> one.signals
                is Normalised.Unsound -> throw one.error
            }
            val y = signals.sharedValues
            val dark = signals.sharedDark
            val b = DoubleArray(3) { (3 * table.white + it).let { at -> signals.sharedWhite[at] - dark[at] } }
            val chart = means.chart.with(
                DoubleArray(y.size) { dark[it] + b[it % 3] * y[it] },
                DoubleArray(y.size) { b[it % 3] * signals.sharedError[it] },
            )
            // The dark frame's error is in that of y already.
            val own = means.dark?.let { it.with(it.sharedMean, DoubleArray(y.size)) }
            return MeasuredShot(
                shot.lamp, shot.photo, shot.white, shot.dark, shot.pose,
                PatchMeans(chart, null, own, means.sharedBlack, means.saturation, evened = true), shot.lensShading,
            )
        }

        private fun FrameMeans.with(mean: DoubleArray, error: DoubleArray) =
            FrameMeans(mean, error, count, sharedClipped, dead, gradient, greens)

        private fun frame(
            mean: DoubleArray,
            error: DoubleArray,
            clipped: DoubleArray,
            dead: DoubleArray,
            gradient: DoubleArray,
        ): FrameMeans {
            val greens = DoubleArray(mean.size / 3 * 2) { mean[3 * (it / 2) + 1] }
            return FrameMeans(mean, error, LongArray(mean.size) { 1 }, clipped, dead, gradient, greens)
        }
    }
}
