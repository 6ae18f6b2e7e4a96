package org.camssf.fit

import org.camssf.InvalidArgument
import org.camssf.Rules
import org.camssf.photo.ChartPose
import org.camssf.photo.FrameMeans
import org.camssf.photo.LensShading
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.MeasuredShot
import org.camssf.photo.PatchMeans
import org.camssf.photo.Photo
import org.camssf.recovery.Gains
import org.camssf.recovery.Tensor
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Test

/** How the light on the patches may be off, for two shots of a chart of six columns and four rows. */
class GainModesTest {
    private val classic = ChartTable.read("classic24")
    private val n = 24

    /** The same patches with another one for the white. */
    private fun table(white: Int) = ChartTable(
        classic.name, classic.table, classic.layout, classic.patches, classic.wavelengths, classic.reflectance,
        classic.sharedTolerance, white, classic.source,
    )

    /** Patches 30 px apart across and 20 down, the second shot's half of that; corners unlike about each middle. */
    private fun capture(white: Int = 18, framed: Boolean = false): MeasuredCapture {
        val none = DoubleArray(3 * n)
        val frame = FrameMeans(none, none, LongArray(3 * n), none, none, none, DoubleArray(2 * n))
        val photo = Photo("a", 600, 400, 1, null, null, false, "a", "b", "")
        val shots = listOf(1.0, 0.5).map { scale ->
            val corner = doubleArrayOf(-3.0, -2.0, 4.0, -1.0, 3.0, 2.0, -4.0, 1.0)
            val quads = DoubleArray(8 * n) {
                val at = it / 8
                (if (it % 2 == 0) 100 + 30.0 * (at % 6) else 50 + 20.0 * (at / 6)) * scale + corner[it % 8]
            }
            val pose = ChartPose("classic24", DoubleArray(8), quads, 0, "by hand", 1.0, emptyList())
            val means = PatchMeans(frame, frame.takeIf { framed }, null, DoubleArray(3), 1000.0)
            MeasuredShot(Lamp.read("E"), photo, null, null, pose, means, LensShading.AS_STORED)
        }
        return MeasuredCapture(shots, table(white), null)
    }

    /** The longer side runs from -1 to 1, so the other one from -0.4 to 0.4. */
    private val x = DoubleArray(n) { -1 + 2.0 * (it % 6) / 5 }
    private val y = DoubleArray(n) { (-1 + 2.0 * (it / 6) / 3) * 60 / 150 }

    private fun number(word: String) = Rules.shipped.number("gains.$word")

    private fun bent(white: Int): List<DoubleArray> {
        val (plane, bowl) = number("plane") to number("bowl")
        return listOf<(Int) -> Double>(
            { plane * x[it] },
            { plane * y[it] },
            { bowl * x[it] * x[it] },
            { bowl * x[it] * y[it] },
            { bowl * y[it] * y[it] },
        ).map { way -> DoubleArray(n) { way(it) - way(white) } }
    }

    private fun assertModes(wanted: List<DoubleArray>, own: Double, found: Gains) {
        assertEquals(own, found.own)
        assertArrayEquals(intArrayOf(2, wanted.size, n), found.modes.shape)
        val all = wanted + wanted
        for ((at, mode) in all.withIndex()) {
            assertArrayEquals(mode, found.modes.values.copyOfRange(at * n, (at + 1) * n), 1e-12)
        }
    }

    @Test
    fun `without a white frame light may lean, bend, and stand otherwise on an edge's white`() {
        for (white in listOf(0, 3, 5, 6, 11, 18, 21, 23)) {
            val level = DoubleArray(n) { if (it == white) 0.0 else number("corner") }
            assertModes(bent(white) + level, number("own"), GainModes.of(capture(white), null))
        }
        for (white in listOf(7, 10, 13, 16)) {
            assertModes(bent(white), number("own"), GainModes.of(capture(white), null))
        }
    }

    @Test
    fun `with a white frame light is known`() {
        assertModes(emptyList(), 0.0, GainModes.of(capture(framed = true), null))
        assertModes(emptyList(), 0.0, GainModes.none(capture()))
    }

    @Test
    fun `patches that were photographed one by one differ by themselves`() {
        fun alone(at: Int) = DoubleArray(n) { if (it == at) 0.08 else 0.0 }
        val framed = GainModes.of(capture(framed = true), 0.08)
        assertModes((0 until n).map { alone(it) }, 0.0, framed)
        val others = (0 until n).filter { it != 18 }.map { alone(it) }
        val white = DoubleArray(n) { if (it == 18) 0.0 else 0.08 }
        assertModes(others + white, 0.0, GainModes.of(capture(), 0.08))
    }

    @Test
    fun `light differs by something, and by all of it at most`() {
        assertEquals(1.0, GainModes.of(capture(framed = true), 1.0).modes.values.max())
        for (wrong in listOf(0.0, -0.1, 1.01, Double.NaN)) {
            val error = assertThrows(InvalidArgument::class.java) { GainModes.of(capture(), wrong) }
            assertEquals("light cannot differ by $wrong from patch to patch.", error.message)
        }
    }

    /** Two shots, three modes, four patches. */
    @Test
    fun `the level is one less all modes, and never nothing`() {
        val modes = DoubleArray(24) { 0.01 * (it + 1) }
        val gains = Gains(Tensor(modes, 2, 3, 4), 0.0)
        val code = doubleArrayOf(0.5, -1.0, 0.25, 1.0, 0.5, -0.5)
        val found = GainModes.level(gains, code)
        for (at in 0 until 8) {
            val (j, i) = at / 4 to at % 4
            val wanted = 1 - (0..2).sumOf { code[3 * j + it] * modes[12 * j + 4 * it + i] }
            assertEquals(wanted, found[at], 1e-15)
        }
        assertEquals(0.02, GainModes.level(gains, DoubleArray(6) { 100.0 })[0])
        assertArrayEquals(DoubleArray(8) { 1.0 }, GainModes.level(gains, DoubleArray(0)))
    }
}
