package org.camssf.photo

import org.camssf.UnsupportedRaw
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.abs
import kotlin.math.max
import kotlin.math.min

/** A file's gain maps at a patch's centre. */
class ShadingTest {
    private val width = 80
    private val height = 40

    /** Three rows and four columns of points, none of them at the picture's borders. */
    private fun net(planes: Int) = GainMap.Net(
        3, 4, 0.2, 0.15, 0.1, 0.05, planes, FloatArray(12 * planes) { 1f + (it * 37 % 23) / 16f },
    )

    private fun map(
        area: Region = Region(0, 0, width, height),
        list: Int = 2,
        plane: Int = 0,
        planes: Int = 1,
        rowPitch: Int = 1,
        columnPitch: Int = 1,
        mapPlanes: Int = 1,
    ) = GainMap(list, area, plane, planes, rowPitch, columnPitch, net(mapPlanes))

    private fun facts(vararg maps: GainMap): Facts {
        val sensor = Mosaic.Sensor("GRBG", DoubleArray(4), 1000.0)
        val corrections = Mosaic.Corrections(maps.toList())
        return Facts(Mosaic.Origin("a.dng"), width, height, sensor, corrections, Mosaic.Colours())
    }

    private fun factors(x: Double, y: Double, vararg maps: GainMap): DoubleArray {
        val quad = doubleArrayOf(x - 3, y - 2, x + 3, y - 2, x + 3, y + 2, x - 3, y + 2)
        return Shading.of(facts(*maps), quad)
    }

    /** Every point's gain times a hat over it, beyond the outer points as at them. */
    private fun gain(x: Double, y: Double, of: GainMap, entry: Int = 0): Double {
        val v = min(max(((y + 0.5) / height - 0.1) / 0.2, 0.0), 2.0)
        val h = min(max(((x + 0.5) / width - 0.05) / 0.15, 0.0), 3.0)
        return (0..2).sumOf { i ->
            (0..3).sumOf { j ->
                val own = of.gains[i, j, entry]
                max(0.0, 1 - abs(v - i)) * max(0.0, 1 - abs(h - j)) * own
            }
        }
    }

    @Test
    fun `gains are interpolated, and constant beyond the points`() {
        val map = map()
        for (x in listOf(1.0, 3.5, 4.0, 10.0, 15.5, 22.0, 30.0, 39.4, 39.6, 70.0, 79.0)) {
            for (y in listOf(1.0, 3.4, 3.6, 8.0, 11.5, 16.0, 19.4, 19.6, 39.0)) {
                assertArrayEquals(DoubleArray(4) { gain(x, y, map) }, factors(x, y, map), 1e-12)
            }
        }
    }

    @Test
    fun `maps multiply, and none is none`() {
        assertArrayEquals(DoubleArray(4) { 1.0 }, factors(22.0, 14.0))
        val (one, two) = map() to map(Region(1, 0, width, height), columnPitch = 2)
        val found = factors(22.0, 14.0, one, two)
        val gain = gain(22.0, 14.0, one)
        assertArrayEquals(DoubleArray(4) { if (it % 2 == 1) gain * gain else gain }, found, 1e-12)
    }

    /** The patch's middle, rounded to a sample, lies in the area. */
    @Test
    fun `a map covers what lies in its area`() {
        val area = map(Region(10, 8, 20, 16))
        fun covered(x: Double, y: Double) = factors(x, y, area).all { it != 1.0 }
        fun free(x: Double, y: Double) = factors(x, y, area).all { it == 1.0 }
        assertTrue(covered(9.5, 12.0) && free(9.4, 12.0))
        assertTrue(covered(19.4, 12.0) && free(19.5, 12.0))
        assertTrue(covered(15.0, 7.5) && free(15.0, 7.4))
        assertTrue(covered(15.0, 15.4) && free(15.0, 15.5))
    }

    @Test
    fun `of every second row and column it covers its own`() {
        for ((left, top) in listOf(0 to 0, 1 to 0, 0 to 1, 1 to 1, 2 to 2, 3 to 2, 2 to 3, 5 to 7)) {
            val found = factors(22.0, 14.0, map(Region(left, top, width, height), rowPitch = 2, columnPitch = 2))
            assertEquals(listOf(2 * (top % 2) + left % 2), (0..3).filter { found[it] != 1.0 })
        }
        val rows = factors(22.0, 14.0, map(Region(0, 1, width, height), rowPitch = 2))
        assertEquals(listOf(2, 3), (0..3).filter { rows[it] != 1.0 })
    }

    /** The third list is of the picture with colours: its planes are R, G, B; the cell is G, R, B, G. */
    @Test
    fun `of a coloured picture a map covers its planes, each by its own gains`() {
        val all = map(list = 3, planes = 3, mapPlanes = 3)
        val entries = listOf(1, 0, 2, 1)
        assertArrayEquals(
            DoubleArray(4) { gain(22.0, 14.0, all, entries[it]) },
            factors(22.0, 14.0, all),
            1e-12,
        )
        // With gains for two planes the last stands for the others.
        val two = map(list = 3, planes = 3, mapPlanes = 2)
        assertEquals(gain(22.0, 14.0, two, 1), factors(22.0, 14.0, two)[2], 1e-12)
        val green = factors(22.0, 14.0, map(list = 3, plane = 1, planes = 1))
        assertEquals(listOf(0, 3), (0..3).filter { green[it] != 1.0 })
        val upper = factors(22.0, 14.0, map(list = 3, plane = 1, planes = 2))
        assertEquals(listOf(0, 2, 3), (0..3).filter { upper[it] != 1.0 })
        // A mosaic has plane 0 alone.
        assertTrue(factors(22.0, 14.0, map(plane = 1)).all { it == 1.0 })
    }

    @Test
    fun `samples have the gains of their own places`() {
        val maps = arrayOf(
            map(Region(10, 8, 60, 36)), map(Region(1, 0, width, height), rowPitch = 2, columnPitch = 2),
            map(list = 3, plane = 1, planes = 2, mapPlanes = 2),
        )
        val (rows, columns) = intArrayOf(39, 2, 0, 1, 8, 7, 35, 36, 20) to intArrayOf(0, 9, 10, 11, 59, 60, 79, 3)
        val all = Shading.ofSamples(facts(*maps), rows, columns)
        for ((i, y) in rows.withIndex()) {
            for ((j, x) in columns.withIndex()) {
                val own = factors(x.toDouble(), y.toDouble(), *maps)[y % 2 * 2 + x % 2]
                assertEquals(own, all[i * columns.size + j], "$x, $y")
            }
        }
    }

    @Test
    fun `a map of the stored picture, or of other steps, is refused`() {
        for (odd in listOf(map(list = 1), map(rowPitch = 3), map(columnPitch = 4))) {
            val error = assertThrows(UnsupportedRaw::class.java) { factors(22.0, 14.0, odd) }
            val words = "opcode list ${odd.list}, every ${odd.rowPitch} rows and ${odd.columnPitch} columns"
            assertTrue(words in error.message, error.message)
            assertThrows(UnsupportedRaw::class.java) { Shading.ofSamples(facts(odd), intArrayOf(0), intArrayOf(0)) }
        }
    }
}
