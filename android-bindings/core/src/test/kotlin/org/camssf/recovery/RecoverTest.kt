package org.camssf.recovery

import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.model.Models
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNotEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.PI
import kotlin.math.abs
import kotlin.math.cos
import kotlin.math.exp
import kotlin.math.ln
import kotlin.math.sqrt

class RecoverTest {
    private val table = ChartTable.read("classic24")
    private val lamp = Lamp.read("D55").sharedValues
    private val grid = Grid.wavelengths.values

    /** Signals of a camera of three bells. */
    private val signals = DoubleArray(72) { at ->
        val centre = listOf(600.0, 540.0, 455.0)[at % 3]
        val seen = DoubleArray(Grid.SIZE) { lamp[it] * exp(-0.5 * ((grid[it] - centre) / 35).let { u -> u * u }) }
        dot(table.reflectance(at / 3), seen) / seen.sum()
    }

    private fun observation(error: Double, tolerance: Double = 0.0) = Observation(
        Tensor(signals, 1, 24, 3),
        Tensor.full(error, 1, 24, 3),
        Known(
            Tensor(table.sharedValues, 24, Grid.SIZE),
            Tensor.full(tolerance, 24),
            Tensor.full(1.0, Grid.SIZE),
            0.01,
            Tensor(lamp, 1, Grid.SIZE),
            Tensor.full(0.0, 1),
            Tensor(DoubleArray(0), 1, 0, Grid.SIZE),
        ),
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
            val ssf = Recover.recover(engine, observation(error), null, defaults)
            for (c in 0..2) {
                val s = ssf.curve(c)
                val white = (0 until Grid.SIZE).sumOf { lamp[it] * s[it] }
                val size = (0 until 24).sumOf { i ->
                    val from = i * Grid.SIZE
                    val predicted = (0 until Grid.SIZE).sumOf { table.sharedValues[from + it] * lamp[it] * s[it] }
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
        val code = DoubleArray(Discrepancy.ATOMS) { ssf.sharedCode[3 * it + c] }
        val curve = DoubleArray(Grid.SIZE) { m -> code.indices.sumOf { code[it] * atoms[it][m] } }
        return dot(curve, lamp) / lamp.sum()
    }

    @Test
    fun `more noise, larger penalty`() {
        OnnxEngine.load("gaussian").use { engine ->
            val low = Recover.recover(engine, observation(0.002), null, defaults).sharedGamma
            val high = Recover.recover(engine, observation(0.02), null, defaults).sharedGamma
            // Σ⁻¹ grows with 1 / se²: compare γ in the unit of the problem.
            for (c in 0..2) assertTrue(high[c] * 100 > low[c])
        }
    }

    @Test
    fun `on the paper's basis three gammas are three problems`() {
        OnnxEngine.load("gaussian").use { engine ->
            fun gamma(vararg values: Double) =
                Recover.recover(engine, observation(0.002), null, Penalties(null, values, null))
            val mixed = gamma(20.0, 50.0, 200.0)
            val single = listOf(gamma(20.0), gamma(50.0), gamma(200.0))
            for (c in 0..2) {
                val (one, all) = single[c].sharedValues to mixed.sharedValues
                for (m in 0 until Grid.SIZE) assertEquals(one[3 * m + c], all[3 * m + c])
                assertEquals(single[c].sharedGap[c], mixed.sharedGap[c])
                assertEquals(single[c].sharedLayersGap[c], mixed.sharedLayersGap[c])
                assertEquals(single[c].sharedFinishSteps[c], mixed.sharedFinishSteps[c])
            }
            assertNotEquals(single[0].sharedValues[900], single[2].sharedValues[900])
        }
    }

    /** The words are those of Python's penalties. */
    @Test
    fun `on a learned basis the channels are one problem of one gamma`() {
        OnnxEngine.load("cameras").use { engine ->
            val observed = observation(0.002, 0.03)
            fun gamma(vararg values: Double) = Recover.recover(engine, observed, null, Penalties(null, values, null))
            val error = assertThrows(InvalidArgument::class.java) { gamma(0.05, 1.0, 5.0) }
            assertEquals(
                "`gamma` is [0.05, 1.0, 5.0], but on the cameras basis the three channels are one problem.",
                error.message,
            )
            assertEquals("Give one number.", error.advice)
            assertTrue(gamma(0.1, 0.1, 0.1).sharedValues.contentEquals(gamma(0.1).sharedValues))
        }
    }

    @Test
    fun `a learned basis tells its proof, its evidence and how the codes vary together`() {
        OnnxEngine.load("cameras").use { engine ->
            val observed = observation(0.002, 0.03)
            val ssf = Recover.recover(engine, observed, null, defaults)
            val size = ssf.sharedCode.size
            val spread = ssf.sharedCodeCovariance!!
            assertEquals(72 to 72 * 72, size to spread.size)
            for (i in 0 until size) {
                // The prior's variance is 1, and signals only take from it.
                assertTrue(spread[i * size + i] in 0.0..1.0)
                for (j in 0 until i) {
                    assertEquals(spread[i * size + j], spread[j * size + i], 1e-12)
                    assertTrue(abs(spread[i * size + j]) <= sqrt(spread[i * size + i] * spread[j * size + j]))
                }
            }
            // What is shared by the channels binds them to each other.
            assertTrue((0..23).maxOf { i -> (24..47).maxOf { j -> abs(spread[i * size + j]) } } > 1e-3)
            assertEquals(1, ssf.sharedLayersGap.size)
            assertTrue(ssf.sharedLayersGap[0] <= 1e-10 && ssf.sharedFinishSteps.contentEquals(intArrayOf(0)))
            assertTrue(ssf.sharedGap.all { it == ssf.sharedGap[0] })
            // A patch that is a fifth too dark speaks against all, although it gets a scale of its own.
            val dark = DoubleArray(72) { if (it / 3 == 7) 0.8 * signals[it] else signals[it] }
            val wrong = Observation(Tensor(dark, 1, 24, 3), observed.standardError, observed.known)
            val misled = Recover.recover(engine, wrong, null, defaults)
            assertTrue(misled.logEvidence!! < ssf.logEvidence!! - 3, "${misled.logEvidence}, ${ssf.logEvidence}")
        }
    }

    @Test
    fun `a wider prior leaves a wider band, and the paper's basis has none`() {
        val observed = observation(0.002, 0.03)
        OnnxEngine.load("phones").use { engine ->
            val (plain, wide) = listOf(1.0, 2.0).map { Recover.recover(engine, observed, null, defaults, it) }
            assertEquals(listOf(1.0, 2.0), listOf(plain.priorScale, wide.priorScale))
            assertTrue(wide.halfWidth > 1.05 * plain.halfWidth, "${wide.halfWidth}, ${plain.halfWidth}")
            assertNotEquals(plain.logEvidence, wide.logEvidence)
            for (scale in listOf(0.0, -1.0, Double.NaN, Double.POSITIVE_INFINITY)) {
                for (call in listOf<(Double) -> Any>(
                    { Recover.recover(engine, observed, null, defaults, it) },
                    { Recover.logEvidence(engine, observed, it) },
                )) {
                    assertThrows(InvalidArgument::class.java) { call(scale) }
                }
            }
        }
        OnnxEngine.load("gaussian").use { engine ->
            val error =
                assertThrows(InvalidArgument::class.java) { Recover.recover(engine, observed, null, defaults, 2.0) }
            assertEquals("a prior cannot be 2.0 times as wide on the gaussian basis.", error.message)
        }
    }

    /** Both values of it run in the one session that there is. */
    @Test
    fun `the sign is told to every call`() {
        OnnxEngine.load("gaussian").use { engine ->
            fun least(nonnegative: Boolean?): Double {
                val penalties = Penalties(1.0, doubleArrayOf(0.0), nonnegative)
                return Recover.recover(engine, observation(0.002), null, penalties).sharedCode.min()
            }
            val signed = least(false)
            assertTrue(signed < -1e-6, "$signed")
            assertEquals(0.0, least(true), 1e-12)
            assertEquals(least(true), least(null))
            assertEquals(signed, least(false))
        }
    }

    @Test
    fun `the paper's basis has three problems and no prior`() {
        OnnxEngine.load("gaussian").use { engine ->
            val ssf = Recover.recover(engine, observation(0.004), null, defaults)
            assertEquals(3 to 3, ssf.sharedLayersGap.size to ssf.sharedFinishSteps.size)
            assertEquals(listOf(null, null, null), listOf(ssf.sharedStd, ssf.sharedCodeCovariance, ssf.logEvidence))
        }
    }

    @Test
    fun `the model answers twice alike, and not when closed`() {
        val engine = OnnxEngine.load("cameras")
        val first = Recover.recover(engine, observation(0.002, 0.03), null, defaults)
        val again = Recover.recover(engine, observation(0.002, 0.03), null, defaults)
        assertTrue(first.sharedValues.contentEquals(again.sharedValues))
        engine.close()
        engine.close()
        assertThrows(IllegalStateException::class.java) {
            Recover.recover(engine, observation(0.002, 0.03), null, defaults)
        }
    }

    @Test
    fun `learned bases share a model until the last one is closed`() {
        val (phones, cameras) = listOf("phones", "cameras").map { OnnxEngine.load(it) }
        assertEquals(phones.sha256, cameras.sha256)
        for (engine in listOf(phones, cameras)) {
            assertEquals(BasisConstants.of(engine.basis)!!.roundedSha256, engine.metadata["basis_sha256"])
        }
        assertTrue(phones.metadata["basis_sha256"] != cameras.metadata["basis_sha256"])
        val first = Recover.recover(cameras, observation(0.002, 0.03), null, defaults)
        phones.close()
        phones.close()
        val again = Recover.recover(cameras, observation(0.002, 0.03), null, defaults)
        assertTrue(first.sharedValues.contentEquals(again.sharedValues))
        cameras.close()
        OnnxEngine.load("cameras").use { anew ->
            val found = Recover.recover(anew, observation(0.002, 0.03), null, defaults)
            assertTrue(first.sharedValues.contentEquals(found.sharedValues))
        }
    }

    @Test
    fun `another model is refused`() {
        assertThrows(InvalidArgument::class.java) { OnnxEngine.load("sparse") }
        val content = Models.read("camssf-gaussian.onnx")
        assertThrows(InvalidArgument::class.java) { OnnxEngine.open("cameras", "camssf-learned.onnx", content) }
        val half = content.copyOf(content.size / 2)
        assertThrows(InvalidArgument::class.java) { OnnxEngine.open("gaussian", "camssf-gaussian.onnx", half) }
    }
}
