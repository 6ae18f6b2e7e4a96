package org.camssf.colour

import org.camssf.Grid
import org.camssf.Nodes
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.exp

class SpacesTest {
    private val light = Lamp.read("A").values.values

    private fun bell(centre: Double, width: Double): DoubleArray {
        val grid = Grid.wavelengths.values
        return DoubleArray(Grid.SIZE) { exp(-0.5 * ((grid[it] - centre) / width).let { u -> u * u }) }
    }

    private val curves = arrayOf(bell(605.0, 30.0), bell(535.0, 36.0), bell(460.0, 28.0))

    @Test
    fun `slopes of Lab are its derivatives, on both sides of the bend`() {
        val white = doubleArrayOf(0.95, 1.0, 1.09)
        for (xyz in listOf(doubleArrayOf(0.2, 0.3, 0.1), doubleArrayOf(0.004, 0.005, 0.006))) {
            val slopes = Spaces.slopes(xyz, white)
            for (c in 0..2) {
                val step = 1e-7
                val (up, down) = listOf(step, -step).map { by ->
                    Spaces.lab(DoubleArray(3) { xyz[it] + if (it == c) by else 0.0 }, white)
                }
                for (row in 0..2) {
                    assertEquals((up[row] - down[row]) / (2 * step), slopes[3 * row + c], 1e-4)
                }
            }
        }
    }

    @Test
    fun `Lab of white and black`() {
        val d65 = doubleArrayOf(0.9504, 1.0, 1.0888)
        assertArrayEquals(doubleArrayOf(100.0, 0.0, 0.0), Spaces.lab(d65, d65), 1e-12)
        assertArrayEquals(DoubleArray(3), Spaces.lab(DoubleArray(3), d65), 1e-12)
    }

    @Test
    fun `real surfaces lie in reach, and no light does`() {
        val units = List(Nodes.SIZE) { node -> Nodes.straight { if (it == node) 1.0 else 0.0 } }
        val matrix = List(3) { c ->
            val seen = DoubleArray(Grid.SIZE) { light[it] * curves[c][it] }
            DoubleArray(Nodes.SIZE) { dot(seen, units[it]) / seen.sum() }
        }
        val spread = DoubleArray(9) { if (it % 4 == 0) 1e-6 else 0.0 }
        for (surface in Tables.surfaces) {
            val signals = DoubleArray(3) { dot(surface, matrix[it]) }
            assertTrue(SurfaceDistance.of(signals, spread, matrix) < 1e-6)
        }
        // beyond white, along the grey axis: the nearest surface is white, one floor of rounding beside Σ
        val over = DoubleArray(3) { 1.01 }
        assertEquals(10.0 * Math.sqrt(3.0), SurfaceDistance.of(over, spread, matrix), 1e-4)
        // below black: black is the nearest
        assertEquals(5.0, SurfaceDistance.of(doubleArrayOf(-0.003, 0.0, -0.004), spread, matrix), 1e-4)
    }
}
