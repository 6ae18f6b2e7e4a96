package org.camssf.colour

import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.Nodes
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.abs
import kotlin.math.exp

class TransformTest {
    private val functions = Tables.observer(Observer.CIE_1931)
    private val light = Lamp.read("A").values

    private fun bell(centre: Double, width: Double): DoubleArray {
        val grid = Grid.WAVELENGTHS
        return DoubleArray(Grid.SIZE) { exp(-0.5 * ((grid[it] - centre) / width).let { u -> u * u }) }
    }

    private val curves = arrayOf(bell(605.0, 30.0), bell(535.0, 36.0), bell(460.0, 28.0))

    @Test
    fun `white keeps its colour, and more light changes no hue`() {
        for (kind in Kind.values()) {
            val found = Transform.choose(light, curves, functions, kind)
            val white = DoubleArray(3)
            kind.apply(found.coefficients, doubleArrayOf(1.0, 1.0, 1.0), 0, white, 0)
            assertArrayEquals(found.white, white, 1e-14)
            val (dim, bright) = DoubleArray(3) to DoubleArray(3)
            kind.apply(found.coefficients, doubleArrayOf(0.1, 0.2, 0.15), 0, dim, 0)
            kind.apply(found.coefficients, doubleArrayOf(0.4, 0.8, 0.6), 0, bright, 0)
            assertArrayEquals(dim, DoubleArray(3) { bright[it] / 4 }, 1e-15)
        }
    }

    @Test
    fun `an observer of its own needs a matrix only, and errs nowhere`() {
        val found = Transform.choose(light, functions, functions, null)
        assertTrue(found.residual.all { abs(it) < 1e-12 })
        val camera = Transform.choose(light, curves, functions, null)
        assertEquals(Kind.ROOT_POLYNOMIAL, camera.kind)
        assertTrue(camera.residual.any { abs(it) > 1e-3 })
    }

    @Test
    fun `the fit is the best that keeps white`() {
        val told = Learned.of(light, curves, functions)
        for (kind in Kind.values()) {
            val best = Transform.fit(told, kind)!!
            val least = misses(told, kind, best)
            for (at in 0 until best.size - 3) {
                for (step in listOf(1e-4, -1e-4)) {
                    val moved = best.copyOf()
                    moved[at] += step
                    moved[at + 3] -= step // the sum stays
                    assertTrue(misses(told, kind, moved) > least, "$kind $at")
                }
            }
        }
    }

    private fun misses(told: Learned, kind: Kind, coefficients: DoubleArray): Double {
        val found = DoubleArray(told.xyz.size)
        for (i in 0 until found.size / 3) kind.apply(coefficients, told.signals, 3 * i, found, 3 * i)
        return found.indices.sumOf { (found[it] - told.xyz[it]) * (found[it] - told.xyz[it]) }
    }

    @Test
    fun `a blind curve and two that are alike are refused`() {
        val blind = arrayOf(curves[0], DoubleArray(Grid.SIZE), curves[2])
        val fault = assertThrows(InvalidArgument::class.java) { Transform.choose(light, blind, functions, null) }
        assertTrue("no response" in fault.message)
        val twins = arrayOf(curves[0], curves[0], curves[2])
        val other = assertThrows(InvalidArgument::class.java) { Transform.choose(light, twins, functions, null) }
        assertTrue("alike" in other.message)
    }

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
    fun `Lab of white and black, and white adapted is white`() {
        val (d65, d50) = listOf("D65", "D50").map { Learned.truth(Lamp.read(it).values, functions).second }
        assertArrayEquals(doubleArrayOf(100.0, 0.0, 0.0), Spaces.lab(d65, d65), 1e-12)
        assertArrayEquals(DoubleArray(3), Spaces.lab(DoubleArray(3), d65), 1e-12)
        assertArrayEquals(doubleArrayOf(0.9504, 1.0, 1.0888), d65, 1e-3) // CIE 15
        assertArrayEquals(d50, Spaces.times(Spaces.adaptation(d65, d50), d65), 1e-14)
    }

    @Test
    fun `real surfaces lie in reach, and no light does`() {
        val seen = Learned.lit(light, curves)
        val matrix =
            Array(3) { c -> Nodes.fold(seen[c]).let { row -> DoubleArray(row.size) { row[it] / seen[c].sum() } } }
        val spread = DoubleArray(9) { if (it % 4 == 0) 1e-6 else 0.0 }
        val signals = Learned.signals(light, curves)
        for (i in signals.indices step 3) {
            assertTrue(Reach.distance(signals.copyOfRange(i, i + 3), spread, matrix) < 1e-6)
        }
        // beyond white, along the grey axis: the nearest surface is white, one floor of rounding beside Σ
        val over = DoubleArray(3) { 1.01 }
        assertEquals(10.0 * Math.sqrt(3.0), Reach.distance(over, spread, matrix), 1e-4)
        // below black: black is the nearest
        assertEquals(5.0, Reach.distance(doubleArrayOf(-0.003, 0.0, -0.004), spread, matrix), 1e-4)
    }

    @Test
    fun `a learned basis is the model's, and no other name has one`() {
        for (name in listOf("phones", "cameras")) {
            val basis = LearnedBasis.of(name)!!
            assertEquals(24, basis.atoms)
            for (c in 0..2) {
                val top = basis.mean[c].indices.maxByOrNull { basis.mean[c][it] }!!
                assertTrue(380 + 0.5 * top in listOf(570.0..640.0, 510.0..570.0, 430.0..490.0)[c], "$name $c $top")
            }
        }
        assertNull(LearnedBasis.of("gaussian"))
        assertNull(LearnedBasis.of("../secret"))
    }
}
