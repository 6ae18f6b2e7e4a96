package org.camssf.fit

import org.camssf.Grid
import org.camssf.photo.Homography
import org.camssf.spectra.Bundled
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import kotlin.math.abs
import kotlin.math.atan2
import kotlin.math.cos
import kotlin.math.exp
import kotlin.math.hypot
import kotlin.math.pow
import kotlin.math.sin
import kotlin.math.sqrt

/** Converts XYZ under a lamp to Lab and sRGB under D65 for the report, as Python's `camssf.fit.scores`. */
internal object Colour {
    /** White point of CIE D65, 2° observer, Y = 1, from x = 0.3127, y = 0.3290. */
    private val D65 = doubleArrayOf(0.3127 / 0.3290, 1.0, (1 - 0.3127 - 0.3290) / 0.3290)

    /** CAT02, row-major (CIE 159:2004). */
    private val CAT02 = doubleArrayOf(0.7328, 0.4296, -0.1624, -0.7036, 1.6975, 0.0061, 0.0030, 0.0136, 0.9834)

    /** XYZ to linear sRGB (IEC 61966-2-1). */
    private val SRGB = doubleArrayOf(3.2406, -1.5372, -0.4986, -0.9689, 1.8758, 0.0415, 0.0557, -0.2040, 1.0570)
    private val BACK = Homography(CAT02).inverse()!!.matrix
    private val observer by lazy { Bundled.observer() }

    /** XYZ (n, 3) of reflectances (n, 681) under a lamp (681), CIE 1931 2°; Y of a perfect white is 1. */
    fun xyz(reflectance: DoubleArray, lamp: DoubleArray): DoubleArray {
        val total = (0 until Grid.SIZE).sumOf { lamp[it] * observer[1][it] }
        return DoubleArray(reflectance.size / Grid.SIZE * 3) { at ->
            val from = at / 3 * Grid.SIZE
            val curve = observer[at % 3]
            (0 until Grid.SIZE).sumOf { reflectance[from + it] * lamp[it] * curve[it] } / total
        }
    }

    /** XYZ (3) of a perfect white under a lamp. */
    fun white(lamp: DoubleArray): DoubleArray = xyz(DoubleArray(Grid.SIZE) { 1.0 }, lamp)

    /** Display colours (n, 3) of reflectances under D65, 0 to 1. */
    fun reflectance(table: ChartTable): DoubleArray {
        val light = Lamp.read("D65").sharedValues
        return srgb(adapted(xyz(table.sharedValues, light), white(light)))
    }

    /** XYZ (n, 3) seen under a white (3), adapted to D65 by von Kries with CAT02. */
    fun adapted(xyz: DoubleArray, white: DoubleArray): DoubleArray {
        val from = times(CAT02, white, 0)
        val to = times(CAT02, D65, 0)
        val found = DoubleArray(xyz.size)
        for (i in xyz.indices step 3) {
            val cones = times(CAT02, xyz, i)
            val moved = DoubleArray(3) { cones[it] * (to[it] / from[it]) }
            times(BACK, moved, 0).copyInto(found, i)
        }
        // Under a lamp of one line a cone response of the white can be 0: values that are not finite become 0.
        return DoubleArray(found.size) { if (found[it].isFinite()) found[it] else 0.0 }
    }

    private fun times(matrix: DoubleArray, vector: DoubleArray, at: Int): DoubleArray = DoubleArray(3) {
        matrix[3 * it] * vector[at] + matrix[3 * it + 1] * vector[at + 1] + matrix[3 * it + 2] * vector[at + 2]
    }

    /** CIE 1976 L*a*b* (n, 3) of XYZ (n, 3) under D65. */
    fun lab(xyz: DoubleArray): DoubleArray {
        fun f(t: Double) = if (t > (24.0 / 116).pow(3)) t.pow(1.0 / 3) else 841.0 / 108 * t + 16.0 / 116
        return DoubleArray(xyz.size) {
            val i = it - it % 3
            when (it % 3) {
                0 -> 116 * f(xyz[i + 1] / D65[1]) - 16
                1 -> 500 * (f(xyz[i] / D65[0]) - f(xyz[i + 1] / D65[1]))
                else -> 200 * (f(xyz[i + 1] / D65[1]) - f(xyz[i + 2] / D65[2]))
            }
        }
    }

    /** sRGB (n, 3), clipped to 0 to 1, of XYZ (n, 3) under D65. */
    fun srgb(xyz: DoubleArray): DoubleArray {
        val positive = DoubleArray(xyz.size) { maxOf(xyz[it], 0.0) }
        return DoubleArray(xyz.size) {
            val linear = times(SRGB, positive, it - it % 3)[it % 3]
            val encoded = if (linear <= 0.0031308) 12.92 * linear else 1.055 * linear.pow(1 / 2.4) - 0.055
            encoded.coerceIn(0.0, 1.0)
        }
    }

    /** CIEDE2000 of two L*a*b* (CIE 142:2001; G. Sharma et al., Color Res. Appl. 30, 2005). */
    fun difference(first: DoubleArray, second: DoubleArray): Double {
        val chroma = (hypot(first[1], first[2]) + hypot(second[1], second[2])) / 2
        val g = 0.5 * (1 - sqrt(chroma.pow(7) / (chroma.pow(7) + 25.0.pow(7))))
        val a1 = (1 + g) * first[1]
        val a2 = (1 + g) * second[1]
        val c1 = hypot(a1, first[2])
        val c2 = hypot(a2, second[2])
        val h1 = angle(first[2], a1)
        val h2 = angle(second[2], a2)
        val grey = c1 * c2 == 0.0
        val turn = when {
            grey -> 0.0
            abs(h2 - h1) <= 180 -> h2 - h1
            h2 - h1 > 180 -> h2 - h1 - 360
            else -> h2 - h1 + 360
        }
        val hue = when {
            grey -> h1 + h2
            abs(h1 - h2) <= 180 -> (h1 + h2) / 2
            h1 + h2 < 360 -> (h1 + h2 + 360) / 2
            else -> (h1 + h2 - 360) / 2
        }
        val lightness = (first[0] + second[0]) / 2 - 50
        val c = (c1 + c2) / 2
        val t = 1 - 0.17 * cosine(hue - 30) + 0.24 * cosine(2 * hue) + 0.32 * cosine(3 * hue + 6) -
            0.20 * cosine(4 * hue - 63)
        val l = (second[0] - first[0]) / (1 + 0.015 * lightness * lightness / sqrt(20 + lightness * lightness))
        val m = (c2 - c1) / (1 + 0.045 * c)
        val h = 2 * sqrt(c1 * c2) * sin(radians(turn / 2)) / (1 + 0.015 * c * t)
        val rotation = -sin(radians(60 * exp(-((hue - 275) / 25).pow(2)))) * 2 *
            sqrt(c.pow(7) / (c.pow(7) + 25.0.pow(7)))
        return sqrt(l * l + m * m + h * h + rotation * m * h)
    }

    private fun angle(b: Double, a: Double): Double {
        if (a == 0.0 && b == 0.0) return 0.0
        val degrees = atan2(b, a) * 180 / Math.PI
        return if (degrees < 0) degrees + 360 else degrees
    }

    private fun radians(degrees: Double): Double = degrees * Math.PI / 180

    private fun cosine(degrees: Double): Double = cos(radians(degrees))
}
