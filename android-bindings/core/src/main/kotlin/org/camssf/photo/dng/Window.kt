package org.camssf.photo.dng

import org.camssf.checkInterrupt
import org.camssf.photo.Region
import org.camssf.photo.Rows

/**
 * Collects the wanted samples from the rows of decoded pieces.
 *
 * @property wanted the part to collect, in samples of the stored picture.
 * @property table (65536) linearisation table, or null.
 * @property sink receives the rows, in coordinates of the stored picture, and nothing is kept; null keeps all
 *   samples.
 */
internal class Window(private val wanted: Region, private val table: ShortArray?, private val sink: Rows? = null) {
    /** (wanted.height, wanted.width) row-major; with a sink, one row that is reused. */
    val samples = ShortArray(if (sink == null) wanted.width * wanted.height else wanted.width)

    /** A row of a piece. `copy` writes `count` of its columns, starting at `from`, to `into` at index `at`. */
    fun interface Row {
        fun copy(from: Int, count: Int, into: ShortArray, at: Int)
    }

    /** The wanted rows of a piece at (left, top) with `rows` rows; empty if it lies outside. */
    fun rows(left: Int, top: Int, width: Int, rows: Int): IntRange {
        if (left >= wanted.right || left + width <= wanted.left) return IntRange.EMPTY
        return maxOf(wanted.top - top, 0) until minOf(wanted.bottom - top, rows)
    }

    /**
     * Stores those of `count` samples of the stored picture's row y, from column x on, that are wanted.
     *
     * @param row the source of the samples; its column 0 is x.
     */
    fun put(x: Int, y: Int, count: Int, row: Row) {
        checkInterrupt()
        val first = maxOf(x, wanted.left)
        val some = minOf(x + count, wanted.right) - first
        if (y < wanted.top || y >= wanted.bottom || some <= 0) return
        val at = if (sink == null) (y - wanted.top) * wanted.width + first - wanted.left else 0
        row.copy(first - x, some, samples, at)
        if (table != null) for (i in at until at + some) samples[i] = table[samples[i].toInt() and 0xffff]
        sink?.take(y, first, some, samples, at)
    }
}
