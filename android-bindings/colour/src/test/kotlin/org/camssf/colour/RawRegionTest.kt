package org.camssf.colour

import org.camssf.FramesDiffer
import org.camssf.InvalidArgument
import org.camssf.Overexposed
import org.camssf.photo.LensShading
import org.camssf.photo.Mosaic
import org.camssf.photo.Region
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test

class RawRegionTest {
    private val black = doubleArrayOf(60.0, 64.0, 66.0, 70.0)

    /** R, G, G, B by the cell, and a dark lower half. */
    private fun photo(
        red: Int = 1000,
        cfa: String = "RGGB",
        iso: Double = 100.0,
        region: Region = Region(0, 0, 80, 60),
    ): Mosaic {
        val levels = mapOf('R' to red, 'G' to 2000, 'B' to 500)
        val samples = ShortArray(region.width * region.height) {
            val x = it % region.width + region.left
            val y = it / region.width + region.top
            val level = levels.getValue(cfa[y % 2 * 2 + x % 2])
            (if (y < 30) level else level / 2).toShort()
        }
        val origin = Mosaic.Origin("picture", "make", "model", 0.01, iso)
        return Mosaic(origin, 80, 60, region, samples, Mosaic.Sensor(cfa, black, 4000.0))
    }

    @Test
    fun `regions of every filter order have their signals above black`() {
        for (cfa in Mosaic.CFA_ORDERS) {
            val areas = listOf(Region(3, 2, 40, 28), Region(10, 32, 30, 58))
            val (top, bottom) = RawRegion.measure(photo(cfa = cfa), areas)
            fun level(colour: Char) = cfa.indices.filter { cfa[it] == colour }.map { black[it] }.average()
            val dark = "RGB".map { level(it) }.toDoubleArray()
            val known = doubleArrayOf(1000.0, 2000.0, 500.0)
            assertArrayEquals(DoubleArray(3) { known[it] - dark[it] }, top.raw.values, 1e-12)
            assertArrayEquals(DoubleArray(3) { known[it] / 2 - dark[it] }, bottom.raw.values, 1e-12)
            assertTrue(top.standardError.values.all { it > 0 && it < 0.05 }) // rounding to whole numbers alone
            assertEquals(Region(3, 2, 40, 28), top.area)
        }
    }

    @Test
    fun `a region ends at its borders`() {
        val found = RawRegion.measure(photo(), listOf(Region(0, 18, 80, 30))).single()
        assertEquals(1000.0 - 60.0, found.raw[0]) // one row lower the picture is darker
    }

    @Test
    fun `a dark frame stands for the black level`() {
        val night = photo(red = 80)
        val found = RawRegion.measure(photo(), listOf(Region(0, 0, 40, 28)), night).single()
        assertArrayEquals(doubleArrayOf(920.0, 0.0, 0.0), found.raw.values, 1e-12)
        assertThrows(FramesDiffer::class.java) {
            RawRegion.measure(photo(), listOf(Region(0, 0, 40, 28)), photo(iso = 200.0))
        }
    }

    @Test
    fun `no areas give no regions`() {
        assertEquals(0, RawRegion.measure(photo(), emptyList()).size)
    }

    @Test
    fun `areas that are none are refused`() {
        fun refused(area: Region, of: Mosaic = photo()): String =
            assertThrows(InvalidArgument::class.java) { RawRegion.measure(of, listOf(area)) }.message
        assertTrue("empty" in refused(Region(5, 5, 5, 20)))
        assertTrue("leaves the photo" in refused(Region(60, 5, 81, 20)))
        assertTrue("fewer than" in refused(Region(0, 0, 6, 6)))
        val part = photo(region = Region(0, 0, 40, 30))
        assertTrue("outside" in refused(Region(30, 5, 60, 25), part))
        assertThrows(InvalidArgument::class.java) {
            RawRegion.measure(photo(), listOf(Region(0, 0, 40, 28)), lensShading = LensShading.APPLY)
        }
        val clipped = assertThrows(Overexposed::class.java) {
            RawRegion.measure(photo(red = 4000), listOf(Region(0, 0, 40, 28)))
        }
        assertEquals(1.0, clipped.value)
    }

    @Test
    fun `pixels are means of whole cells above black`() {
        for (cfa in Mosaic.CFA_ORDERS) {
            for (cells in 1..3) {
                val pixels = RawPixels.of(Region(1, 1, 79, 29), cells)
                val found = pixels.read(photo(cfa = cfa))
                assertEquals((78 - 1) / 2 / cells, pixels.columns)
                assertEquals((28 - 1) / 2 / cells, pixels.rows)
                assertEquals(Region(2, 2, 2 + 2 * cells * pixels.columns, 2 + 2 * cells * pixels.rows), pixels.area)
                val region = RawRegion.measure(photo(cfa = cfa), listOf(Region(1, 1, 79, 29))).single()
                for (i in found.indices) assertEquals(region.raw[i % 3], found[i].toDouble(), 1e-3)
            }
        }
    }

    @Test
    fun `pixels of a part of the photo are those of the whole`() {
        val pixels = RawPixels.of(Region(20, 24, 40, 36))
        val whole = pixels.read(photo())
        val part = pixels.read(photo(region = Region(18, 20, 60, 40)), FloatArray(whole.size))
        assertArrayEquals(whole, part)
        assertTrue(whole.toSet().size == 6) // the border of the two halves lies in it
    }

    @Test
    fun `a pixel at the ceiling has no colour`() {
        assertTrue(RawPixels.of(Region(0, 0, 20, 20)).read(photo(red = 4000)).all { it.isNaN() })
    }

    @Test
    fun `pixels that are none are refused`() {
        for ((area, cells) in listOf(
            Region(0, 0, 1, 20) to 1,
            Region(0, 0, 20, 20) to 0,
            Region(0, 0, 20, 20) to 11,
            Region(-2, 0, 20, 20) to 1,
        )) {
            assertThrows(InvalidArgument::class.java, { RawPixels.of(area, cells) }, "$area $cells")
        }
        val pixels = RawPixels.of(Region(0, 0, 20, 20))
        assertThrows(InvalidArgument::class.java) { pixels.read(photo(), FloatArray(12)) }
        assertThrows(InvalidArgument::class.java) { pixels.read(photo(region = Region(2, 0, 60, 40))) }
        assertThrows(InvalidArgument::class.java) { RawPixels.of(Region(0, 0, 100, 20)).read(photo()) }
    }
}
