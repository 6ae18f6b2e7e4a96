package org.camssf.passport

import org.camssf.Grid
import org.camssf.Rows
import org.camssf.forms.Fields
import org.camssf.photo.DocumentForm
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.MeasuredShot
import org.camssf.photo.PartialCapture
import org.camssf.photo.Photo
import org.camssf.spectra.Lamp
import java.math.BigDecimal
import java.math.RoundingMode

/**
 * The part of a result that a passport holds: curves, bands, verdict and provenance, without the single patches. Its
 * form is "camssf-result/1", in which passports were signed. Python's `passport/excerpt.py` makes the same excerpt.
 */
internal object Excerpt {
    const val FORMAT = "camssf-result/1"
    private const val DECIMALS = 5
    private val COLOURS = listOf("red", "green", "blue")

    /** The excerpt of a result with curves, which are rounded to five decimals, as are their bands. */
    fun of(document: DocumentForm): Map<String, Any?> {
        val capture = document.capture!!
        val answer = document.answer!!
        val chart = capture.chart
        val first = capture.shots[0].photo
        val std = answer.maybe("std")
        val proof = answer.part("proof")
        val excerpt = linkedMapOf(
            "format" to FORMAT,
            "generator" to mapOf("name" to "camssf", "version" to document.version),
            "camera" to mapOf("make" to first.make, "model" to first.model) +
                known("unique_model", first.uniqueModel.ifEmpty { null }),
            "chart" to mapOf(
                "name" to chart.name, "table" to chart.table, "layout" to chart.layout.name, "source" to chart.source,
            ),
            "basis" to answer.text("basis"),
            "engine" to answer.text("engine"),
            "ssf" to curves(answer.part("curves")),
        )
        if (std != null) excerpt["ssf_std"] = curves(std)
        excerpt += mapOf(
            "channel_gain" to answer.array("channel_gain").toList(),
            "gap" to proof.array("gap").toList(),
            "layers_gap" to proof.array("layers_gap").toList(),
            "finish_steps" to (proof["finish_steps"] as Rows).nested(whole = true)!!,
        )
        excerpt += known("evidence", answer.maybeNumber("evidence"))
        excerpt += known("prior_scale", answer.number("prior_scale").takeIf { it != 1.0 })
        excerpt += known("chart_fading", answer.number("chart_fading").takeIf { it != 0.0 })
        excerpt += known("choice", answer.list<Fields>("choice").map { hypothesis(it) }.ifEmpty { null })
        excerpt += mapOf(
            "gamma" to answer.array("gamma").toList(),
            "l2" to answer.number("l2"),
            "shots" to capture.shots.map { shot(it) },
            "scores" to answer.part("scores").let { scores ->
                mapOf(
                    "rmsre_percent" to scores.array("rmsre_percent").toList(), "unseen" to scores.text("unseen"),
                    "rmse" to (scores["rmse"] as Rows?)?.values?.toList(),
                    "delta_e00" to scores.number("delta_e00"),
                )
            },
            "verdict" to verdict(document.verdict!!),
        )
        excerpt += known("uncertainty", answer.maybe("uncertainty")?.let { uncertainty(it) })
        excerpt["assumptions"] = document.assumptions.map { texts(it, "code", "message") }
        excerpt["hashes"] = mapOf("inputs" to hashes(capture), "model" to answer["model"])
        return excerpt
    }

    private fun known(name: String, value: Any?): Map<String, Any> =
        if (value == null) emptyMap() else mapOf(name to value)

    private fun texts(part: Fields, vararg names: String): Map<String, Any> = names.associateWith { part.text(it) }

    private fun curves(part: Fields): Map<String, Any> =
        COLOURS.associateWith { name -> part.array(name).map { rounded(it) } } +
            ("wavelength_nm" to Grid.wavelengths.values.toList())

    private fun rounded(value: Double): Double =
        BigDecimal(value).setScale(DECIMALS, RoundingMode.HALF_EVEN).toDouble()

    private fun hypothesis(part: Fields): Map<String, Any> = mapOf(
        "basis" to part.text("basis"), "log_evidence" to part.number("log_evidence"),
        "probability" to part.number("probability"),
    ) + known("kinds", part.list<String>("kinds").ifEmpty { null })

    private fun verdict(part: Fields): Map<String, Any> {
        val reasons = part.list<Fields>("reasons").map {
            texts(it, "code", "message", "advice") + mapOf("value" to it["value"], "threshold" to it["threshold"])
        }
        val checks = part.list<Fields>("checks").map { check ->
            listOf("name", "shot", "value", "limit", "refuses", "beyond").associateWith { check[it] }
        }
        return mapOf("status" to part.text("status"), "reasons" to reasons) + known("checks", checks.ifEmpty { null })
    }

    private fun uncertainty(part: Fields): Map<String, Any> = mapOf(
        "half_width" to part.number("half_width"),
        "alone" to part.list<Double>("alone"),
        "budget" to part.list<Fields>("budget").map {
            texts(it, "source", "size") + ("share" to it.array("share").toList())
        },
    ) + known("half_width_without_photo", part.maybeNumber("half_width_without_photo"))

    private fun shot(shot: MeasuredShot): Map<String, Any?> {
        val shading = shot.lensShading.word.takeIf { it != "as-stored" }
        return mapOf(
            "lamp" to lamp(shot.lamp),
            "white_reference" to if (shot.means.white != null) "white frame" else "white patch",
            "dark_reference" to if (shot.means.dark != null) "dark frame" else "black level",
            "photo" to photo(shot.photo),
            "white" to shot.white?.let { frame(it) },
            "dark" to shot.dark?.let { frame(it) },
            "pose" to null,
            "saturation" to shot.means.saturation,
            "patches" to emptyList<Any>(),
        ) + known("lens_shading", shading)
    }

    private fun lamp(lamp: Lamp): Map<String, Any?> = mapOf(
        "name" to lamp.name, "tolerance" to lamp.tolerance.takeUnless { lamp.unnamed }, "source" to lamp.source,
    ) + known("tolerance_kelvin", lamp.toleranceKelvin)

    private fun frame(photo: Photo) = mapOf("name" to photo.name, "sha256" to photo.sha256)

    private fun photo(photo: Photo): Map<String, Any?> = mapOf(
        "name" to photo.name,
        "width" to photo.width,
        "height" to photo.height,
        "orientation" to photo.orientation,
        "exposure" to photo.exposure,
        "iso" to photo.iso,
        "gain_map" to photo.gainMap,
        "sha256" to photo.sha256,
        "camera" to listOf(photo.make, photo.model).filter { it.isNotEmpty() }.joinToString(" "),
    )

    /** SHA-256 of all inputs by role and name: lamp and chart files, photos, frames. */
    private fun hashes(capture: MeasuredCapture): Map<String, String> {
        val hashes = LinkedHashMap(PartialCapture(capture).files)
        for ((j, shot) in capture.shots.withIndex()) {
            for ((role, photo) in listOf("chart" to shot.photo, "white" to shot.white, "dark" to shot.dark)) {
                if (photo != null) hashes["shot ${j + 1}, $role: ${photo.name}"] = photo.sha256
            }
        }
        return hashes
    }
}
