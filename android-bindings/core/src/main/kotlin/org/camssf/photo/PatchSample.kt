package org.camssf.photo

import org.camssf.ChartNotFound
import org.camssf.Rules
import kotlin.math.abs
import kotlin.math.max
import kotlin.math.sqrt

/**
 * One frame's statistics of one position of the CFA cell in one patch: rules 3 to 5 of docs/patches.md.
 *
 * @property mean of the samples, DN.
 * @property error standard error of the mean, DN.
 * @property count number of samples used.
 * @property change change of the fitted plane from edge to edge, DN.
 * @property clipped number of samples in `all` at or above the white level.
 * @property rejected number of samples in `all` rejected as dust or hot pixels.
 * @property all number of samples of the position in the patch.
 */
internal class PatchSample(
    val mean: Double,
    val error: Double,
    val count: Int,
    val change: Double,
    val clipped: Int,
    val rejected: Int,
    val all: Int,
) {
    companion object {
        /** Samples further from the median than this many MAD (plus FLOOR) are dust or hot pixels. */
        private val REJECT get() = Rules.shipped.whole("patches.reject")

        /** Deviation that is always allowed, DN; without noise, the MAD of whole numbers is zero. */
        private val FLOOR get() = Rules.shipped.whole("patches.floor")

        /**
         * Computes the statistics of one position of the CFA cell in one patch, for each frame of a shot. All frames
         * share one mask.
         *
         * @param name of the chart photo, for messages.
         * @param white level of each frame, DN.
         * @param samples samples of each frame at `places`, in their order.
         * @param patch number of the patch from 1, for messages.
         * @throws ChartNotFound the patch holds fewer than 16 good samples of the position.
         */
        fun of(
            name: String,
            white: List<Double>,
            places: Places,
            samples: List<ShortArray>,
            patch: Int,
        ): List<PatchSample> {
            val n = places.size
            if (n < PatchSamples.FEWEST) throw PatchSamples.tooSmall(name, patch, n)
            val values = samples.map { frame -> IntArray(n) { frame[it].toInt() and 0xffff } }
            val kept = values.map { kept(it) }
            val joint = indicesOf(n) { i -> kept.all { it[i] } }
            if (joint.size < PatchSamples.FEWEST) throw PatchSamples.tooSmall(name, patch, joint.size)
            val x = IntArray(joint.size)
            val y = IntArray(joint.size)
            var at = 0
            places.each { i, column, row ->
                if (at < joint.size && joint[at] == i) {
                    x[at] = column
                    y[at++] = row
                }
            }
            val left = x.min()
            val top = y.min()
            for (i in x.indices) {
                x[i] -= left
                y[i] -= top
            }
            return values.indices.map { f ->
                val v = IntArray(joint.size) { values[f][joint[it]] }
                val clipped = values[f].count { it >= white[f] }
                mean(v, x, y, clipped, kept[f].count { !it }, n)
            }
        }

        private inline fun indicesOf(n: Int, holds: (Int) -> Boolean): IntArray {
            val found = IntArray(n)
            var size = 0
            for (i in 0 until n) if (holds(i)) found[size++] = i
            return found.copyOf(size)
        }

        /** Sum of the two middle values, by counting sort, which suits the narrow range of a patch's values. */
        private fun twiceMedian(values: IntArray): Int {
            val least = values.min()
            val counts = IntArray(values.max() - least + 1)
            for (value in values) counts[value - least]++
            var below = 0
            var lower = -1
            for (at in counts.indices) {
                below += counts[at]
                if (lower < 0 && below > (values.size - 1) / 2) lower = at
                if (below > values.size / 2) return lower + at + 2 * least
            }
            error("no value")
        }

        /** False for dust and hot pixels: rule 3. */
        fun kept(values: IntArray): BooleanArray {
            val middle = twiceMedian(values)
            val deviation = IntArray(values.size) { abs(2 * values[it] - middle) }
            val limit = REJECT * twiceMedian(deviation) + 4 * FLOOR
            return BooleanArray(values.size) { 2 * deviation[it] <= limit }
        }

        /** Mean, standard error about the plane, and change from edge to edge: rule 5. */
        private fun mean(v: IntArray, x: IntArray, y: IntArray, clipped: Int, rejected: Int, all: Int): PatchSample {
            val n = v.size
            var total = 0L
            for (value in v) total += value
            val level = total / n
            // Sums of products of X, Y and e: whole numbers, so exact in any order.
            var sx = 0L
            var sy = 0L
            var se = 0L
            var xx = 0L
            var xy = 0L
            var xe = 0L
            var yy = 0L
            var ye = 0L
            var ee = 0L
            for (i in 0 until n) {
                val e = v[i] - level
                val right = x[i].toLong()
                val down = y[i].toLong()
                sx += right
                sy += down
                se += e
                xx += right * right
                xy += right * down
                xe += right * e
                yy += down * down
                ye += down * e
                ee += e * e
            }
            fun about(product: Long, a: Long, b: Long): Double = product - a.toDouble() * b / n
            val cxx = about(xx, sx, sx)
            val cxy = about(xy, sx, sy)
            val cxe = about(xe, sx, se)
            val cyy = about(yy, sy, sy)
            val cye = about(ye, sy, se)
            val determinant = cxx * cyy - cxy * cxy
            var a = 0.0
            var b = 0.0
            if (determinant > 0) {
                a = (cyy * cxe - cxy * cye) / determinant
                b = (cxx * cye - cxy * cxe) / determinant
            }
            val variance = max(0.0, about(ee, se, se) - a * cxe - b * cye) / (n - 3) + 1.0 / 12
            return PatchSample(
                total.toDouble() / n,
                sqrt(variance / n),
                n,
                abs(a) * x.max() + abs(b) * y.max(),
                clipped,
                rejected,
                all,
            )
        }
    }
}
