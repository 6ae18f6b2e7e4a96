package org.camssf.photo

import org.camssf.CalibrationException
import org.camssf.FramesDiffer
import org.camssf.InvalidArgument
import org.camssf.Overexposed
import org.camssf.Underexposed
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.sqrt

/** Patch means → signals, on eight patches whose third is the white one, and at the limits of rules.json. */
class SignalsTest {
    private val n = 8
    private val white = 2
    private val names = List(n) { "patch ${it + 1}" }
    private val black = doubleArrayOf(64.0, 60.0, 56.0)

    private fun frame(
        error: (Int) -> Double = { 0.0 },
        clipped: (Int) -> Double = { 0.0 },
        mean: (Int) -> Double,
    ): FrameMeans {
        val none = DoubleArray(3 * n)
        return FrameMeans(
            DoubleArray(3 * n, mean),
            DoubleArray(3 * n, error),
            LongArray(3 * n) { 400 },
            DoubleArray(3 * n, clipped),
            none, none, DoubleArray(2 * n),
        )
    }

    private fun means(chart: FrameMeans, white: FrameMeans?, dark: FrameMeans?) =
        PatchMeans(chart, white, dark, black, 1064.0)

    private fun signals(means: PatchMeans) = Normalise.all(listOf(means), names, white)

    private fun <T : CalibrationException> refused(type: Class<T>, means: PatchMeans): T =
        assertThrows(type) { signals(means) }

    private val chart = frame({ 1.0 + 0.1 * it }) { 200.0 + 13.0 * it }
    private val flat = frame({ 0.5 + 0.01 * it }) { 800.0 + 7.0 * it }
    private val dark = frame({ 0.2 + 0.02 * it }) { 40.0 + it }

    @Test
    fun `every patch is divided by the white at its place, and errors add as variances`() {
        val found = signals(means(chart, flat, dark))
        for (i in 0 until 3 * n) {
            val range = flat.sharedMean[i] - dark.sharedMean[i]
            val y = (chart.sharedMean[i] - dark.sharedMean[i]) / range
            assertEquals(y, found.sharedValues[i], 1e-15)
            val (c, w, d) = listOf(chart, flat, dark).map { it.sharedError[i] }
            val variance = c * c + y * y * w * w + (y - 1) * (y - 1) * d * d
            assertEquals(sqrt(variance) / range, found.sharedError[i], 1e-15)
        }
        assertArrayEquals(chart.sharedMean, found.sharedChart)
        assertArrayEquals(flat.sharedMean, found.sharedWhite)
        assertArrayEquals(dark.sharedMean, found.sharedDark)
        assertArrayEquals(BooleanArray(n) { true }, found.sharedUsed)
        assertEquals(emptyList<String>(), found.assumptions.map { it.code })
    }

    @Test
    fun `the chart's white patch stands in for a white frame, with its error`() {
        val found = signals(means(chart, null, dark))
        for (i in 0 until 3 * n) {
            val at = 3 * white + i % 3
            val range = chart.sharedMean[at] - dark.sharedMean[at]
            val y = (chart.sharedMean[i] - dark.sharedMean[i]) / range
            assertEquals(y, found.sharedValues[i], 1e-15)
            assertEquals(range + dark.sharedMean[i], found.sharedWhite[i], 1e-12)
            val (c, w) = chart.sharedError[i] to chart.sharedError[at]
            val (d, e) = dark.sharedError[i] to dark.sharedError[at]
            val variance = c * c + d * d + y * y * (w * w + e * e)
            assertEquals(sqrt(variance) / range, found.sharedError[i], 1e-15)
        }
        assertArrayEquals(BooleanArray(n) { it != white }, found.sharedUsed)
        val said = found.assumptions.single()
        assertEquals("white_from_patch", said.code)
        assertEquals(
            "shot 1: no white frame: the chart's patch 'patch 3' replaces it on all patches.",
            said.message,
        )
    }

    @Test
    fun `the file's black level stands in for a dark frame, without error`() {
        val found = signals(means(chart, flat, null))
        for (i in 0 until 3 * n) assertEquals(black[i % 3], found.sharedDark[i])
        val (c, w) = chart.sharedError[5] to flat.sharedError[5]
        val (y, range) = found.sharedValues[5] to flat.sharedMean[5] - black[2]
        assertEquals(sqrt(c * c + y * y * w * w) / range, found.sharedError[5], 1e-15)
        val said = found.assumptions.single()
        assertEquals("dark_from_black_level", said.code)
        assertEquals("shot 1: no dark frame: the file's black level is used.", said.message)
    }

