package org.camssf.golden

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonPrimitive
import org.camssf.finder.ChartFinder
import org.camssf.finder.Picture
import org.camssf.finder.Plane
import org.camssf.flatten
import org.camssf.photo.Mosaic
import org.camssf.recovery.Tensor
import org.camssf.spectra.ChartLayout
import org.camssf.spectra.ChartTable
import kotlin.math.max
import kotlin.math.sqrt

/** The stage `finder`: charts in one of the forms of a photo; golden/format.md says which. */
internal class Finders(private val photos: Photos) {
    private val finder = ChartFinder()

    fun finder(case: GoldenCase): Map<String, Any?> {
        val finder = card(case)?.let { ChartFinder(it) } ?: finder
        val found = finder.find(picture(photos.read(case.inputs.text("dng")), case.inputs.text("form")))
        val seen = found.candidates
        val corners = seen.map { it.corners.toArray() }.flatten()
        val patches = seen.flatMap { it.patches }.map { doubleArrayOf(it.x, it.y) }.flatten()
        return mapOf(
            "findings" to JsonArray(found.findings.map { JsonPrimitive(it.name.lowercase()) }),
            "kinds" to JsonArray(seen.map { JsonPrimitive(it.kind.layouts[0]) }),
            "mirrored" to JsonArray(seen.map { JsonPrimitive(it.mirrored) }),
            "seen" to JsonArray(seen.map { JsonPrimitive(it.seen) }),
            "corners" to Tensor(corners, corners.size / 2, 2),
            "patches" to Tensor(patches, patches.size / 2, 2),
            "confidence" to Tensor(DoubleArray(seen.size) { seen[it].confidence }, seen.size),
        )
    }

    private fun picture(photo: Mosaic, form: String): Picture {
        if (form == "mosaic") return Picture.of(photo)
        val width = photo.width / 2
        val height = photo.height / 2
        val light = "RGB".map { letter ->
            val place = photo.sensor.cfa.indexOf(letter)
            IntArray(width * height) {
                max(photo[it % width * 2 + place % 2, it / width * 2 + place / 2] - BLACK, 0)
            }
        }
        if (form == "light") {
            return Picture.light(light.map { p -> FloatArray(p.size) { p[it].toFloat() } }, width, height)
        }
        val bytes = light.map { p -> ByteArray(p.size) { (2 * sqrt(p[it].toDouble()).toInt()).toByte() } }
        val (red, green, blue) = bytes.map { Plane(it, width) }
        return when (form) {
            "rgb" -> Picture.rgb(red, green, blue, width, height)

            "luma" -> Picture.luma(green, width, height)

            "yuv" -> {
                val (u, v) = listOf(2, 0).map { chroma(bytes, it, width, height) }
                Picture.yuv(green, u, v, width, height)
            }

            else -> throw GoldenError("there is no form $form")
        }
    }

    /** 128 more than half the difference from green, of every second pixel; each byte twice, as interleaved planes are. */
    private fun chroma(bytes: List<ByteArray>, of: Int, width: Int, height: Int): Plane {
        val columns = (width + 1) / 2
        val all = ByteArray(2 * columns * ((height + 1) / 2))
        for (i in all.indices) {
            val at = i / 2 / columns * 2 * width + i / 2 % columns * 2
            val difference = (bytes[of][at].toInt() and 0xff) - (bytes[1][at].toInt() and 0xff)
            all[i] = (128 + Math.floorDiv(difference, 2)).coerceIn(0, 255).toByte()
        }
        return Plane(all, 2 * columns, 2)
    }

    private companion object {
        const val BLACK = 256
    }
}

/** The chart of the inputs `layout` and `csv`; null where a case has none. */
internal fun card(case: GoldenCase): ChartTable? {
    val layout = case.inputs["layout"] ?: return null
    val printed = ChartLayout.parse("card.json", layout.toString().toByteArray())
    return ChartTable.parse("card.csv", case.inputs.text("csv").toByteArray(), printed)
}
