package org.camssf.verdict

import org.camssf.Reason
import org.camssf.photo.FrameMeans
import org.camssf.photo.PatchMeans
import org.camssf.photo.Signals
import org.camssf.spectra.ChartTable
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Test

/** What speaks against the second of two shots, at the limits of rules.json; the first is spoiled in every way. */
class ExposureAndNoiseTest {
    private val table = ChartTable.read("classic24")
    private val n = 16

    private class Spoiled(
        val white: (Int) -> Double = { 600.0 },
        val y: (Int) -> Double = { 0.02 + 0.03 * (it / 3) },
        val used: (Int) -> Boolean = { true },
        val clipped: (Int) -> Double = { 0.0 },
        val dead: (Int) -> Double = { 0.0 },
        val greens: (Int) -> Double = { 300.0 },
        val error: (Int) -> Double = { 1.0 },
        val patches: Int = 16,
        val framed: Boolean = true,
        val darkened: Boolean = true,
    )

    /** Dark at 100 DN, saturation at 1100; noise of 100 samples a patch: as even in white, chart and dark. */
    private fun reasons(of: Spoiled): List<Reason> {
        val m = of.patches
        fun joined(first: Double, second: (Int) -> Double) =
            DoubleArray(6 * m) { if (it < 3 * m) first else second(it - 3 * m) }
        val level = DoubleArray(6 * m) { 100.0 }
        val white = joined(110.0, of.white)
        val used = BooleanArray(2 * m) { if (it < m) it == 0 else of.used(it - m) }
        val y = joined(0.9, of.y)
        val signals = Signals(2, m, y, DoubleArray(6 * m), level, white, level, used, emptyList())
        fun frame(mean: (Int) -> Double, error: (Int) -> Double) = FrameMeans(
            DoubleArray(3 * m, mean), DoubleArray(3 * m, error), LongArray(3 * m) { 100 },
            DoubleArray(3 * m, of.clipped), DoubleArray(3 * m, of.dead), DoubleArray(3 * m),
            DoubleArray(2 * m, of.greens),
        )
        val means = PatchMeans(
            frame({ 100.0 + of.y(it) * 500 }, of.error),
            frame({ 600.0 }) { 1.0 }.takeIf { of.framed },
            frame({ 100.0 }) { 1.0 }.takeIf { of.darkened },
            doubleArrayOf(50.0, 100.0, 150.0),
            1100.0,
        )
        return ExposureAndNoise(signals, 1, means, table, Checks()).reasons()
    }

    private fun said(of: Spoiled) = reasons(of).map { Triple(it.code, it.value, it.fatal) }

    @Test
    fun `a sound shot has no reasons`() {
        assertEquals(emptyList<Any>(), said(Spoiled()))
    }

    @Test
    fun `the brightest channel of the white counts, over all patches`() {
        for (brightest in 0..2) {
            fun of(level: Double) = Spoiled(white = { if (it % 3 == brightest) 100 + level else 110.0 })
            assertEquals(emptyList<Any>(), said(of(100.01)))
            val found = reasons(of(96.0)).single()
            assertEquals("underexposed", found.code)
            assertEquals(0.096, found.value!!, 1e-12)
            val words = "shot 2: the white is too dark. Its brightest channel reaches 10% of the sensor's range."
            assertEquals(words, found.message)
        }
        // Half the patches at 4 %, half at 12 %: 8 % in all.
        val uneven = reasons(Spoiled(white = { if (it / 3 < 8) 140.0 else 220.0 })).single()
        assertEquals(0.08, uneven.value!!, 1e-12)
        // Two patches at just a tenth, whose mean is exact.
        assertEquals(emptyList<Any>(), said(Spoiled(white = { 200.0 }, patches = 2)).filter { it.second == 0.1 })
    }

    @Test
    fun `the darkest patch of the channel with most light over it counts`() {
        for (veiled in 0..2) {
            for (darkest in listOf(0, 7, 15)) {
                fun of(veil: Double) = Spoiled(
                    y = {
                        val own = if (it / 3 == darkest) veil else 0.5
                        if (it % 3 == veiled) own else 0.02
                    },
                )
                assertEquals(emptyList<Any>(), said(of(0.1)))
                assertEquals(listOf(Triple("glare", 0.11, false)), said(of(0.11)))
                assertEquals(listOf(Triple("glare", 0.25, false)), said(of(0.25)))
                assertEquals(listOf(Triple("glare", 0.26, true)), said(of(0.26)))
            }
        }
    }

