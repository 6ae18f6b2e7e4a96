package org.camssf.photo

import org.camssf.ChartNotFound
import org.camssf.Refusal
import org.camssf.Rules
import kotlin.math.floor

/**
 * The samples of one position of the CFA cell in a patch: every second column of every second row.
 *
 * @property top first row.
 * @property first column of the first sample in each row.
 * @property count number of samples in each row.
 */
internal class Places(val top: Int, val first: IntArray, val count: IntArray) {
    /** Number of the first sample of each row, counted over all rows; the last entry is the total. */
    private val starts = IntArray(count.size + 1).also { for (i in count.indices) it[i + 1] = it[i] + count[i] }

    /** Number of samples. */
    val size: Int get() = starts.last()

    /** The smallest rectangle around the samples; null if there are none. */
    val box: Region?
        get() {
            val rows = count.indices.filter { count[it] > 0 }
            if (rows.isEmpty()) return null
            return Region(
                rows.minOf { first[it] },
                top + 2 * rows.first(),
                rows.maxOf { first[it] + 2 * count[it] - 1 },
                top + 2 * rows.last() + 1,
            )
        }

    /** Calls `each` with the number, column and row of every sample; column and row are counted in cells. */
    inline fun each(each: (Int, Int, Int) -> Unit) {
        for (row in count.indices) {
            for (i in 0 until count[row]) each(starts[row] + i, first[row] / 2 + i, top / 2 + row)
        }
    }

    /** Copies the samples that lie in a part of a row to `into`; arguments as in [Rows]. */
    fun take(y: Int, x: Int, samples: ShortArray, at: Int, length: Int, into: ShortArray) {
        if (y < top || (y - top) % 2 != 0) return
        val row = (y - top) / 2
        if (row >= count.size || count[row] == 0) return
        val from = first[row]
        val begin = if (x > from) (x - from + 1) / 2 else 0
        val end = minOf(count[row], (x + length - from + 1) / 2)
        for (i in begin until end) into[starts[row] + i] = samples[at + from + 2 * i - x]
    }
}

/** Selects the samples of a patch that are measured: rules 1 and 2 of docs/patches.md. */
internal object PatchSamples {
    /** Fraction of each patch edge that is measured. */
    private val SHRINK get() = Rules.shipped.number("patches.shrink")

    /** Number of samples that each position of the CFA cell needs in every patch. */
    val FEWEST get() = Rules.shipped.whole("patches.fewest")

    /** Index in the 2 × 2 cell of R, the green on R's rows, the green on B's rows, B. */
    fun cells(cfa: String): List<Int> {
        val red = cfa.indexOf('R')
        val blue = cfa.indexOf('B')
        return listOf(red, red xor 1, blue xor 1, blue)
    }

    /** x, y of the centre of a quad (4, 2). */
    fun centre(quad: DoubleArray): DoubleArray =
        DoubleArray(2) { ((quad[it] + quad[2 + it]) + (quad[4 + it] + quad[6 + it])) * 0.25 }

    /**
     * Selects the samples of position `cell` (0 to 3) of the CFA cell in the shrunk quad (4, 2), px.
     *
     * @throws ChartNotFound the patch leaves the photo of `width` × `height`.
     */
    fun select(quad: DoubleArray, cell: Int, width: Int, height: Int, patch: Int): Places {
        val centre = centre(quad)
        val moved = DoubleArray(8) { 16 * (centre[it % 2] + SHRINK * (quad[it] - centre[it % 2])) }
        val limit = doubleArrayOf(16.0 * (width - 1), 16.0 * (height - 1))
        if (!moved.indices.all { moved[it] >= 0 && moved[it] <= limit[it % 2] }) { // false for NaN
            throw Refusal.of("chart_not_found.outside", "patch" to patch)
        }
        val corners = LongArray(8) { floor(moved[it] + 0.5).toLong() }
        val low = LongArray(2) { axis -> ((0..3).minOf { corners[2 * it + axis] } + 15) / 16 }
        val high = LongArray(2) { axis -> (0..3).maxOf { corners[2 * it + axis] } / 16 }
        val top = low[1] + (cell / 2 + low[1]) % 2
        val left = low[0] + (cell % 2 + low[0]) % 2
        val rows = if (top > high[1]) 0 else ((high[1] - top) / 2 + 1).toInt()
        val first = IntArray(rows)
        val count = IntArray(rows)
        for (row in 0 until rows) {
            val (begin, end) = columns(corners, top + 2 * row, low[0], high[0])
            val start = begin + (begin - left).mod(2L)
            first[row] = start.toInt()
            count[row] = if (start > end) 0 else ((end - start) / 2 + 1).toInt()
        }
        return Places(top.toInt(), first, count)
    }

    /**
     * First and last column of a row inside the quad, between `low` and `high`; the last lies before the first if there
     * are none. The intersection of four half-planes is convex, so the columns are contiguous; `corners` and the
     * half-planes are in sixteenths of a pixel, whole numbers.
     */
    private fun columns(corners: LongArray, row: Long, low: Long, high: Long): Pair<Long, Long> {
        var begin = low
        var end = high
        for (a in 0..3) {
            val b = (a + 1) % 4
            val across = corners[2 * b] - corners[2 * a]
            val down = corners[2 * b + 1] - corners[2 * a + 1]
            val reach = across * (16 * row - corners[2 * a + 1]) // inside: reach ≥ down (16 column - x)
            when {
                down > 0 -> end = minOf(end, (reach.floorDiv(down) + corners[2 * a]).floorDiv(16L))
                down < 0 -> begin = maxOf(begin, -(-(-(-reach).floorDiv(down) + corners[2 * a])).floorDiv(16L))
                reach < 0 -> return high + 1 to high
            }
        }
        return begin to end
    }

    fun tooSmall(frame: String, patch: Int, count: Int) = Refusal.of(
        "chart_not_found.few_samples", "file" to frame, "patch" to patch, "count" to count, "least" to FEWEST,
        value = count.toDouble(), threshold = FEWEST.toDouble(),
    )
}
