package org.camssf.photo

import org.camssf.ChartNotFound
import org.camssf.Rules
import kotlin.math.floor

/** Which samples of a patch are measured: rules 1 and 2 of docs/patches.md. */
internal object PatchSamples {
    /** Part of each patch edge that is measured. */
    private val SHRINK get() = Rules.shipped.number("patches.shrink")

    /** Samples that each position of the CFA cell must have in every patch. */
    val FEWEST get() = Rules.shipped.whole("patches.fewest")

    /** Index in the 2 × 2 cell of R, the green on R's rows, the green on B's rows, B. */
    fun cells(cfa: String): List<Int> {
        val red = cfa.indexOf('R')
        val blue = cfa.indexOf('B')
        return listOf(red, red xor 1, blue xor 1, blue)
    }

    /** x, y of the middle of a quad (4, 2). */
    fun centre(quad: DoubleArray): DoubleArray =
        DoubleArray(2) { ((quad[it] + quad[2 + it]) + (quad[4 + it] + quad[6 + it])) * 0.25 }

    /**
     * Columns and rows, in turn, of the cell's samples in the shrunk quad (4, 2), px.
     *
     * @throws ChartNotFound the patch leaves the photo of `width` × `height`.
     */
    fun select(quad: DoubleArray, cell: Int, width: Int, height: Int, patch: Int): IntArray {
        val centre = centre(quad)
        val moved = DoubleArray(8) { 16 * (centre[it % 2] + SHRINK * (quad[it] - centre[it % 2])) }
        val limit = doubleArrayOf(16.0 * (width - 1), 16.0 * (height - 1))
        if (!moved.indices.all { moved[it] >= 0 && moved[it] <= limit[it % 2] }) { // NaN is none
            throw ChartNotFound(
                "Patch $patch leaves the photo.",
                "Take the photo with the whole chart in view, or correct the corners.",
            )
        }
        val corners = LongArray(8) { floor(moved[it] + 0.5).toLong() }
        val low = LongArray(2) { axis -> ((0..3).minOf { corners[2 * it + axis] } + 15) / 16 }
        val high = LongArray(2) { axis -> (0..3).maxOf { corners[2 * it + axis] } / 16 }
        val found = IntArray((2 * ((high[0] - low[0]) / 2 + 1) * ((high[1] - low[1]) / 2 + 1)).toInt())
        var size = 0
        var row = low[1] + (cell / 2 + low[1]) % 2
        while (row <= high[1]) {
            var column = low[0] + (cell % 2 + low[0]) % 2
            while (column <= high[0]) {
                if (inside(corners, column, row)) {
                    found[size++] = column.toInt()
                    found[size++] = row.toInt()
                }
                column += 2
            }
            row += 2
        }
        return found.copyOf(size)
    }

    private fun inside(corners: LongArray, column: Long, row: Long): Boolean = (0..3).all { a ->
        val b = (a + 1) % 4
        (corners[2 * b] - corners[2 * a]) * (16 * row - corners[2 * a + 1]) >=
            (corners[2 * b + 1] - corners[2 * a + 1]) * (16 * column - corners[2 * a])
    }

    fun tooSmall(frame: Mosaic, patch: Int, count: Int) = ChartNotFound(
        "${frame.name}: patch $patch holds only $count good samples of a colour, $FEWEST are needed.",
        "Go closer so that the chart fills the frame, and wipe dust off chart and lens.",
        count.toDouble(),
        FEWEST.toDouble(),
    )
}
