package org.camssf.photo.dng

import org.camssf.photo.Mosaic
import org.camssf.photo.Region
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNotEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.DynamicTest
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.TestFactory
import kotlin.math.abs

/** Every variant comes back, sample for sample. */
class VariantsTest {
    @TestFactory
    fun samplesComeBack(): List<DynamicTest> = Variants.all.map { variant ->
        DynamicTest.dynamicTest(variant.name) {
            val found = read(variant)
            assertEquals(variant.area.width, found.width)
            assertEquals(variant.area.height, found.height)
            assertEquals(Region(0, 0, found.width, found.height), found.region)
            assertEquals(variant.writer.cfa, found.sensor.cfa)
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

    /** A reader that is wrong in one of the usual ways would be caught: what it would give differs from the truth. */
    @Test
    fun usualMistakesDiffer() {
        for (variant in Variants.all) {
            val area = variant.area
            if (area.right < variant.writer.width && area.bottom < variant.writer.height) {
                assertTrue(differs(variant) { x, y -> variant.expected(x + 1, y) }, "${variant.name}: a column off")
                assertTrue(differs(variant) { x, y -> variant.expected(x, y + 1) }, "${variant.name}: a row off")
            }
        }
        val greens = Variants.all.filterNot { variant ->
            differs(variant) { x, y ->
                val green = colour(variant.writer.cfa, x, y) == 'G'
                if (green) variant.expected(x xor 1, y xor 1) else variant.expected(x, y)
            }
        }
        // Nearly all of its samples lie beyond the table's end, and so are equal.
        assertEquals(listOf("table-deflate"), greens.map { it.name }, "greens swapped")
        // The pattern counted from the stored picture's corner, where the active area begins at an odd place.
        val odd = Variants.all.filter { it.area.left % 2 + it.area.top % 2 > 0 }
        assertTrue(odd.map { it.writer.cfa }.toSet().size == 4)
        for (variant in odd) {
            val cfa = variant.writer.cfa
            val (left, top) = variant.area.left to variant.area.top
            val shifted = (0..3).map { colour(cfa, left + it % 2, top + it / 2) }.joinToString("")
            assertNotEquals(shifted, read(variant).sensor.cfa, variant.name)
        }
        val black = Variants.all.filter { it.name.startsWith("talkative") }.map { read(it).sensor.sharedBlack }
        assertEquals(2, black.size)
        for (levels in black) {
            assertTrue(levels.all { it > 1 } && levels.toSet().size == 4, levels.joinToString())
            assertTrue(levels.indices.any { abs(levels[it] - listOf(256.0, 256.25, 257.5, 259.0)[it]) > 1e-3 })
        }
    }

    @Test
    fun namesDiffer() = assertEquals(Variants.all.size, Variants.all.map { it.name }.toSet().size)

    companion object {
        internal fun read(variant: Variant, region: Region? = null): Mosaic =
            DngReader.read(DngSource.of(variant.bytes, variant.name), region)

        private fun colour(cfa: String, x: Int, y: Int) = cfa[y % 2 * 2 + x % 2]

        /** Whether a wrong reading gives other samples somewhere in the whole cells. */
        private fun differs(variant: Variant, wrong: (Int, Int) -> Int): Boolean {
            val found = read(variant)
            return (0 until found.height / 2 * 2).any { y ->
                (0 until found.width / 2 * 2).any { x -> wrong(x, y) != found[x, y] }
            }
        }

        private fun same(variant: Variant, found: Mosaic) {
            for (y in found.region.top until found.region.bottom) {
                for (x in found.region.left until found.region.right) {
                    assertEquals(variant.expected(x, y), found[x, y]) { "${variant.name} at $x, $y" }
                }
            }
        }
    }
}
