package org.camssf.golden

import org.camssf.finder.ChartFinder
import org.camssf.finder.Picture
import org.camssf.finder.Plane
import org.camssf.photo.Mosaic
import kotlin.math.max
import kotlin.math.sqrt

/** The stage `finder`: charts in one of the forms of a photo; golden/format.md says which. */
internal class Finders(private val photos: Photos) {
    private val finder = ChartFinder()

    fun finder(case: GoldenCase): Map<String, Any?> {
        val finder = case.card()?.let { ChartFinder(it) } ?: finder
        val found = finder.find(picture(photos.find(case, "dng")!!, case.text("form")))
        val seen = found.candidates
        return mapOf(
            "findings" to found.findings.map { it.name.lowercase() },
            "kinds" to seen.map { it.kind.layouts[0] },
            "mirrored" to seen.map { it.mirrored },
            "seen" to seen.map { it.seen },
            "corners" to seen.flatMap { it.corners.toArray().toList().chunked(2) },
            "patches" to seen.flatMap { it.patches }.map { listOf(it.x, it.y) },
            "confidence" to seen.map { it.confidence },
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