    /** Black 0 and a range of 1000 DN: shares are thousandths. */
    private fun shares(chart: FrameMeans, white: FrameMeans?): PatchMeans =
        PatchMeans(chart, white, frame { 0.0 }, DoubleArray(3), 1000.0)

    @Test
    fun `what lies just at a limit still holds`() {
        val atLimits = shares(
            frame({ if (it == 4) 2.0 else 0.1 }, { if (it == 13) 0.01 else 0.0 }) { if (it == 4) 6.0 else 3.0 },
            frame({ if (it == 6) 0.25 else 0.0 }, { if (it == 10) 0.01 else 0.0 }) { 5.0 },
        )
        assertArrayEquals(BooleanArray(n) { true }, signals(atLimits).sharedUsed)
        val beyond = shares(
            frame({ if (it == 4) 2.01 else 0.1 }, { if (it == 13) 0.0101 else 0.0 }) { if (it == 4) 6.0 else 3.0 },
            frame { 5.0 },
        )
        assertArrayEquals(BooleanArray(n) { it != 1 && it != 4 }, signals(beyond).sharedUsed)
        for (at in listOf(0, 7)) {
            val faint = shares(frame { 3.0 }, frame { if (it == at) 4.99 else 5.0 })
            val found = refused(Underexposed::class.java, faint)
            assertEquals(4.99 / 1000 to 0.005, found.value to found.threshold)
            assertEquals(
                "Shot 1: in one channel the white frame lies only 0.50% of the range above dark.",
                found.message,
            )
            val noisy = shares(frame { 3.0 }, frame({ if (it == at) 0.26 else 0.0 }) { 5.0 })
            val loud = refused(Underexposed::class.java, noisy)
            assertEquals(0.26 / 5 to 0.05, loud.value to loud.threshold)
            assertEquals("Shot 1: the white frame is too noisy: its standard error is 5% of its value.", loud.message)
        }
    }

    /** Brighter by more than 0.5 % of the range, in more than half of the patches and channels. */
    @Test
    fun `white and dark frame in each other's place are said`() {
        val swapped = refused(FramesDiffer::class.java, means(chart, dark, flat))
        assertEquals(
            "Shot 1: the dark frame is brighter than the white frame: they seem to be swapped.",
            swapped.message,
        )
        val size = 3 * n
        for (share in listOf(0.0, 0.5)) {
            val bright = frame { if (it < share * size) 900.0 else 60.0 }
            refused(Underexposed::class.java, means(chart, frame { 60.0 }, bright))
        }
        val mostlyBright = frame { if (it <= 0.5 * size) 900.0 else 60.0 }
        refused(FramesDiffer::class.java, means(chart, frame { 60.0 }, mostlyBright))
        refused(Underexposed::class.java, means(chart, frame { 60.0 }, frame { 60.0 }))
    }

    /** In each channel the range is the white level less that channel's black. */
    @Test
    fun `the range begins at the channel's black`() {
        for (at in listOf(0, 1, 2, 9)) {
            val level = 0.005 * (1064.0 - black[at % 3])
            fun white(part: Double) =
                means(frame { 500.0 }, frame { if (it == at) black[at % 3] + part * level else 700.0 }, null)
            signals(white(1.0001))
            assertEquals(0.9999 * 0.005, refused(Underexposed::class.java, white(0.9999)).value!!, 1e-9)
        }
    }

    @Test
    fun `a white at the ceiling is refused, in the words of what serves as white`() {
        val frame = shares(frame { 500.0 }, frame({ 0.0 }, { if (it == 10) 0.0125 else 0.0 }) { 900.0 })
        val found = refused(Overexposed::class.java, frame)
        assertEquals(
            "Shot 1: up to 1.2% of a patch's samples are at the ceiling in the white frame.",
            found.message,
        )
        assertEquals(0.0125 to 0.01, found.value to found.threshold)
        val patch = shares(frame({ 0.0 }, { if (it == 3 * white + 1) 0.5 else 0.0 }) { 500.0 }, null)
        assertTrue("in the white patch" in refused(Overexposed::class.java, patch).message)
        val other = shares(frame({ 0.0 }, { if (it == 3 * white + 3) 0.5 else 0.0 }) { 500.0 }, null)
        assertArrayEquals(BooleanArray(n) { it != white && it != white + 1 }, signals(other).sharedUsed)
    }

