package org.camssf.photo

import org.camssf.FramesDiffer
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.sqrt

/** Mean, error, slope and dust of one position of the cell in one patch. */
class PatchSampleTest {
    private fun of(places: Places, vararg frames: (Int) -> Int): List<PatchSample> {
        val samples = frames.map { value -> ShortArray(places.size) { value(it).toShort() } }
        return PatchSample.of("a.dng", frames.map { 1000.0 }, places, samples, 1)
    }

    private val square = Places(10, IntArray(10) { 20 }, IntArray(10) { 10 })

    /** A row of twenty: it has no slope to speak of, and a plane through it is not known. */
    @Test
    fun `samples in one row have a mean, a variance and no slope`() {
        val found = of(Places(10, intArrayOf(20), intArrayOf(20)), { 100 + it }).single()
        assertEquals(109.5, found.mean)
        assertEquals(0.0, found.change)
        val squares = (0 until 20).sumOf { (it - 9.5) * (it - 9.5) }
        assertEquals(sqrt((squares / 17 + 1.0 / 12) / 20), found.error, 1e-12)
    }

    @Test
    fun `a slope is taken out of the error, and told from edge to edge`() {
        val found = of(square, { 500 + 3 * (it % 10) - 2 * (it / 10) }).single()
        assertEquals(500 + 13.5 - 9.0, found.mean, 1e-12)
        assertEquals(27.0 + 18.0, found.change, 1e-9)
        assertEquals(sqrt(1.0 / 12 / 100), found.error, 1e-9)
        // Rows that begin elsewhere.
        val leaning = Places(10, IntArray(10) { 20 + 2 * it }, IntArray(10) { 10 })
        val other = of(leaning, { 500 + 3 * (it % 10 + it / 10) }).single()
        assertEquals(3.0 * 18, other.change, 1e-9)
    }

    /**
     * Half of twenty at 0, all others but one at 5: the median is 2.5 and they lie 2.5 away, so that 6 × 2.5 + 2 beyond the
     * median is the last that is no dust.
     */
    @Test
    fun `dust lies beyond six deviations from between the two values in the middle`() {
        val places = Places(10, IntArray(2) { 20 }, IntArray(2) { 10 })
        fun rejected(odd: Int): PatchSample {
            val values = IntArray(20) { 5 * (it % 2) }.also { it[3] = odd }
            return of(places, { values[it] }).single()
        }
        assertEquals(0 to 20, rejected(19).let { it.rejected to it.count })
        assertEquals(1 to 19, rejected(20).let { it.rejected to it.count })
        assertEquals(20, rejected(20).all)
    }

    @Test
    fun `what is dust in one frame is left out of all`() {
        val (one, two) = of(square, { if (it == 7) 900 else 100 }, { if (it == 9) 1000 else 200 })
        assertEquals(listOf(98, 98, 1, 1), listOf(one.count, two.count, one.rejected, two.rejected))
        assertEquals(100.0 to 200.0, one.mean to two.mean)
        assertEquals(0 to 1, one.clipped to two.clipped)
    }

    @Test
    fun `white and dark frame are held to the chart photo, each by its name`() {
        fun mosaic(iso: Double) = Mosaic(
            Mosaic.Origin("iso$iso", iso = iso), 40, 40, Region(0, 0, 40, 40), ShortArray(1600) { 100 },
            Mosaic.Sensor("RGGB", DoubleArray(4), 1000.0),
        )
        val quad = doubleArrayOf(2.0, 2.0, 36.0, 2.0, 36.0, 36.0, 2.0, 36.0)
        val pose = ChartPose("classic24", DoubleArray(8), quad, 0, "by hand", 1.0, emptyList())
        val (one, other) = mosaic(100.0) to mosaic(200.0)
        for ((word, white, dark) in listOf(Triple("white", other, one), Triple("dark", one, other))) {
            val error =
                assertThrows(FramesDiffer::class.java) {
                    PatchMeans.measure(one, pose, white, dark, LensShading.AS_STORED)
                }
            assertTrue(error.message.startsWith("The $word frame iso200.0 differs"), error.message)
        }
        val found = PatchMeans.measure(one, pose, null, one, LensShading.AS_STORED)
        assertEquals(null to 100.0, found.white to found.dark!!.sharedMean[0])
    }
}
