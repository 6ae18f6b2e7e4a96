package org.camssf.dng

import org.camssf.DngReader
import org.camssf.DngSource
import org.camssf.Mosaic
import org.camssf.Region
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.DynamicTest
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.TestFactory

/** Every variant comes back, sample for sample. */
class VariantsTest {
    @TestFactory
    fun samplesComeBack(): List<DynamicTest> = Variants.all.map { variant ->
        DynamicTest.dynamicTest(variant.name) {
            val found = read(variant)
            assertEquals(variant.area.width, found.width)
            assertEquals(variant.area.height, found.height)
            assertEquals(Region(0, 0, found.width, found.height), found.region)
            assertEquals(variant.writer.cfa, found.cfa)
            same(variant, found)
        }
    }

    /** Parts that begin and end within cells, strips and tiles. */
    @TestFactory
    fun partsComeBack(): List<DynamicTest> = Variants.all.map { variant ->
        DynamicTest.dynamicTest(variant.name) {
            val parts = listOf(Region(0, 0, 1, 1), Region(17, 9, 30, 21), Region(40, 30, 99, 99), Region(-5, 3, 5, 4))
            for (part in parts) {
                val found = read(variant, part)
                assertTrue(found.region.left >= part.left && found.region.right <= part.right)
                assertEquals(variant.area.width, found.width)
                same(variant, found)
            }
        }
    }

    @Test
    fun namesDiffer() = assertEquals(Variants.all.size, Variants.all.map { it.name }.toSet().size)

    companion object {
        internal fun read(variant: Variant, region: Region? = null): Mosaic =
            DngReader.read(DngSource.of(variant.bytes, variant.name), region)

        private fun same(variant: Variant, found: Mosaic) {
            for (y in found.region.top until found.region.bottom) {
                for (x in found.region.left until found.region.right) {
                    assertEquals(variant.expected(x, y), found[x, y]) { "${variant.name} at $x, $y" }
                }
            }
        }
    }
}
