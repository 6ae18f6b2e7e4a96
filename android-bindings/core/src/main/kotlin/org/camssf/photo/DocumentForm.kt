package org.camssf.photo

import org.camssf.CalibrationException
import org.camssf.InvalidArgument
import org.camssf.Rows
import org.camssf.forms.BrokenDocument
import org.camssf.forms.Fields
import org.camssf.forms.Forms
import org.camssf.forms.need
import org.camssf.general
import org.camssf.spectra.ChartLayout
import org.camssf.spectra.Lamp
import org.camssf.spectra.SpectraFile
import kotlin.math.abs
import kotlin.math.sqrt

/**
 * A document, "camssf/2", that was read and checked: a capture, and with an answer and a verdict a result. Python's
 * `documents.document` has the same rules.
 *
 * @property version of the camssf that wrote it.
 * @property partial what was measured; null if a calibration was refused before its chart was read.
 * @property answer the curves; null when refused, or not solved.
 * @property verdict null for a capture that was not solved.
 * @property assumptions fallbacks and choices on which the result relies.
 */
internal class DocumentForm private constructor(
    val version: String,
    val partial: PartialCapture?,
    val answer: Fields?,
    val verdict: Fields?,
    val assumptions: List<Fields>,
) {
    /** The capture; null if it was refused before all its shots were measured. */
    val capture: MeasuredCapture? = partial?.whole()

    /** @throws InvalidArgument the capture was refused while it was measured. */
    fun wholeCapture(name: String): MeasuredCapture {
        if (capture != null) return capture
        throw InvalidArgument(
            "The capture of $name was refused before all its photos were measured.", "Measure it anew.",
        )
    }

    companion object {
        const val ADVICE =
            "Give the text that toJson made, the result.json of `camssf calibrate`, or what `camssf patches` printed."
        private val COLOURS = listOf("red", "green", "blue")
        private val FORMS = Forms(
            mapOf("ChartLayout" to ChartLayout.Companion::of, "Called" to ::called, "Unnamed" to ::unnamed),
            mapOf("Answer" to ::checkAnswer, "Document" to ::checkDocument),
        )

        /**
         * @param name of its source, for messages.
         * @throws CalibrationException the text is no such document, or its shots do not belong together.
         */
        fun read(text: String, name: String): DocumentForm {
            val fields = FORMS.read(text, name, ADVICE)
            val verdict = fields.maybe("verdict")
            val capture = fields.maybe("capture")?.let { CaptureForm.capture(it) }
            if (capture != null && verdict?.text("status") != "refused") checkAlike(capture, name)
            return DocumentForm(
                fields.text("version"), capture, fields.maybe("answer"), verdict, fields.list("assumptions"),
            )
        }

        private fun checkAlike(capture: PartialCapture, name: String) = try {
            Measuring.agree(capture.shots, capture.whiteReflectance)
        } catch (error: CalibrationException) {
            val words = "$name: the document does not fit together: ${error.message.trimEnd('.')}."
            throw InvalidArgument(words, ADVICE, cause = error)
        }

        private fun called(value: Any?, place: String): Lamp {
            val members = value as Map<*, *>
            val lamp = (members["name"] as? String)?.takeIf { members.size == 1 }?.let { Lamp.read(it) }
            if (lamp != null && lamp.uncertain) return lamp
            throw InvalidArgument("$place is no light by the name of a lamp or of a kind.", "Write its name: D55.")
        }

        private fun unnamed(value: Any?, place: String): Lamp {
            val members = value as Map<*, *>
            val lamp = listOf(Lamp.auto(), Lamp.torch()).firstOrNull { it.name == members["name"] }
            if (lamp != null && members.size == 1) return lamp
            throw InvalidArgument(
                "$place is an unnamed light, which has only a name: ${Lamp.UNNAMED.joinToString(" or ")}",
                "Give one of them.",
            )
        }

        private fun checkDocument(document: Fields) {
            val (capture, answer, verdict) = listOf("capture", "answer", "verdict").map { document.maybe(it) }
            if (capture != null) {
                try {
                    checkCapture(capture)
                } catch (error: BrokenDocument) {
                    throw BrokenDocument("capture.${error.place}", error.what)
                }
            } else {
                need(verdict != null && answer == null, "") { "lacks capture" }
            }
            val status = verdict?.text("status")
            need((answer == null) == (status == null || status == "refused"), "answer") {
                val known = if (status == null) "there is no verdict" else "the verdict is $status"
                "is ${if (answer == null) "missing" else "there"}, but $known"
            }
            if (capture != null && status != "refused") {
                val whole = capture["unfinished"] == null && capture.list<Fields>("shots").isNotEmpty()
                need(whole, "capture") { "must hold all its shots unless it was refused" }
            }
            if (answer != null && capture != null) checkSizes(answer, capture)
        }

        private fun checkCapture(capture: Fields) {
            val table = capture.part("chart")
            val layout = table["layout"] as ChartLayout
            val n = table.list<String>("patches").size
            val count = layout.columns * layout.rows
            need(n == count, "chart.patches") { "must hold the $count of its layout, holds $n" }
            val size = table.array("wavelengths").size
            need((table["reflectance"] as Rows).sides.toList() == listOf(n, size), "chart.reflectance") {
                "must hold $n rows of $size, as chart.patches and chart.wavelengths"
            }
            need(table.array("tolerance").size == n, "chart.tolerance") { "must hold $n entries, one a patch" }
            val white = table.whole("white")
            need(white < n, "chart.white") { "must be a number from 0 to ${n - 1}" }
            val rows = table.array("reflectance")
            need((0 until size).all { rows[white * size + it] > 0 }, "chart.reflectance") {
                "must be above 0 for the white patch"
            }
            checkWavelengths(table.array("wavelengths"))
            for ((i, shot) in capture.list<Fields>("shots").withIndex()) {
                val pose = shot.part("pose")
                val at = "shots[$i]"
                val lamp = shot["lamp"] as? Fields
                need(lamp == null || lamp.array("values").any { it > 0 }, "$at.lamp.values") {
                    "must not be 0 at all wavelengths"
                }
                need(pose.text("layout") == layout.name, "$at.pose.layout") { "must be the chart's" }
                need((pose["patches"] as Rows).sides[0] == n, "$at.pose.patches") {
                    "must hold $n entries, one a patch"
                }
                checkMeans(shot, at, n)
            }
        }

        private fun checkWavelengths(wavelengths: DoubleArray) = try {
            SpectraFile.checkWavelengths(wavelengths, "it", "chart_unfit")
        } catch (error: CalibrationException) {
            throw BrokenDocument("chart.wavelengths", "does not fit: ${error.message.trimEnd('.')}")
        }

        private fun checkMeans(shot: Fields, at: String, n: Int) {
            val means = shot.part("means")
            for (role in listOf("chart", "white", "dark")) {
                val frame = means.maybe(role) ?: continue
                for (name in FRAME) {
                    need((frame[name] as Rows).sides[0] == n, "$at.means.$role.$name") {
                        "must hold $n rows, one a patch"
                    }
                }
            }
            for (role in listOf("white", "dark")) {
                val both = (means[role] == null) == (shot[role] == null)
                need(both || means.flag("evened"), "$at.$role") {
                    "must be there as a photo and as means, or not at all"
                }
            }
            need(means.array("black").all { it < means.number("saturation") }, "$at.means.saturation") {
                "must lie above black"
            }
        }

        private val FRAME = listOf("mean", "standard_error", "count", "clipped", "dead", "gradient", "greens")

        private fun checkAnswer(answer: Fields) {
            for (colour in COLOURS) {
                val peak = answer.part("curves").array(colour).max()
                need(abs(peak - 1) <= 1e-6, "curves.$colour") { "must have peak 1, has ${general(peak)}" }
            }
            val proof = answer.part("proof")
            val problems = proof.array("layers_gap").size
            need(problems in setOf(1, 3) && proof.array("finish_steps").size == problems, "proof") {
                "must hold one number a problem, 1 or 3 of them"
            }
            (answer["code_covariance"] as Rows?)?.let { checkTriangle(it.values) }
        }

        private fun checkTriangle(triangle: DoubleArray) {
            val size = (sqrt(8.0 * triangle.size + 1).toInt() - 1) / 2
            need(size * (size + 1) / 2 == triangle.size && size % 3 == 0, "code_covariance") {
                "must be the triangle of a matrix of 3 r rows, holds ${triangle.size}"
            }
            for (i in 0 until size) {
                val at = i * (i + 3) / 2
                need(triangle[at] >= 0, "code_covariance[$at]") { "must not be negative, it is a variance" }
            }
        }

        private fun checkSizes(answer: Fields, capture: Fields) {
            val k = capture.list<Fields>("shots").size
            val n = capture.part("chart").list<String>("patches").size
            val used = answer.list<List<Boolean>>("used")
            need(used.size == k && used.all { it.size == n }, "answer.used") { "must hold $n patches of $k shots" }
            for (name in listOf("level", "predicted", "unseen", "predicted_std", "unseen_std")) {
                val rows = answer[name] as Rows? ?: continue
                need(rows.sides[0] == k && rows.sides[1] == n, "answer.$name") { "must hold $n patches of $k shots" }
            }
            val lights = answer.list<Fields?>("lights").size
            need(lights == 0 || lights == k, "answer.lights") { "must hold $k entries, one a shot" }
        }
    }
}
