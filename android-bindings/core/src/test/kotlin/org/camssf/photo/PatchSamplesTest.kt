package org.camssf.photo

import org.camssf.ChartNotFound
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test

/** Which samples of a patch are measured, and taken from rows however these come. */
class PatchSamplesTest {
    private val width = 60
    private val height = 50

    /** A patch about (x, y) whose measured half reaches `reach` px to every side. */
    private fun places(x: Double, y: Double, reach: Double, cell: Int): Places {
        val r = 2 * reach
        val quad = doubleArrayOf(x - r, y - r, x + r, y - r, x + r, y + r, x - r, y + r)
        return PatchSamples.select(quad, cell, width, height, 1)
    }

    /** Every sample of the cell within the square, its borders too, row by row. */
    private fun inside(x: Int, y: Int, reach: Int, cell: Int) = (y - reach..y + reach).flatMap { row ->
        (x - reach..x + reach).map { it to row }
    }.filter { (column, row) -> column % 2 == cell % 2 && row % 2 == cell / 2 }

    @Test
    fun `samples on the border of the middle half belong to it`() {
        for (cell in 0..3) {
            for (middle in listOf(20 to 20, 21 to 20, 20 to 21)) {
                val (x, y) = middle
                val found = places(x.toDouble(), y.toDouble(), 5.0, cell)
                val seen = ArrayList<Pair<Int, Int>>()
                found.each { i, column, row ->
                    assertEquals(seen.size, i)
                    seen += 2 * column + cell % 2 to 2 * row + cell / 2
                }
                assertEquals(inside(x, y, 5, cell), seen)
                assertEquals(seen.size, found.size)
                assertEquals(seen.first().second, found.top)
                assertTrue(found.count.all { it > 0 }, "rows without samples")
                val box = Region(
                    seen.minOf { it.first }, seen.minOf { it.second },
                    seen.maxOf { it.first } + 1, seen.maxOf { it.second } + 1,
                )
                assertEquals(box, found.box)
            }
        }
    }

    @Test
    fun `a patch between the samples has none`() {
        val found = places(20.5, 20.5, 0.3, 0)
        assertEquals(0, found.size)
        assertNull(found.box)
    }

    @Test
    fun `the box is around the rows that hold samples`() {
        val empty = Places(4, intArrayOf(50, 50), intArrayOf(0, 0))
        assertNull(empty.box)
        val rows = Places(4, intArrayOf(2, 9, 7, 8, 60), intArrayOf(0, 2, 4, 1, 0))
        assertEquals(Region(7, 6, 14, 11), rows.box)
        assertEquals(7, rows.size)
        assertEquals(Region(7, 6, 14, 9), Places(6, intArrayOf(7, 9), intArrayOf(4, 1)).box)
    }

    /** The middle half may touch the outermost samples, and no more. */
    @Test
    fun `a patch that leaves the photo is named`() {
        places(3.0, 25.0, 3.0, 0)
        places(25.0, 3.0, 3.0, 0)
        places(width - 4.0, 25.0, 3.0, 0)
        places(25.0, height - 4.0, 3.0, 0)
        for ((x, y) in listOf(2.9 to 25.0, 25.0 to 2.9, width - 3.9 to 25.0, 25.0 to height - 3.9)) {
            val error = assertThrows(ChartNotFound::class.java) { places(x, y, 3.0, 0) }
            assertEquals("Patch 1 leaves the photo.", error.message)
        }
        assertThrows(ChartNotFound::class.java) { places(Double.NaN, 25.0, 3.0, 0) }
    }

    @Test
    fun `rows may come in pieces`() {
        fun sample(x: Int, y: Int) = (100 * y + x).toShort()
        for (cell in 0..3) {
            val found = places(21.0, 20.0, 5.0, cell)
            val wanted = ShortArray(found.size)
            found.each { i, column, row -> wanted[i] = sample(2 * column + cell % 2, 2 * row + cell / 2) }
            for (length in listOf(1, 2, 3, 7, width)) {
                val taken = ShortArray(found.size)
                for (y in 0 until height) {
                    for (x in 0 until width step length) {
                        val count = minOf(length, width - x)
                        // The piece stands somewhere in its array.
                        val piece = ShortArray(count + 6) { -1 }
                        for (i in 0 until count) piece[3 + i] = sample(x + i, y)
                        found.take(y, x, piece, 3, count, taken)
                    }
                }
                assertEquals(wanted.toList(), taken.toList())
            }
        }
    }

    @Test
    fun `positions of the cell are R, the green beside it, the green beside B, B`() {
        assertEquals(listOf(0, 1, 2, 3), PatchSamples.cells("RGGB"))
        assertEquals(listOf(1, 0, 3, 2), PatchSamples.cells("GRBG"))
        assertEquals(listOf(2, 3, 0, 1), PatchSamples.cells("GBRG"))
        assertEquals(listOf(3, 2, 1, 0), PatchSamples.cells("BGGR"))
    }
}