    @Test
    fun `patches that are left are counted, and clipping is named where it took one`() {
        assertEquals(emptyList<Any>(), said(Spoiled(used = { it < 12 })))
        val dark = reasons(Spoiled(used = { it < 11 })).single()
        assertEquals("underexposed" to 11.0, dark.code to dark.value)
        assertEquals("shot 2: only 11 of 16 patches can be used.", dark.message)
        for (at in listOf(33, 35, 40, 47)) {
            val found = said(Spoiled(used = { it < 11 }, clipped = { if (it == at) 0.001 else 0.0 }))
            assertEquals(listOf(Triple("overexposed", 11.0, false)), found)
        }
        // A patch that is used is not what clipping took.
        val used = said(Spoiled(used = { it < 11 }, clipped = { if (it == 32) 0.001 else 0.0 }))
        assertEquals(listOf(Triple("underexposed", 11.0, false)), used)
    }

    @Test
    fun `the dirtiest patch is named`() {
        for (at in listOf(0, 1, 2, 24, 47)) {
            assertEquals(emptyList<Any>(), said(Spoiled(dead = { if (it == at) 0.06 else 0.01 })))
            val found = reasons(Spoiled(dead = { if (it == at) 0.07 else 0.01 })).single()
            assertEquals("chart_unfit" to 0.07, found.code to found.value)
            val patch = table.patches[at / 3]
            assertEquals("shot 2: 7% of the samples of patch $patch are outliers.", found.message)
        }
    }

    @Test
    fun `the greens of the used patches must agree`() {
        // The greens' black is 100 DN: 206 and 194 are 12 of 100 DN, 203 and 197 are 6.
        fun of(off: Double) = Spoiled(greens = { if (it / 2 < 14) 200 + off * (1 - it % 2 * 2) else 300.0 })
        assertEquals(emptyList<Any>(), said(of(3.0)))
        assertEquals(emptyList<Any>(), said(of(-3.0)))
        for (sign in listOf(-1, 1)) {
            val found = reasons(of(6.0 * sign)).single()
            assertEquals("not_sensor_raw", found.code)
            assertEquals(0.12, found.value!!, 1e-12)
        }
        // Below black a difference is told in DN.
        val below = reasons(Spoiled(greens = { if (it % 2 == 0) 90.5 else 90.0 })).single()
        assertEquals(0.5, below.value!!, 1e-12)
        // The median of the used ones alone.
        val odd = setOf(3, 12, 13, 14, 15)
        val few = Spoiled(used = { it < 12 }, greens = { 300.0 + if (it / 2 in odd) it % 2 * 90 else 0 })
        assertEquals(emptyList<Any>(), said(few))
    }

    /** Variance 100 in white and dark, so that a patch must have it, too. */
    @Test
    fun `noise is what light makes, no less and no more`() {
        fun said(error: Double) = reasons(Spoiled(error = { error })).map { it.code to it.value!! }
        assertEquals(emptyList<Any>(), said(0.8)) // 0.64 of the variance
        val smooth = said(0.7).single()
        assertEquals("not_sensor_raw", smooth.first)
        assertEquals(0.49, smooth.second, 1e-12)
        // Signals of 10 to 235 DN in steps of 15: the median of √(variance - 100) / signal.
        val rough = said(2.0).single()
        assertEquals("blurred", rough.first)
        val signals = List(16) { 10.0 + 15 * it }
        val spread = kotlin.math.sqrt(300.0)
        assertEquals((spread / signals[7] + spread / signals[8]) / 2, rough.second, 1e-9)
        val quiet = { _: Int -> 0.1 }
        assertEquals(emptyList<Any>(), reasons(Spoiled(error = quiet, framed = false)))
        assertEquals(emptyList<Any>(), reasons(Spoiled(error = quiet, darkened = false)))
    }
}