    @Test
    fun `fewer than six patches are refused for what took more of them`() {
        // The last patches are lost in noise, the first clipped.
        fun taken(clipped: Int, lost: Int) = shares(
            frame({ if (it >= 3 * (n - lost)) 2.0 else 0.1 }, { if (it < 3 * clipped) 1.0 else 0.0 }) { 5.0 },
            frame { 900.0 },
        )
        assertEquals(6, signals(taken(1, 1)).sharedUsed.count { it })
        val even = refused(Overexposed::class.java, taken(2, 2))
        assertEquals(
            "Shot 1: only 4 of 8 patches are usable (2 clipped, 2 lost in noise), 6 are needed.",
            even.message,
        )
        assertEquals(4.0 to 6.0, even.value to even.threshold)
        assertEquals(4.0 to 6.0, refused(Underexposed::class.java, taken(1, 3)).let { it.value to it.threshold })
    }

    @Test
    fun `the shot that is wrong is named`() {
        val sound = means(chart, flat, dark)
        val faint = means(chart, frame { 60.0 + it }, frame { 60.0 + it })
        val found = assertThrows(Underexposed::class.java) { Normalise.all(listOf(sound, faint), names, white) }
        assertTrue(found.message.startsWith("Shot 2: "), found.message)
        val other = assertThrows(InvalidArgument::class.java) {
            Normalise.all(listOf(sound, sound), names.drop(1), white)
        }
        assertEquals("Shot 1 has 8 patches, the table has 7.", other.message)
    }

    private val two = Normalise.all(listOf(means(chart, flat, dark), means(flat, chart, dark)), names, white)

    @Test
    fun `a shot alone is that shot`() {
        for (j in 0..1) {
            val one = two.only(j)
            val own = 3 * n * j until 3 * n * (j + 1)
            assertEquals(1 to n, one.shots to one.patches)
            assertEquals(two.sharedValues.slice(own), one.sharedValues.toList())
            assertEquals(two.sharedError.slice(own), one.sharedError.toList())
            assertEquals(two.sharedChart.slice(own), one.sharedChart.toList())
            assertEquals(two.sharedWhite.slice(own), one.sharedWhite.toList())
            assertEquals(two.sharedDark.slice(own), one.sharedDark.toList())
            assertEquals(two.sharedUsed.slice(n * j until n * (j + 1)), one.sharedUsed.toList())
        }
        val odd = two.restrictedTo(BooleanArray(n) { it == 1 })
        assertEquals(listOf(1, n + 1), odd.sharedUsed.indices.filter { odd.sharedUsed[it] })
        assertEquals(listOf(1), odd.only(1).sharedUsed.indices.filter { odd.only(1).sharedUsed[it] })
    }

    @Test
    fun `levels multiply the signals of a patch, and their errors`() {
        val level = DoubleArray(2 * n) { 0.5 + 0.1 * it }
        val found = two.levelled(level)
        for (i in found.sharedValues.indices) {
            assertEquals(two.sharedValues[i] * level[i / 3], found.sharedValues[i])
            assertEquals(two.sharedError[i] * level[i / 3], found.sharedError[i])
        }
        assertArrayEquals(two.sharedChart, found.sharedChart)
    }

    @Test
    fun `a patch that was not usable is not asked for`() {
        val lost = means(frame({ if (it / 3 == 5) 500.0 else 0.0 }) { 300.0 }, flat, dark)
        val found = signals(lost).restrictedTo(BooleanArray(n) { it >= 4 })
        assertEquals(listOf(4, 6, 7), found.sharedUsed.indices.filter { found.sharedUsed[it] })
    }

    @Test
    fun `they print, and assumptions compare`() {
        val some = two.restrictedTo(BooleanArray(n) { it == 1 })
        assertEquals("Signals(shots=2, patches=8, used=2)", "$some")
        val one = Assumption("code", "words")
        assertEquals("code: words", "$one")
        assertEquals(one, Assumption("code", "words"))
        assertEquals(31 * "code".hashCode() + "words".hashCode(), one.hashCode())
        val others = listOf(Assumption("other", "words"), Assumption("code", "other"), "code: words")
        assertTrue(others.none { one == it })
    }
}
