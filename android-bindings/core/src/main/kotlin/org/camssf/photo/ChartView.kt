package org.camssf.photo

import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.spectra.ChartTable
import kotlin.math.ceil
import kotlin.math.floor
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.min
import kotlin.math.pow
import kotlin.math.sqrt

/**
 * A reduced picture of a part of a mosaic: mean colours of CFA cells, one pixel for `step` mosaic pixels from
 * (`left`, `top`) on.
 *
 * @property colours (height, width, 3) DN above black.
 */
internal class ChartView private constructor(
    val width: Int,
    val height: Int,
    val step: Int,
    private val left: Int,
    private val top: Int,
    val colours: FloatArray,
) {
    fun toMosaic(points: DoubleArray): DoubleArray =
        DoubleArray(points.size) { step * points[it] + (step - 1) / 2.0 + if (it % 2 == 0) left else top }

    fun fromMosaic(points: DoubleArray): DoubleArray =
        DoubleArray(points.size) { (points[it] - (step - 1) / 2.0 - if (it % 2 == 0) left else top) / step }

    /** (height, width) sum over channels of √(signal / its 98th percentile): even noise, and dark patches not lost. */
    fun brightness(): DoubleArray {
        val total = DoubleArray(width * height)
        for (c in 0..2) {
            val thin = (0 until height step 4).flatMap { y ->
                (0 until width step 4).map {
                    colours[
                        3 *
                            (y * width + it) +
                            c,
                    ]
                }
            }
            val most = max(percentile(thin.toFloatArray(), 0.98), 1f)
            for (i in total.indices) total[i] += sqrt(max(colours[3 * i + c] / most, 0f))
        }
        return total
    }

    companion object {
        /**
         * The part `left until right`, `top until bottom` of a mosaic in whole-number blocks of cells, so many that no
         * side is longer than `longest`.
         *
         * @throws InvalidArgument if those samples are not in the mosaic's region.
         */
        fun of(mosaic: Mosaic, longest: Int, box: Region): ChartView {
            val left = box.left / 2 * 2
            val top = box.top / 2 * 2
            val factor =
                max(1, ceil(max((box.bottom - top) / 2, (box.right - left) / 2) / longest.toDouble()).toInt())
            val rows = (box.bottom - top) / 2 / factor
            val columns = (box.right - left) / 2 / factor
            if (rows == 0 || columns == 0) {
                throw InvalidArgument("The corners leave no picture.", "Give the corners of the whole chart.")
            }
            val whole = Region(left, top, left + 2 * columns * factor, top + 2 * rows * factor)
            mosaic[whole.left, whole.top]
            mosaic[whole.right - 1, whole.bottom - 1]
            val colours = FloatArray(3 * rows * columns)
            val stride = mosaic.region.width
            for (position in 0..3) {
                val colour = "RGB".indexOf(mosaic.cfa[position])
                val share = if (colour == 1) 0.5f else 1f
                val black = mosaic.black[position].toFloat()
                for (row in 0 until rows) {
                    for (column in 0 until columns) {
                        var sum = 0L
                        for (v in 0 until factor) {
                            val y = top + 2 * (row * factor + v) + position / 2 - mosaic.region.top
                            var at = y * stride + left + 2 * column * factor + position % 2 - mosaic.region.left
                            repeat(factor) {
                                sum += mosaic.samples[at].toInt() and 0xffff
                                at += 2
                            }
                        }
                        colours[3 * (row * columns + column) + colour] += share * (block(sum, factor) - black)
                    }
                }
            }
            return ChartView(columns, rows, 2 * factor, left, top, colours)
        }

        /** Mean of factor² samples as a whole number; halves go to the even one, or up if factor is 2 (as OpenCV does). */
        private fun block(sum: Long, factor: Int): Float = when (factor) {
            1 -> sum.toFloat()
            2 -> ((sum + 2) / 4).toFloat()
            else -> Math.rint((sum.toFloat() * (1f / (factor * factor))).toDouble()).toFloat()
        }

        /** The value below which the share q lies, straight between the sorted values, in float32. */
        fun percentile(values: FloatArray, q: Double): Float {
            val sorted = values.sortedArray()
            val place = (sorted.size - 1) * q
            val i = min(floor(place).toInt(), sorted.size - 1)
            val t = (place - i).toFloat()
            val a = sorted[i]
            val b = sorted[min(i + 1, sorted.size - 1)]
            return if (t >= 0.5f) b - (b - a) * (1 - t) else a + (b - a) * t
        }
    }
}

/** How well colours of patches agree with a table's. */
internal object Agreement {
    /**
     * Correlation of patch colours with what the table predicts, -1 to 1, whatever cast and exposure.
     *
     * From ln c each channel's mean over the patches is taken out (a free gain a channel); the rest is split into
     * lightness, the mean over channels, and chroma, the difference from it, which counts double.
     *
     * @param measured (n, 3) DN above black; values below 0.2 % of the largest count as that.
     * @param expected (n, 3) predicted signals, any scale.
     */
    fun of(measured: DoubleArray, expected: DoubleArray): Double {
        val x = features(measured)
        val y = features(expected)
        val size = sqrt(x.sumOf { it * it }) * sqrt(y.sumOf { it * it })
        return if (size > 0) x.indices.sumOf { x[it] * y[it] } / size else 0.0
    }

    private fun features(colours: DoubleArray): DoubleArray {
        val least = max(2e-3 * colours.max(), 1e-12)
        val logs = DoubleArray(colours.size) { ln(max(colours[it], least)) }
        val n = logs.size / 3
        for (c in 0..2) {
            val middle = (0 until n).sumOf { logs[3 * it + c] } / n
            for (i in 0 until n) logs[3 * i + c] -= middle
        }
        return DoubleArray(4 * n) {
            val i = it / 4
            val lightness = (logs[3 * i] + logs[3 * i + 1] + logs[3 * i + 2]) / 3
            if (it % 4 == 0) lightness else 2 * (logs[3 * i + it % 4 - 1] - lightness)
        }
    }

    /** (n, 3) signals of a plain camera (Gaussians at 600, 540, 455 nm, FWHM 90 nm) under a flat lamp. */
    fun expected(table: ChartTable): DoubleArray {
        val grid = Grid.WAVELENGTHS
        val curves = listOf(600.0, 540.0, 455.0).map { centre ->
            val curve = DoubleArray(Grid.SIZE) { 2.0.pow(-4 * ((grid[it] - centre) / 90).pow(2)) }
            val total = curve.sum()
            DoubleArray(Grid.SIZE) { curve[it] / total }
        }
        return DoubleArray(3 * table.patches.size) { i ->
            val from = i / 3 * Grid.SIZE
            (0 until Grid.SIZE).sumOf { table.values[from + it] * curves[i % 3][it] }
        }
    }
}
