package org.camssf.fit

import org.camssf.InvalidArgument
import org.camssf.photo.Signals
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.camssf.verdict.used
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Test
import kotlin.math.sqrt

/** Scores of two shots of a camera whose signals are a mixture of XYZ, so that its colours are the table's. */
class ScoresTest {
    private val table = ChartTable.read("classic24")
    private val n = 24
    private val lamps = listOf(Lamp.read("A"), Lamp.read("D65"))
    private val mixture = arrayOf(
        doubleArrayOf(0.8, 0.1, 0.05), doubleArrayOf(0.3, 0.9, 0.1), doubleArrayOf(-0.1, 0.2, 1.1),
    )
    private val xyz = lamps.map { Colour.xyz(table.sharedValues, it.sharedValues) }
    private val y = DoubleArray(6 * n) { at ->
        val own = xyz[at / (3 * n)]
        val i = at % (3 * n) / 3
        (0..2).sumOf { own[3 * i + it] * mixture[it][at % 3] }
    }
    private val all = BooleanArray(2 * n) { true }

    private fun scores(
        predicted: DoubleArray,
        counts: BooleanArray = all,
        used: BooleanArray = all,
        values: DoubleArray = y,
    ): Scores {
        val none = DoubleArray(6 * n)
        val signals = Signals(2, n, values, none, none, none, none, used, emptyList())
        return Scores.of(signals, predicted, table, lamps, counts, "told")
    }

    @Test
    fun `what is predicted rightly is off by nothing, and has the table's colours`() {
        val found = scores(y)
        assertArrayEquals(DoubleArray(3), found.sharedRmsre, 1e-12)
        assertEquals(0.0, found.deltaE00, 1e-6)
        assertEquals("told", found.unseen)
        for ((j, lamp) in lamps.withIndex()) {
            val wanted = Colour.srgb(Colour.adapted(xyz[j], Colour.white(lamp.sharedValues)))
            val own = 3 * n * j until 3 * n * (j + 1)
            assertArrayEquals(wanted, found.measuredSrgb.sliceArray(own), 1e-9)
            assertArrayEquals(wanted, found.syntheticSrgb.sliceArray(own), 1e-9)
        }
    }

    /** Two thirds of the signals a tenth too large, the others right; in blue it is half of that. */
    @Test
    fun `relative errors are squared and averaged, channel by channel`() {
        val predicted = DoubleArray(6 * n) {
            val factor = if (it % 3 == 2) 0.95 else 1.1
            y[it] * if (it / 3 % 3 == 0) 1.0 else factor
        }
        val part = sqrt(2.0 / 3)
        assertArrayEquals(doubleArrayOf(10 * part, 10 * part, 5 * part), scores(predicted).sharedRmsre, 1e-9)
        val counts = BooleanArray(2 * n) { it == 1 || it == n + 3 }
        assertEquals(10 / sqrt(2.0), scores(predicted, counts).sharedRmsre[0], 1e-9)
    }

    @Test
    fun `only what counts has a colour difference`() {
        val predicted = DoubleArray(6 * n) { if (it / 3 == n + 4) 1.2 * y[it] else y[it] }
        fun counting(vararg at: Int) = scores(predicted, BooleanArray(2 * n) { it in at }).deltaE00
        assertEquals(0.0, counting(4, n + 5), 1e-6)
        val alone = counting(n + 4)
        assertEquals(alone / 3, counting(n + 4, 4, n + 5), 1e-6)
        val lamp = lamps[1]
        val white = Colour.white(lamp.sharedValues)
        fun lab(factor: Double): DoubleArray {
            val own = DoubleArray(3) { factor * xyz[1][12 + it] }
            return Colour.lab(Colour.adapted(own, white))
        }
        assertEquals(Colour.difference(lab(1.0), lab(1.2)), alone, 1e-6)
    }

    /** Nothing measures below a millionth of white. */
    @Test
    fun `what is too faint to be measured has no relative error`() {
        fun with(faint: Double): Pair<DoubleArray, DoubleArray> {
            val values = DoubleArray(6 * n) { if (it == 3) faint else y[it] }
            return values to DoubleArray(6 * n) { if (it == 3) 2 * faint else y[it] }
        }
        val (dark, wrong) = with(1e-6)
        assertEquals(0.0, scores(wrong, values = dark).sharedRmsre[0], 1e-12)
        val (light, off) = with(2e-6)
        assertEquals(100 / sqrt(48.0), scores(off, values = light).sharedRmsre[0], 1e-9)
        val error = assertThrows(InvalidArgument::class.java) { scores(y, BooleanArray(2 * n)) }
        assertEquals("No patch is left for validation.", error.message)
    }

    /** The fit to XYZ is by the patches in use; by all where fewer than three are. */
    @Test
    fun `patches that are not used do not bend the colours`() {
        val spoiled = DoubleArray(6 * n) { if (it / 3 == n + 7) 3 * y[it] else y[it] }
        val without = scores(y, used = BooleanArray(2 * n) { it != n + 7 }, values = spoiled)
        val wanted = Colour.srgb(Colour.adapted(xyz[1], Colour.white(lamps[1].sharedValues)))
        assertArrayEquals(wanted, without.syntheticSrgb.copyOfRange(3 * n, 6 * n), 1e-9)
        val three = scores(y, used = BooleanArray(2 * n) { it % n in setOf(2, 13, 14) }, values = spoiled)
        assertArrayEquals(wanted, three.syntheticSrgb.copyOfRange(3 * n, 6 * n), 1e-6)
        val two = scores(y, used = BooleanArray(2 * n) { it % n in setOf(2, 13) }, values = spoiled)
        val none = scores(y, values = spoiled)
        assertArrayEquals(none.syntheticSrgb, two.syntheticSrgb, 1e-12)
    }

    @Test
    fun `signals that are multiples of each other are grey`() {
        val grey = DoubleArray(6 * n) { y[it - it % 3] }
        val found = scores(grey, values = grey)
        val sum = DoubleArray(3) { grey[3 * 5] }
        val wanted = Colour.srgb(Colour.adapted(sum, Colour.white(lamps[0].sharedValues)))
        assertArrayEquals(wanted, found.measuredSrgb.copyOfRange(15, 18), 1e-9)
    }
}
