package org.camssf.photo

import org.camssf.InvalidArgument
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
