package org.camssf.golden

import kotlinx.serialization.json.JsonElement
import org.camssf.colour.RawRegion
import org.camssf.finder.ChartFinder
import org.camssf.finder.Picture
import org.camssf.finder.Plane
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
import kotlin.math.max
import kotlin.math.sqrt

/** The stages that begin with a DNG of golden/dng. */
internal class Photos(private val files: GoldenFiles) {
    private val finder by lazy { ChartFinder() }

    private fun read(name: String): Mosaic = DngSource.of(files.read("dng/$name"), name).use { DngReader.read(it) }

    /** The photo that an input names; null where it names none. */
    fun find(case: Fields, role: String): Mosaic? = case.findText(role)?.let { read(it) }

    fun mosaic(case: Fields): Map<String, Any?> {
        val found = read(case.text("dng"))
        return mapOf(
            "sha256" to found.origin.sha256,
            "width" to found.width, "height" to found.height, "orientation" to found.origin.orientation,
            "samples_sha256" to sha256(bytes(found.samples)),
            "cfa" to found.sensor.cfa,
            "black" to found.sensor.sharedBlack, "white" to found.sensor.white,
            "make" to found.origin.make, "model" to found.origin.model,
            "exposure" to found.origin.exposure, "iso" to found.origin.iso,
            "color_matrix1" to found.colours.colorMatrix1?.values,
            "color_matrix2" to found.colours.colorMatrix2?.values,
            "as_shot_neutral" to found.colours.asShotNeutral?.values,
            "matrices" to found.colours.colourMatrices.map { it.light },
            "gain_maps" to found.corrections.gainMaps.map { gainMap(it) },
            "as_shot_white_xy" to found.colours.asShotWhiteXY?.values,
            "noise_profile" to found.sensor.noiseProfile?.values,
            "masked_areas" to found.sensor.maskedAreas.map { area(it) },
            "bad_pixels" to found.corrections.badPixels.map { bad ->
                val (points, areas) = bad.points.toList().chunked(2) to bad.areas.map(::area)
                mapOf("list" to bad.list, "constant" to bad.constant, "points" to points, "areas" to areas)
            },
        )
    }

    private fun area(area: Region) = listOf(area.top, area.left, area.bottom, area.right)

    private fun gainMap(map: GainMap) = mapOf(
        "list" to map.list, "area" to area(map.area), "plane" to map.plane, "planes" to map.planes,
        "row_pitch" to map.rowPitch, "column_pitch" to map.columnPitch,
        "spacing" to listOf(map.spacingV, map.spacingH), "origin" to listOf(map.originV, map.originH),
        "gains" to map.gains.toList().chunked(map.mapPlanes).chunked(map.pointsH),
    )

    fun pose(case: Fields): Map<String, Any?> {
        val table = case.text("table")
        val chart = printedChart(case) ?: ChartTable.read(table)
        val found = ChartPose.refine(read(case.text("dng")), Corners.of(*case.values("corners")), chart)
        return mapOf(
            "corners" to found.corners.toArray(), "quads" to found.sharedQuads,
            "quarter_turns" to found.quarterTurns, "score" to found.score, "kept" to found.notes.isNotEmpty(),
        )
    }

    fun patches(case: Fields): Map<String, Any?> {
        val (photo, white, dark) = listOf("photo", "white", "dark").map { find(case, it) }
        val quads = case.tensor("quads")
        val pose = poseOf(DoubleArray(8), quads.values)
        val found = PatchMeans.measure(photo!!, pose, white, dark, LensShading.of(case.text("lens_shading")))
        val frames = mapOf("chart" to found.chart, "white" to found.white, "dark" to found.dark)
        val noise = found.noise!!
        return frames.flatMap { (name, frame) ->
            statistics(frame, quads.shape[0]).map { (statistic, value) -> "${name}_$statistic" to value }
        }.toMap() + mapOf(
            "black" to found.sharedBlack, "saturation" to found.saturation, "noise_step" to noise.step,
            "noise_unlike" to plain(noise.unlike), "noise_like" to plain(noise.like),
        )
    }

