package org.camssf.curves

import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.evidence.dot
import org.camssf.model.Models
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNotEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.PI
import kotlin.math.cos
import kotlin.math.exp
import kotlin.math.ln

class RecoverTest {
    private val table = ChartTable.read("classic24")
    private val lamp = Lamp.read("D55").values
    private val grid = Grid.WAVELENGTHS

    /** Signals of a camera of three bells. */
    private val signals = DoubleArray(72) { at ->
        val centre = listOf(600.0, 540.0, 455.0)[at % 3]
        val seen = DoubleArray(Grid.SIZE) { lamp[it] * exp(-0.5 * ((grid[it] - centre) / 35).let { u -> u * u }) }
        dot(table.reflectance(at / 3), seen) / seen.sum()
    }

    private fun evidence(error: Double, tolerance: Double = 0.0) = Evidence(
        Tensor(signals, 1, 24, 3),
        Tensor.full(error, 1, 24, 3),
        Tensor(table.values, 24, Grid.SIZE),
        Tensor.full(tolerance, 24),
        Tensor.full(1.0, Grid.SIZE),
        0.01,
        Tensor(lamp, 1, Grid.SIZE),
        Tensor.full(0.0, 1),
        Tensor(DoubleArray(0), 1, 0, Grid.SIZE),
    )

    private val defaults = Penalties(null, null, null)

    @Test
    fun `a root by Brent`() {
        val found = Brent.root(0.0, 1.0, 3.0, cos(3.0), 1e-12) { cos(it) }
        assertEquals(PI / 2, found, 1e-11)
        val wide = Brent.root(0.0, -1.0, 10.0, 999.0, 0.01) { it * it * it - 1.0 }
        assertEquals(1.0, wide, 0.01)
    }

    /** The definition itself: rᵀ Σ⁻¹ r = Σ se² / Σ_ii at the γ that was chosen. */
    @Test
    fun `on the paper's basis the residual meets the noise`() {
        OnnxEngine.load("gaussian").use { engine ->
            val error = 0.004
            val ssf = Recover.recover(engine, evidence(error), null, defaults)
            for (c in 0..2) {
                val s = ssf.curve(c)
                val white = (0 until Grid.SIZE).sumOf { lamp[it] * s[it] }
                val size = (0 until 24).sumOf { i ->
                    val predicted = (0 until Grid.SIZE).sumOf { table.values[i * Grid.SIZE + it] * lamp[it] * s[it] }
                    // The code's own scale: one γ too large and the curve's white falls below 1.
                    val scale = scale(ssf, c)
                    val off = signals[3 * i + c] - predicted / white * scale
                    off * off / (error * error)
                }
                assertEquals(0.0, ln(size / 24), 0.05)
            }
        }
    }

    /** Σ ρ_w L s dλ / Σ ρ_w L dλ of the code as solved. */
    private fun scale(ssf: Ssf, c: Int): Double {
        val atoms = Discrepancy.atoms()
        val code = DoubleArray(Discrepancy.ATOMS) { ssf.code[3 * it + c] }
        val curve = DoubleArray(Grid.SIZE) { m -> code.indices.sumOf { code[it] * atoms[it][m] } }
        return dot(curve, lamp) / lamp.sum()
    }

    @Test
    fun `more noise, larger penalty`() {
        OnnxEngine.load("gaussian").use { engine ->
            val low = Recover.recover(engine, evidence(0.002), null, defaults).gamma
            val high = Recover.recover(engine, evidence(0.02), null, defaults).gamma
            // Σ⁻¹ grows with 1 / se²: compare γ in the unit of the problem.
            for (c in 0..2) assertTrue(high[c] * 100 > low[c])
        }
    }

    @Test
    fun `three gammas are three problems`() {
        OnnxEngine.load("cameras").use { engine ->
            val told = evidence(0.002, 0.03)
            fun gamma(vararg values: Double) = Recover.recover(engine, told, null, Penalties(null, values, null))
            val mixed = gamma(0.05, 1.0, 5.0)
            val single = listOf(gamma(0.05), gamma(1.0), gamma(5.0))
            for (c in 0..2) {
                for (m in 0 until Grid.SIZE) assertEquals(single[c].values[3 * m + c], mixed.values[3 * m + c])
            }
            assertNotEquals(single[0].values[900], single[2].values[900])
        }
    }

    @Test
    fun `the model answers twice alike, and not when closed`() {
        val engine = OnnxEngine.load("cameras")
        val first = Recover.recover(engine, evidence(0.002, 0.03), null, defaults)
        val again = Recover.recover(engine, evidence(0.002, 0.03), null, defaults)
        assertTrue(first.values.contentEquals(again.values))
        engine.close()
        engine.close()
        assertThrows(IllegalStateException::class.java) {
            Recover.recover(engine, evidence(0.002, 0.03), null, defaults)
        }
    }

    @Test
    fun `another model is refused`() {
        assertThrows(InvalidArgument::class.java) { OnnxEngine.load("sparse") }
        val content = Models.read("camssf-gaussian.onnx")
        assertThrows(InvalidArgument::class.java) { OnnxEngine.open("cameras", "camssf-cameras.onnx", content) }
        val half = content.copyOf(content.size / 2)
        assertThrows(InvalidArgument::class.java) { OnnxEngine.open("gaussian", "camssf-gaussian.onnx", half) }
    }
}
