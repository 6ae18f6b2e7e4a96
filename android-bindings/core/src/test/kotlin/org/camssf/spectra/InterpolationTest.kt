package org.camssf.spectra

import org.camssf.Grid
import org.camssf.sum
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Test
import kotlin.math.abs
import kotlin.math.pow

class InterpolationTest {
    private val grid = Grid.wavelengths.values

    private fun polynomial(degree: Int): (Double) -> Double = { x ->
        (0..degree).sumOf { (it + 1) * ((x - 550) / 170).pow(it) }
    }

    @Test
    fun `straight lines are kept and held at the ends`() {
        val nodes = doubleArrayOf(400.0, 430.0, 500.0, 700.0)
        val found = Interpolation.linear(nodes, DoubleArray(4) { 2 * nodes[it] - 7 })
        val wanted = DoubleArray(Grid.SIZE) { 2 * grid[it].coerceIn(400.0, 700.0) - 7 }
        assertArrayEquals(wanted, found, 1e-12)
    }

    @Test
    fun `sprague keeps a polynomial of the fourth degree`() {
        val f = polynomial(4)
        val nodes = Interpolation.nodes(360.0, 10.0, 40)
        val found = Interpolation.sprague(360.0, 10.0, DoubleArray(40) { f(nodes[it]) })
        assertArrayEquals(DoubleArray(Grid.SIZE) { f(grid[it]) }, found, 1e-11)
    }

    @Test
    fun `a spline keeps a cubic on uneven nodes`() {
        val f = polynomial(3)
        val nodes = doubleArrayOf(370.0, 384.0, 401.0, 440.0, 450.0, 520.0, 580.0, 590.0, 655.0, 700.0, 731.0)
        val found = Interpolation.smooth(nodes, DoubleArray(nodes.size) { f(nodes[it]) })
        assertArrayEquals(DoubleArray(Grid.SIZE) { f(grid[it]) }, found, 1e-11)
    }

    @Test
    fun `no narrow line is lost between the grid's steps`() {
        val nodes = DoubleArray(3501) { 375.0 + 0.1 * it }
        val line = DoubleArray(nodes.size) { if (abs(nodes[it] - 546.1) < 0.05) 1.0 else 0.0 }
        val found = Interpolation.stepMeans(nodes, line)
        assertEquals(0.1, found.sum() * Grid.STEP, 1e-9) // the triangle's area
    }

    @Test
    fun `sums follow NumPy's order`() {
        // 1 + 2^-53 is lost one by one and kept where the small ones meet first.
        val values = DoubleArray(681) { if (it == 0) 1.0 else 2.0.pow(-53) }
        assertEquals(1.0 + 680 * 2.0.pow(-53), sum(values), 2.0.pow(-50))
        assertEquals(1.0, values.fold(0.0) { total, value -> total + value })
    }
}
