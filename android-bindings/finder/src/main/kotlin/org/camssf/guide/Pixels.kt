package org.camssf.guide

import org.camssf.InvalidArgument
import org.camssf.finder.Picture
import org.camssf.finder.Plane
import org.camssf.finder.Source
import kotlin.math.pow
import kotlin.math.roundToInt

/**
 * Reads the linear light of a picture's pixels, on the assumption that its bytes are sRGB. [read] sets the
 * properties.
 *
 * @throws InvalidArgument the picture does not consist of 8-bit planes.
 */
internal class Pixels(picture: Picture) {
    private val source = picture.source as? Source.Bytes ?: throw InvalidArgument(
        "A guide looks at a preview's frames, 8 bits as on a display.",
        "Give it Picture.yuv, Picture.rgb or Picture.luma.",
    )
    val width = picture.width
    val height = picture.height
    private val planes = source.planes
    val hasColour = planes.size == 3
    private val sharp = planes[if (hasColour && !source.yuv) 1 else 0]

    var red = 0.0
        private set
    var green = 0.0
        private set
    var blue = 0.0
        private set

    /** Luminance. */
    var luma = 0.0
        private set

    /** The largest of the pixel's bytes. */
    var peak = 0
        private set

    /** Reads the pixel at column x and row y, or the nearest one if that lies outside. */
    fun read(x: Int, y: Int) {
        val column = x.coerceIn(0, width - 1)
        val row = y.coerceIn(0, height - 1)
        if (!hasColour) {
            planes[0].at(column, row).let { keep(it, it, it) }
        } else if (!source.yuv) {
            keep(planes[0].at(column, row), planes[1].at(column, row), planes[2].at(column, row))
        } else { // JFIF, full range
            val y8 = planes[0].at(column, row)
            val u = planes[1].at(column / 2, row / 2) - 128
            val v = planes[2].at(column / 2, row / 2) - 128
            keep(
                (y8 + 1.402 * v).roundToInt().coerceIn(0, 255),
                (y8 - 0.344136 * u - 0.714136 * v).roundToInt().coerceIn(0, 255),
                (y8 + 1.772 * u).roundToInt().coerceIn(0, 255),
            )
        }
    }

    private fun Plane.at(x: Int, y: Int): Int = bytes.get(y * rowStride + x * pixelStride).toInt() and 0xff

    private fun keep(r: Int, g: Int, b: Int) {
        red = LINEAR[r]
        green = LINEAR[g]
        blue = LINEAR[b]
        luma = 0.2126 * red + 0.7152 * green + 0.0722 * blue
        peak = maxOf(r, g, b)
    }

    /** Linear light between pixels (bilinear), from the plane that shows borders best: luma, or green. */
    fun between(x: Double, y: Double): Double {
        val left = x.coerceIn(0.0, width - 1.000001)
        val top = y.coerceIn(0.0, height - 1.000001)
        val column = left.toInt()
        val row = top.toInt()
        val p = left - column
        val q = top - row
        val upper = LINEAR[sharp.at(column, row)] * (1 - p) + LINEAR[sharp.at(column + 1, row)] * p
        val lower = LINEAR[sharp.at(column, row + 1)] * (1 - p) + LINEAR[sharp.at(column + 1, row + 1)] * p
        return upper * (1 - q) + lower * q
    }

    companion object {
        /** sRGB byte to linear light, IEC 61966-2-1. */
        val LINEAR = DoubleArray(256) {
            val c = it / 255.0
            if (c <= 0.04045) c / 12.92 else ((c + 0.055) / 1.055).pow(2.4)
        }
    }
}
