package org.camssf.verdict

import org.camssf.Grid
import org.camssf.photo.ChartPose
import org.camssf.photo.FrameMeans
import org.camssf.photo.LensShading
import org.camssf.photo.MeasuredShot
import org.camssf.photo.PatchMeans
import org.camssf.photo.Photo
import org.camssf.photo.Signals
import org.camssf.recovery.OnnxEngine
import org.camssf.recovery.Ssf
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.AfterEach
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.exp
import kotlin.random.Random

/** Rules 1 to 3 on a camera of three bells. */
class GoodnessOfFitTest {
    private val engine = OnnxEngine.load("cameras")
    private val table = ChartTable.read("classic24")
    private val grid = Grid.wavelengths.values
    private val n = 24
    private val white = DoubleArray(Grid.SIZE) { 0.95 - 1e-4 * it }
    private val curves = DoubleArray(3 * Grid.SIZE) {
        val centre = listOf(600.0, 540.0, 455.0)[it % 3]
        exp(-0.5 * ((grid[it / 3] - centre) / 35).let { u -> u * u })
    }

    private fun integral(channel: Int, lamp: Lamp, of: (Int) -> Double): Double =
        (0 until Grid.SIZE).sumOf { curves[3 * it + channel] * lamp.sharedValues[it] * of(it) } * Grid.STEP

    private fun inputs(
        lamps: List<Lamp>,
        used: BooleanArray,
        prior: Boolean = true,
        noise: Double = 0.01,
    ): VerdictInputs {
        val k = lamps.size
        val random = Random(3)
        val predicted = DoubleArray(3 * k * n) { at ->
            val (c, i) = at % 3 to at / 3 % n
            val lamp = lamps[at / (3 * n)]
            integral(c, lamp) { table.sharedValues[i * Grid.SIZE + it] } / integral(c, lamp) { white[it] }
        }
        val signals = DoubleArray(predicted.size) { predicted[it] * (1 + noise * random.nextDouble(-1.0, 1.0)) }
        val error = DoubleArray(predicted.size) { 1e-3 + 1e-5 * it }
        val flat = DoubleArray(predicted.size) { 1000.0 }
        val light = lamps.flatMap { it.sharedValues.toList() }.toDoubleArray()
        val code = DoubleArray(72) { 0.1 }
        val ssf = Ssf(
            Ssf.Curves(curves, curves.takeIf { prior }, code, null, predicted, light),
            Ssf.Proof(DoubleArray(3), DoubleArray(1), IntArray(1), null),
            DoubleArray(3) { 1.0 },
            DoubleArray(3),
            1.0,
            "cameras",
        )
        val all = Signals(k, n, signals, error, flat, flat, DoubleArray(flat.size), used, emptyList())
        return VerdictInputs(engine, all, table, lamps, ssf, white, 0.01)
    }

    private val lamps = listOf(Lamp.read("daylight").withTolerance("2%"), Lamp.read("A").withTolerance("3%"))

    /** All but a few; patch 5 in no shot. */
    private val used = BooleanArray(48) { it % 24 != 5 && it != 3 && it != 24 + 11 }

    private val pose: ChartPose
        get() {
            val square = doubleArrayOf(-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0)
            val quads = DoubleArray(8 * n) {
                square[it % 8] + 10.0 * if (it % 2 == 0) it / 8 % 6 else it / 8 / 6
            }
            return ChartPose("classic24", square, quads, 0, "by hand", 1.0, emptyList())
        }

    /** What is asked of a shot beyond its signals: its pose, and which frames there were. */
    private fun shot(dark: Boolean = true): MeasuredShot {
        val flat = DoubleArray(3 * n) { 1000.0 }
        val frame = FrameMeans(flat, flat, LongArray(3 * n) { 400 }, flat, flat, flat, DoubleArray(2 * n))
        val photo = Photo("a", 60, 40, 1, null, null, false, "a", "b", "")
        val means = PatchMeans(frame, frame, frame.takeIf { dark }, DoubleArray(3), 4000.0)
        return MeasuredShot(lamps[0], photo, photo, photo.takeIf { dark }, pose, means, LensShading.AS_STORED)
    }

    @AfterEach
    fun close() = engine.close()

    /** A patch's suspicion is what χ² loses when its three signals are left out. */
    @Test
    fun `a patch explains what is lost without it`() {
        val lamp = lamps.take(1)
        val all = BooleanArray(24) { it != 5 }
        val whole = inputs(lamp, all).goodnessOfFit(shot())
        assertEquals(3 * 23, whole.count)
        val patches = whole.explanations.filter { it.cause == Cause.PATCH }
        assertEquals((0 until n).filter { all[it] }, patches.map { it.patch })
        for (explanation in patches) {
            val without = inputs(lamp, BooleanArray(24) { all[it] && it != explanation.patch }).goodnessOfFit()
            assertEquals(whole.residual - without.residual, explanation.gain, 1e-8 * whole.residual)
        }
    }

    @Test
    fun `a explanation that is put in is found with its size`() {
        val clean = inputs(lamps.take(1), BooleanArray(24) { true }, noise = 0.0)
        fun spoiled(dark: Boolean = true, value: (Int, Double) -> Double): GoodnessOfFit {
            val old = clean.signals
            val y = DoubleArray(72) { value(it, old.sharedValues[it]) }
            val signals = Signals(
                1, n, y, old.sharedError, old.sharedChart, old.sharedWhite, old.sharedDark, old.sharedUsed,
                emptyList(),
            )
            return VerdictInputs(engine, signals, table, clean.lamps, clean.ssf, white, 0.01)
                .goodnessOfFit(shot(dark))
        }
        val veiled = spoiled { _, y -> y + 0.05 * (1 - y) }.bestExplanation()!!
        assertEquals(Cause.VEIL, veiled.cause)
        // (1 - 0.05) (1 - y) is what is left of 1 - y.
        assertEquals(0.05 / 0.95, veiled.amount, 1e-6)
        // A white of a quarter of the range: 0.8 % of the range are 3.2 % of white. A dark frame leaves the veil alone.
        val raised = spoiled(dark = false) { _, y -> y - 0.032 * (1 - y) }
        assertEquals(Cause.BLACK, raised.bestExplanation()!!.cause)
        assertEquals(-0.008 / 1.032, raised.bestExplanation()!!.amount, 1e-6)
        assertEquals(Cause.VEIL, spoiled { _, y -> y - 0.032 * (1 - y) }.bestExplanation()!!.cause)
        assertTrue(spoiled { _, y -> y }.explanations.none { it.cause == Cause.BLACK })
        val toned = spoiled { _, y -> Math.pow(y, 0.8) }.bestExplanation()!!
        assertEquals(Cause.TONE, toned.cause)
        val dirty = spoiled { at, y -> if (at / 3 == 9) 1.5 * y else y }.bestExplanation()!!
        assertEquals(Cause.PATCH to 9, dirty.cause to dirty.patch)
        val coloured = spoiled { at, y -> y * listOf(1.1, 1.0, 0.93)[at % 3] }.bestExplanation()!!
        assertEquals(Cause.WHITE, coloured.cause)
        assertNull(spoiled { _, y -> y }.bestExplanation())
    }

    @Test
    fun `the code counts where there is a prior`() {
        assertEquals(0.72, inputs(lamps, used).goodnessOfFit().prior, 1e-12)
        assertEquals(0.0, inputs(lamps, used, prior = false).goodnessOfFit().prior)
        assertTrue(inputs(lamps, used).goodnessOfFit().explanations.isEmpty())
    }
}
