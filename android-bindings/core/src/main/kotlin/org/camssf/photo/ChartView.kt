package org.camssf.photo

import org.camssf.InvalidArgument
import org.camssf.Rules
import kotlin.math.ceil
import kotlin.math.floor
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.min
import kotlin.math.pow
import kotlin.math.sqrt

/**
 * A reduced picture of a part of a mosaic: mean colours of CFA cells. One pixel covers `step` × `step` mosaic
 * pixels; the first starts at (`left`, `top`).
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

    /**
     * (height, width) sum over channels of √(signal / its quantile `pose.bright`). The root equalises the noise and keeps
     * dark patches visible.
     */
    fun brightness(): DoubleArray {
        val total = DoubleArray(width * height)
        val thinned = Rules.shipped.whole("pose.thinned")
        for (c in 0..2) {
            val thin = (0 until height step thinned).flatMap { y ->
                (0 until width step thinned).map { colours[3 * (y * width + it) + c] }
            }
            val most = max(percentile(thin.toFloatArray(), Rules.shipped.number("pose.bright")), 1f)
            for (i in total.indices) total[i] += sqrt(max(colours[3 * i + c] / most, 0f))
        }
        return total
    }

    companion object {
        /**
         * Reduces the part `box` of a photo in square blocks of whole cells, large enough that no side is longer
         * than `longest`. Only the blocks' sums are kept.
         *
         * @throws InvalidArgument the photo does not hold these samples, or the part is smaller than one cell.
         */
        fun of(photo: Reading, longest: Int, box: Region): ChartView {
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
            val sums = Array(4) { LongArray(rows * columns) } // by position in the cell
            photo.scan(whole) { y, x, count, samples, at ->
                val row = (y - top) / 2 / factor * columns
                for (side in 0..1) {
                    val sum = sums[(y - top) % 2 * 2 + side]
                    var from = x - left + (x - left + side) % 2
                    while (from < x - left + count) {
                        val block = from / 2 / factor
                        val until = min(2 * (block + 1) * factor, x - left + count)
                        var total = 0L
                        while (from < until) {
                            total += samples[at + left + from - x].toInt() and 0xffff
                            from += 2
                        }
                        sum[row + block] += total
                    }
                }
            }
            val sensor = photo.facts.sensor
            val colours = FloatArray(3 * rows * columns)
            for (position in 0..3) {
                val colour = "RGB".indexOf(sensor.cfa[position])
                val share = if (colour == 1) 0.5f else 1f
                val black = sensor.sharedBlack[position].toFloat()
                val sum = sums[position]
                for (i in sum.indices) colours[3 * i + colour] += share * (block(sum[i], factor) - black)
            }
            return ChartView(columns, rows, 2 * factor, left, top, colours)
        }

        /**
         * Mean of factor² samples as a whole number; halves are rounded to even, or up if factor is 2 (as OpenCV
         * does).
         */
        private fun block(sum: Long, factor: Int): Float = when (factor) {
            1 -> sum.toFloat()
            2 -> ((sum + 2) / 4).toFloat()
            else -> Math.rint((sum.toFloat() * (1f / (factor * factor))).toDouble()).toFloat()
        }

        /** The quantile q, 0 to 1, with linear interpolation between the sorted values, in float32. */
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
