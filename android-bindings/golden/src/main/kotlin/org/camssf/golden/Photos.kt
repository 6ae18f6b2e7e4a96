package org.camssf.golden

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.buildJsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.photo.ChartPose
import org.camssf.photo.Corners
import org.camssf.photo.Estimate
import org.camssf.photo.FrameMeans
import org.camssf.photo.GainMap
import org.camssf.photo.LensShading
import org.camssf.photo.Mosaic
import org.camssf.photo.PatchMeans
import org.camssf.photo.Region
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.camssf.recovery.Tensor
import org.camssf.spectra.ChartTable
import java.security.MessageDigest

/** The stages that begin with a DNG of golden/dng. */
internal class Photos(private val files: GoldenFiles, private val forms: Forms) {
    fun read(name: String): Mosaic = DngSource.of(files.read("dng/$name"), name).use { DngReader.read(it) }

    fun mosaic(case: GoldenCase): Map<String, Any?> {
        val found = read(case.inputs.text("dng"))
        fun tensor(values: DoubleArray?) = values?.let { Tensor(it, it.size) }
        return mapOf(
            "sha256" to found.origin.sha256,
            "width" to found.width,
            "height" to found.height,
            "samples_sha256" to hash(found.samples),
            "cfa" to found.sensor.cfa,
            "black" to tensor(found.sensor.sharedBlack),
            "white" to found.sensor.white,
            "make" to found.origin.make,
            "model" to found.origin.model,
            "exposure" to found.origin.exposure,
            "iso" to found.origin.iso,
            "orientation" to found.origin.orientation,
            "color_matrix1" to tensor(found.colours.colorMatrix1?.values),
            "color_matrix2" to tensor(found.colours.colorMatrix2?.values),
            "as_shot_neutral" to tensor(found.colours.asShotNeutral?.values),
            "gain_maps" to JsonArray(found.corrections.gainMaps.map { gainMap(it) }),
            "as_shot_white_xy" to tensor(found.colours.asShotWhiteXY?.values),
            "noise_profile" to tensor(found.sensor.noiseProfile?.values),
            "masked_areas" to JsonArray(found.sensor.maskedAreas.map { area(it) }),
            "bad_pixels" to JsonArray(
                found.corrections.badPixels.map { each ->
                    buildJsonObject {
                        put("list", JsonPrimitive(each.list))
                        put("constant", each.constant?.let { JsonPrimitive(it) } ?: JsonNull)
                        put("points", JsonArray(each.points.map { it.toInt() }.chunked(2) { whole(it) }))
                        put("areas", JsonArray(each.areas.map { area(it) }))
                    }
                },
            ),
        )
    }

    private fun whole(values: List<Int>) = JsonArray(values.map { JsonPrimitive(it) })

    private fun area(area: Region) = whole(listOf(area.top, area.left, area.bottom, area.right))

    private fun gainMap(map: GainMap) = buildJsonObject {
        put("list", JsonPrimitive(map.list))
        put("area", area(map.area))
        put("plane", JsonPrimitive(map.plane))
        put("planes", JsonPrimitive(map.planes))
        put("row_pitch", JsonPrimitive(map.rowPitch))
        put("column_pitch", JsonPrimitive(map.columnPitch))
        put("spacing", JsonArray(listOf(JsonPrimitive(map.spacingV), JsonPrimitive(map.spacingH))))
        put("origin", JsonArray(listOf(JsonPrimitive(map.originV), JsonPrimitive(map.originH))))
        val gains = map.gains.map { JsonPrimitive(it) }
        val points = gains.chunked(map.mapPlanes) { JsonArray(it.toList()) }
        put("gains", JsonArray(points.chunked(map.pointsH) { JsonArray(it.toList()) }))
    }

    /** Of the samples as little-endian uint16. */
    private fun hash(samples: ShortArray): String {
        val bytes = ByteArray(2 * samples.size) { (samples[it / 2].toInt() shr 8 * (it % 2)).toByte() }
        return MessageDigest.getInstance("SHA-256").digest(bytes).joinToString("") { "%02x".format(it) }
    }

    fun pose(case: GoldenCase): Map<String, Any?> {
        val chart = card(case) ?: ChartTable.read(case.inputs.text("table"))
        val corners = forms.resolve(case.inputs.getValue("corners")).values
        val found = ChartPose.refine(read(case.inputs.text("dng")), Corners.of(*corners), chart)
        return mapOf(
            "corners" to Tensor(found.corners.toArray(), 4, 2),
            "quads" to Tensor(found.sharedQuads, found.sharedQuads.size / 8, 4, 2),
            "quarter_turns" to found.quarterTurns,
            "score" to Tensor.scalar(found.score),
            "kept" to found.notes.isNotEmpty(),
        )
    }

    fun patches(case: GoldenCase): Map<String, Any?> {
        val (photo, white, dark) = listOf("photo", "white", "dark").map { role ->
            case.inputs.getValue(role).takeIf { it != JsonNull }?.let { read(it.jsonPrimitive.content) }
        }
        val quads = forms.resolve(case.inputs.getValue("quads"))
        val pose = ChartPose("classic24", DoubleArray(8), quads.values, 0, "by hand", 1.0, emptyList())
        val shading = LensShading.of(case.inputs.text("lens_shading"))
        val found = PatchMeans.measure(photo!!, pose, white, dark, shading)
        val frames = mapOf("chart" to found.chart, "white" to found.white, "dark" to found.dark)
        return frames.flatMap { (name, frame) ->
            statistics(frame, quads.shape[0]).map {
                "${name}_${it.key}" to
                    it.value
            }
        }
            .toMap() + mapOf("black" to Tensor(found.sharedBlack, 3), "saturation" to found.saturation) + noise(found)
    }

    private fun noise(means: PatchMeans): Map<String, Any?> {
        fun plain(estimate: Estimate?) = estimate?.let { Tensor(doubleArrayOf(it.value, it.error), 2) }
        val noise = means.noise!!
        val (unlike, like) = plain(noise.unlike) to plain(noise.like)
        return mapOf("noise_step" to noise.step, "noise_unlike" to unlike, "noise_like" to like)
    }

    private fun statistics(frame: FrameMeans?, n: Int): Map<String, Tensor?> = mapOf(
        "mean" to frame?.let { Tensor(it.sharedMean, n, 3) },
        "standard_error" to frame?.let { Tensor(it.sharedError, n, 3) },
        "count" to frame?.let { found -> Tensor(DoubleArray(3 * n) { found.sharedCount[it].toDouble() }, n, 3) },
        "clipped" to frame?.let { Tensor(it.sharedClipped, n, 3) },
        "dead" to frame?.let { Tensor(it.sharedDead, n, 3) },
        "gradient" to frame?.let { Tensor(it.sharedGradient, n, 3) },
        "greens" to frame?.let { Tensor(it.sharedGreens, n, 2) },
    )
}