    private fun plain(estimate: Estimate?) = estimate?.let { listOf(it.value, it.error) }

    private fun statistics(frame: FrameMeans?, n: Int): Map<String, Tensor?> = mapOf(
        "mean" to frame?.sharedMean, "standard_error" to frame?.sharedError,
        "count" to frame?.let { found -> DoubleArray(3 * n) { found.sharedCount[it].toDouble() } },
        "clipped" to frame?.sharedClipped, "dead" to frame?.sharedDead,
        "gradient" to frame?.sharedGradient, "greens" to frame?.sharedGreens,
    ).mapValues { (_, values) -> values?.let { Tensor(it, n, it.size / n) } }

    fun regions(case: Fields): Map<String, Any?> {
        val (photo, dark) = listOf("photo", "dark").map { find(case, it) }
        val areas = case.list("areas").map { region(it) }
        val measured = RawRegion.measure(photo!!, areas, dark, LensShading.of(case.text("lens_shading")))
        return mapOf("raw" to measured.map { it.raw.values }, "standard_error" to measured.map { it.sharedError })
    }

    fun finder(case: Fields): Map<String, Any?> {
        val finder = printedChart(case)?.let { ChartFinder(it) } ?: finder
        val search = finder.find(picture(read(case.text("dng")), case.text("form")))
        val seen = search.candidates
        return mapOf(
            "findings" to search.findings.map { it.name.lowercase() },
            "kinds" to seen.map { it.kind.layouts[0] },
            "mirrored" to seen.map { it.mirrored }, "seen" to seen.map { it.seen },
            "corners" to seen.flatMap { it.corners.toArray().toList().chunked(2) },
            "patches" to seen.flatMap { it.patches }.map { listOf(it.x, it.y) },
            "confidence" to seen.map { it.confidence },
        )
    }

    private fun picture(photo: Mosaic, form: String): Picture {
        val (width, height) = photo.width / 2 to photo.height / 2
        val light = "RGB".map { letter ->
            val place = photo.sensor.cfa.indexOf(letter)
            IntArray(width * height) { max(photo[it % width * 2 + place % 2, it / width * 2 + place / 2] - 256, 0) }
        }
        val bytes = light.map { p -> ByteArray(p.size) { (2 * sqrt(p[it].toDouble()).toInt()).toByte() } }
        val (red, green, blue) = bytes.map { Plane(it, width) }
        fun chroma(colour: Int) = chroma(bytes[colour], bytes[1], width, height)
        return when (form) {
            "mosaic" -> Picture.of(photo)
            "light" -> Picture.light(light.map { p -> FloatArray(p.size) { p[it].toFloat() } }, width, height)
            "rgb" -> Picture.rgb(red, green, blue, width, height)
            "luma" -> Picture.luma(green, width, height)
            "yuv" -> Picture.yuv(green, chroma(2), chroma(0), width, height)
            else -> throw GoldenError("there is no form $form")
        }
    }

    /** 128 more than half the difference from green, of every second pixel; each byte twice, as interleaved planes are. */
    private fun chroma(colour: ByteArray, green: ByteArray, width: Int, height: Int): Plane {
        val columns = (width + 1) / 2
        val all = ByteArray(2 * columns * ((height + 1) / 2))
        for (i in all.indices) {
            val at = i / 2 / columns * 2 * width + i / 2 % columns * 2
            val difference = (colour[at].toInt() and 0xff) - (green[at].toInt() and 0xff)
            all[i] = (128 + Math.floorDiv(difference, 2)).coerceIn(0, 255).toByte()
        }
        return Plane(all, 2 * columns, 2)
    }
}

/** Samples as little-endian uint16. */
internal fun bytes(samples: ShortArray): ByteArray =
    ByteArray(2 * samples.size) { (samples[it / 2].toInt() shr 8 * (it % 2)).toByte() }

/** A region of x, y, width and height. */
internal fun region(of: JsonElement): Region {
    val (x, y, width, height) = numbers(of).map { it.toInt() }
    return Region(x, y, x + width, y + height)
}
