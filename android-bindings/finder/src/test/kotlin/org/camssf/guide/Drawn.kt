package org.camssf.guide

import org.camssf.Grid
import org.camssf.finder.Candidate
import org.camssf.finder.ChartKind
import org.camssf.finder.Finding
import org.camssf.finder.Found
import org.camssf.finder.Picture
import org.camssf.finder.Plane
import org.camssf.photo.Corners
import org.camssf.photo.Point
import org.camssf.spectra.ChartTable
import java.util.Random
import kotlin.math.PI
import kotlin.math.abs
import kotlin.math.cos
import kotlin.math.exp
import kotlin.math.pow
import kotlin.math.roundToInt
import kotlin.math.sin

/**
 * A frame of a Classic before a pinhole camera, drawn pixel by pixel: what the guide was built on.
 */
internal data class Drawn(
    val width: Int = 640,
    val height: Int = 480,
    /** Width of the block of patches, as a share of the picture's, where it is not tilted. */
    val fill: Double = 0.45,
    val tilt: Double = 0.0,
    /** Of the axis that the chart is tilted about, degrees from upright. */
    val axis: Double = 0.0,
    val rotation: Double = 0.0,
    val shiftX: Double = 0.0,
    val shiftY: Double = 0.0,
    val focal: Double = 0.75,
    /** Level of an ideal white. */
    val exposure: Double = 0.75,
    val blur: Double = 0.5,
    /** Bytes, one standard deviation. */
    val noise: Double = 1.5,
    val wall: List<Double> = listOf(0.2, 0.2, 0.2),
    /** Light that falls on place (u, v), pitches from the first patch. */
    val light: (Double, Double) -> Double = { _, _ -> 1.0 },
    /** Light that shines back from there, shares of white. */
    val shine: (Double, Double) -> Double = { _, _ -> 0.0 },
    val gap: Double = 0.12,
    val seed: Long = 1,
    /** Of the lamp, or of a white balance that is off. */
    val cast: List<Double> = listOf(1.0, 1.0, 1.0),
    /** How much steeper than sRGB's the tone curve is. */
    val contrast: Double = 1.0,
) {
    fun lit(lamp: List<Double>): Drawn = copy(cast = lamp)

    private val pitch = fill * width / (6 - gap)

    /** Chart's pitches to px. */
    private val matrix: DoubleArray = run {
        val f = focal * maxOf(width, height)
        val distance = f / pitch // in pitches
        val (a, b, c) = listOf(rotation, tilt, axis).map { it * PI / 180 }
        fun place(u: Double, v: Double): List<Double> {
            val x = cos(a) * (u - 2.5) - sin(a) * (v - 1.5)
            val y = sin(a) * (u - 2.5) + cos(a) * (v - 1.5)
            // About an axis through the middle: towards it nothing moves, across it by cos, and in depth by sin.
            val across = cos(c) * x + sin(c) * y
            val along = -sin(c) * x + cos(c) * y
            val (nx, ny) = cos(c) * across * cos(b) - sin(c) * along to sin(c) * across * cos(b) + cos(c) * along
            val z = distance + across * sin(b)
            val (cx, cy) = (width - 1) / 2.0 to (height - 1) / 2.0
            return listOf(
                f * (nx + shiftX * width / pitch) + cx * z,
                f * (ny + shiftY * height / pitch) + cy * z,
                z,
            )
        }
        val origin = place(0.0, 0.0)
        val u = place(1.0, 0.0).zip(origin) { p, q -> p - q }
        val v = place(0.0, 1.0).zip(origin) { p, q -> p - q }
        DoubleArray(9) { listOf(u, v, origin)[it % 3][it / 3] }
    }

    private fun at(u: Double, v: Double): Point {
        val m = matrix
        val z = m[6] * u + m[7] * v + m[8]
        return Point((m[0] * u + m[1] * v + m[2]) / z, (m[3] * u + m[4] * v + m[5]) / z)
    }

    /** Linear light, three planes. */
    private val linear: Array<DoubleArray> by lazy {
        val m = matrix
        val back = doubleArrayOf(
            m[4] * m[8] - m[5] * m[7], m[2] * m[7] - m[1] * m[8], m[1] * m[5] - m[2] * m[4],
            m[5] * m[6] - m[3] * m[8], m[0] * m[8] - m[2] * m[6], m[2] * m[3] - m[0] * m[5],
            m[3] * m[7] - m[4] * m[6], m[1] * m[6] - m[0] * m[7], m[0] * m[4] - m[1] * m[3],
        )
        val found = Array(3) { DoubleArray(width * height) }
        val half = (1 - gap) / 2
        for (y in 0 until height) {
            for (x in 0 until width) {
                var lit = 1.0
                var shining = 0.0
                val i = y * width + x
                for (sample in SAMPLES) {
                    val px = x + (sample % 3 - 1) / 3.0
                    val py = y + (sample / 3 - 1) / 3.0
                    val z = back[6] * px + back[7] * py + back[8]
                    val u = (back[0] * px + back[1] * py + back[2]) / z
                    val v = (back[3] * px + back[4] * py + back[5]) / z
                    val onChart = u > -0.8 && u < 5.8 && v > -0.8 && v < 3.8
                    val column = Math.rint(u).toInt().coerceIn(0, 5)
                    val row = Math.rint(v).toInt().coerceIn(0, 3)
                    val onPatch = abs(u - column) < half && abs(v - row) < half
                    if (sample == SAMPLES[0]) { // light changes slowly: once a pixel
                        lit = if (onChart) light(u, v) else 1.0
                        shining = if (onChart) shine(u, v) else 0.0
                    }
                    for (channel in 0..2) {
                        val reflected =
                            if (onPatch) {
                                PATCHES[3 * (6 * row + column) + channel]
                            } else if (onChart) {
                                0.03
                            } else {
                                wall[channel]
                            }
                        found[channel][i] += exposure * cast[channel] * (reflected * lit + shining) / SAMPLES.size
                    }
                }
            }
        }
        Array(3) { blurred(found[it]) }
    }

    private fun blurred(plane: DoubleArray): DoubleArray {
        if (blur <= 0) return plane
        val reach = (4 * blur).toInt() + 1
        val kernel = DoubleArray(2 * reach + 1) { exp(-0.5 * ((it - reach) / blur).pow(2)) }
        val sum = kernel.sum()
        fun along(from: DoubleArray, dx: Int, dy: Int): DoubleArray {
            val to = DoubleArray(from.size)
            for (y in 0 until height) {
                for (x in 0 until width) {
                    var total = 0.0
                    for (k in -reach..reach) {
                        val column = (x + k * dx).coerceIn(0, width - 1)
                        val row = (y + k * dy).coerceIn(0, height - 1)
                        total += kernel[k + reach] * from[row * width + column]
                    }
                    to[y * width + x] = total / sum
                }
            }
            return to
        }
        return along(along(plane, 1, 0), 0, 1)
    }

    /** Bytes of red, green, blue as a display would be given them. */
    private val bytes: Array<IntArray> by lazy {
        val random = Random(seed)
        Array(3) { channel ->
            IntArray(width * height) {
                val toned = linear[channel][it].coerceIn(0.0, 1.0).pow(contrast)
                val coded = CODED[((CODED.size - 1) * toned).roundToInt()]
                (255 * coded + noise * random.nextGaussian()).roundToInt().coerceIn(0, 255)
            }
        }
    }

    /** Red, green and blue. */
    fun planes(): List<Plane> = bytes.map { plane -> Plane(ByteArray(plane.size) { plane[it].toByte() }, width) }

    fun rgb(): Picture = planes().let { (r, g, b) -> Picture.rgb(r, g, b, width, height) }

    private fun brightness(i: Int) = (0.299 * bytes[0][i] + 0.587 * bytes[1][i] + 0.114 * bytes[2][i])

    /** Padded rows, and colours interleaved, as many phones have them. */
    fun yuv(): Picture {
        val y = ByteArray((width + 32) * height)
        for (i in 0 until width * height) {
            y[i / width * (width + 32) + i % width] =
                brightness(i).roundToInt().toByte()
        }
        val colours = ByteArray(width * (height / 2) + 2)
        for (row in 0 until height / 2) {
            for (column in 0 until width / 2) {
                val i = 2 * row * width + 2 * column
                val at = row * width + 2 * column
                colours[at] = (128 + (bytes[2][i] - brightness(i)) / 1.772).roundToInt().coerceIn(0, 255).toByte()
                colours[at + 1] = (128 + (bytes[0][i] - brightness(i)) / 1.402).roundToInt().coerceIn(0, 255).toByte()
            }
        }
        val u = java.nio.ByteBuffer.wrap(colours)
        val v = java.nio.ByteBuffer.wrap(colours, 1, colours.size - 1).slice()
        return Picture.yuv(Plane(y, width + 32), Plane(u, width, 2), Plane(v, width, 2), width, height)
    }

    fun luma(): Picture =
        Picture.luma(Plane(ByteArray(width * height) { brightness(it).roundToInt().toByte() }, width), width, height)

    /** Where the chart truly lies. */
    fun candidate(mirrored: Boolean = false): Candidate {
        val half = (1 - gap) / 2
        val corners = Corners(at(-half, -half), at(5 + half, -half), at(5 + half, 3 + half), at(-half, 3 + half))
        val patches = List(24) { at((it % 6).toDouble(), (it / 6).toDouble()) }
        return Candidate(corners, ChartKind.CLASSIC_24, mirrored, 0.97, patches, 24)
    }

    fun found(vararg findings: Finding): Found =
        Found(listOf(candidate(Finding.MIRRORED in findings)), findings.toSet())

    /** The measures of this frame alone. */
    fun measures(picture: Picture = rgb()): FrameMeasures =
        candidate().let { FrameMeter(focal).measure(picture, it, ChartPlane.of(it)!!, null) }

    companion object {
        private val CODED = DoubleArray(20001) {
            val c = it / 20000.0
            if (c <= 0.0031308) 12.92 * c else 1.055 * c.pow(1 / 2.4) - 0.055
        }

        /** Of 3 × 3 in a pixel, the middle first. */
        private val SAMPLES = intArrayOf(4, 0, 2, 6, 8)

        /** (24, 3) reflectance in red, green, blue. */
        val PATCHES: DoubleArray = ChartTable.read("classic24").let { table ->
            val values = table.sharedValues
            val grid = Grid.wavelengths.values
            DoubleArray(72) { i ->
                val centre = listOf(605.0, 545.0, 455.0)[i % 3]
                val weights = DoubleArray(Grid.SIZE) { exp(-0.5 * ((grid[it] - centre) / 30).pow(2)) }
                weights.indices.sumOf { weights[it] * values[i / 3 * Grid.SIZE + it] } / weights.sum()
            }
        }

        /** A spot of this strength. */
        fun spot(u: Double, v: Double, radius: Double, strength: Double): (Double, Double) -> Double =
            { x, y -> strength * exp(-0.5 * ((x - u).pow(2) + (y - v).pow(2)) / radius.pow(2)) }

        /** Light that is less by this factor beyond a line through the chart's middle, off by some pitches. */
        fun shadow(angle: Double, off: Double, factor: Double): (Double, Double) -> Double = { x, y ->
            if ((x - 2.5) * cos(angle * PI / 180) + (y - 1.5) * sin(angle * PI / 180) > off) factor else 1.0
        }
    }
}
