package org.camssf.photo.dng

import org.camssf.checkInterrupt
import org.camssf.photo.Region
import org.camssf.photo.Rows

/**
 * The samples that are wanted, and how a piece's rows get there.
 *
 * @property wanted in samples of the stored picture.
 * @property table (65536) of the linearization, or null.
 * @property sink takes the rows, in samples of the stored picture, and nothing is kept; null to keep all.
 */
internal class Window(private val wanted: Region, private val table: ShortArray?, private val sink: Rows? = null) {
    /** (wanted.height, wanted.width) row-major; with a sink, one row that is used again. */
    val samples = ShortArray(if (sink == null) wanted.width * wanted.height else wanted.width)

    /** Takes, from any row of a piece, the columns from `from` on, `count` of them, into `samples` at `at`. */
    fun interface Row {
        fun copy(from: Int, count: Int, into: ShortArray, at: Int)
    }

    /** The rows of a piece at (left, top), `rows` high, that are wanted; empty where it lies aside. */
    fun rows(left: Int, top: Int, width: Int, rows: Int): IntRange {
        if (left >= wanted.right || left + width <= wanted.left) return IntRange.EMPTY
        return maxOf(wanted.top - top, 0) until minOf(wanted.bottom - top, rows)
    }

    /**
     * Puts `count` samples of the stored picture's row y, from column x on, as far as they are wanted.
     *
     * @param row gives them; its column 0 is x.
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
