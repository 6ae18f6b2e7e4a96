package org.camssf.photo.dng

import org.camssf.photo.Mosaic
import org.camssf.photo.Region
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.nio.ByteOrder

/** What the file says beside its samples. */
class TagsTest {
    private val side = 24

    private fun read(
        raw: Tags = emptyMap(), first: Tags = emptyMap(), exif: Tags = emptyMap(), bits: Int = 12,
        order: ByteOrder = ByteOrder.LITTLE_ENDIAN, place: Place = Place.CHILD, cfa: String = "RGGB",
    ): Mosaic {
        val samples = Variants.noise(bits, side, side)
        val dng = DngWriter(
            side, side, samples, bits, order, place = place, cfa = cfa, raw = raw, first = first, exif = exif,
        )
        return DngReader.read(DngSource.of(dng.encode(), "photo.dng"))
    }

    private fun area(top: Int, left: Int, bottom: Int, right: Int): Tags =
        mapOf(50829 to Value.long(top, left, bottom, right))

    @Test
    fun aSilentFileHasDefaults() {
        val found = read(bits = 10)
        assertArrayEquals(DoubleArray(4), found.sensor.sharedBlack)
        assertEquals(1023.0, found.sensor.white)
        assertEquals(1, found.origin.orientation)
        assertEquals("Maker", found.origin.make)
        assertEquals("Model 1", found.origin.model)
        with(found.colours) { listOf(colorMatrix1, colorMatrix2, asShotNeutral) }
            .forEach { assertNull(it) }
        assertEquals(null to null, found.origin.exposure to found.origin.iso)
        assertNull(found.colours.asShotWhiteXY?.values)
        assertNull(found.sensor.noiseProfile?.values)
        val corrections = found.corrections
        assertEquals(emptyList<Any>(), corrections.gainMaps + corrections.badPixels)
        assertTrue(found.sensor.maskedAreas.isEmpty())
    }

    @Test
    fun theColoursBeginAtTheActiveAreasCorner() {
        for (cfa in Mosaic.CFA_ORDERS) {
            for (corner in listOf(0 to 0, 1 to 0, 0 to 1, 3 to 5)) {
                val found = read(area(corner.first, corner.second, 20, 20), cfa = cfa)
                assertEquals(cfa, found.sensor.cfa)
                assertEquals(cfa[0], found.color(0, 0))
                assertEquals(cfa[1], found.color(7, 2))
                assertEquals(cfa[2], found.color(4, 9))
            }
        }
    }

    /** The mean of black over the samples of each position, sample by sample. */
    private fun blackByBruteForce(
        width: Int, height: Int, pattern: Array<DoubleArray>, across: DoubleArray, down: DoubleArray,
    ): DoubleArray {
        val sums = DoubleArray(4)
        for (y in 0 until height) {
            for (x in 0 until width) {
                val black = pattern[y % pattern.size][x % pattern[0].size] + across[x] + down[y]
                sums[y % 2 * 2 + x % 2] += black
            }
        }
        return DoubleArray(4) { sums[it] / (width * height / 4) }
    }

    @Test
    fun blackOfEachPosition() {
        val tags: Tags = mapOf(50713 to Value.short(2, 2), 50714 to Value.rational(256, 1, 1025, 4, 2060, 8, 259, 1))
        assertArrayEquals(doubleArrayOf(256.0, 256.25, 257.5, 259.0), read(tags).sensor.sharedBlack)
        val black = read(tags + area(1, 3, 20, 20)).sensor.sharedBlack
        assertArrayEquals(doubleArrayOf(256.0, 256.25, 257.5, 259.0), black)
        assertArrayEquals(DoubleArray(4) { 64.0 }, read(mapOf(50714 to Value.short(64))).sensor.sharedBlack)
        val rows: Tags = mapOf(50713 to Value.short(2, 1), 50714 to Value.long(60, 70))
        val sensor = read(rows, order = ByteOrder.BIG_ENDIAN).sensor
        assertArrayEquals(doubleArrayOf(60.0, 60.0, 70.0, 70.0), sensor.sharedBlack)
    }

    @Test
    fun blackOfLargerPatternsAndDeltasIsTheMeanOfEachPosition() {
        val none = DoubleArray(24)
        for ((rows, columns) in listOf(3 to 3, 4 to 2, 2 to 4, 1 to 3, 6 to 4)) {
            val numbers = IntArray(rows * columns) { 500 + (37 * it * it) % 91 }
            val tags: Tags = mapOf(50713 to Value.short(rows, columns), 50714 to Value.short(*numbers))
            val pattern = Array(rows) { y -> DoubleArray(columns) { x -> numbers[y * columns + x].toDouble() } }
            assertArrayEquals(blackByBruteForce(24, 24, pattern, none, none), read(tags).sensor.sharedBlack, 1e-12)
        }
        val across = IntArray(18) { (5 * it) % 7 - 3 }
        val down = IntArray(20) { (3 * it) % 11 - 4 }
        val tags = area(2, 3, 22, 21) + mapOf(
            50714 to Value.short(100),
            50715 to Value.srational(*across.flatMap { listOf(it, 2) }.toIntArray()),
            50716 to Value.srational(*down.flatMap { listOf(it, 4) }.toIntArray()),
        )
        val hundred = arrayOf(doubleArrayOf(100.0))
        val expected = blackByBruteForce(
            18, 20, hundred, DoubleArray(18) { across[it] / 2.0 }, DoubleArray(20) { down[it] / 4.0 },
        )
        assertArrayEquals(expected, read(tags).sensor.sharedBlack, 1e-12)
    }

    @Test
    fun whiteLevel() {
        assertEquals(4000.0, read(mapOf(50717 to Value.short(4000))).sensor.white)
        assertEquals(4000.5, read(mapOf(50717 to Value.rational(8001, 2))).sensor.white)
        assertEquals(65535.0, read(bits = 16).sensor.white)
    }

    @Test
    fun metadataOfAPhone() {
        val matrix = intArrayOf(11, -2, 3, 4, 15, -6, 7, 8, 19)
        val first: Tags = mapOf(
            271 to Value.text(" Acme "),
            272 to Value.text("Fön 7"),
            274 to Value.short(6),
            50721 to Value.srational(*matrix.flatMap { listOf(it, 10) }.toIntArray()),
            50722 to Value.srational(*matrix.flatMap { listOf(-it, 8) }.toIntArray()),
            50728 to Value.rational(1, 2, 1, 1, 5, 8),
            50729 to Value.rational(3127, 10000, 3290, 10000),
            51041 to Value.double(2e-4, 1e-6),
            33434 to Value.rational(0, 1000),
        )
        val exif: Tags = mapOf(33434 to Value.rational(1, 125), 34855 to Value.short(400))
        for (order in listOf(ByteOrder.LITTLE_ENDIAN, ByteOrder.BIG_ENDIAN)) {
            val found = read(first = first, exif = exif, order = order)
            assertEquals("Acme", found.origin.make)
            assertEquals("Fön 7", found.origin.model)
            assertEquals(6, found.origin.orientation)
            assertArrayEquals(DoubleArray(9) { matrix[it] / 10.0 }, found.colours.colorMatrix1?.values)
            assertArrayEquals(DoubleArray(9) { -matrix[it] / 8.0 }, found.colours.colorMatrix2?.values)
            assertArrayEquals(doubleArrayOf(0.5, 1.0, 0.625), found.colours.asShotNeutral?.values)
            assertArrayEquals(doubleArrayOf(0.3127, 0.329), found.colours.asShotWhiteXY?.values)
            assertArrayEquals(doubleArrayOf(2e-4, 1e-6), found.sensor.noiseProfile?.values)
            assertEquals(1 / 125.0, found.origin.exposure)
            assertEquals(400.0, found.origin.iso)
        }
        assertEquals("Maker Model 1", read(first = mapOf(272 to null)).origin.model)
        assertEquals("Maker Model 1", read(bits = 10).origin.uniqueModel)
        assertEquals("", read(first = mapOf(50708 to null)).origin.uniqueModel)
        assertEquals(1, read(first = mapOf(274 to Value.short(9))).origin.orientation)
    }

    /** White = balance · calibration · matrix · XYZ of the light, green 1; by hand for D65 (21) and A (17). */
    @Test
    fun whitesOfTheColourMatrices() {
        val identity = intArrayOf(1, 4, 0, 1, 0, 1, 0, 1, 1, 1, 0, 1, 0, 1, 0, 1, 1, 1)
        val first: Tags = mapOf(
            50721 to Value.srational(*identity),
            50722 to Value.srational(*identity),
            50724 to Value.srational(2, 1, 0, 1, 0, 1, 0, 1, 1, 1, 0, 1, 0, 1, 0, 1, 3, 1),
            50727 to Value.rational(1, 1, 1, 2, 1, 1),
            50778 to Value.short(21),
            50779 to Value.short(17),
        )
        val (day, bulb) = read(first = first).colours.colourMatrices
        assertEquals(listOf("D65", "A"), listOf(day.light, bulb.light))
        assertArrayEquals(doubleArrayOf(0.5 * 0.950430, 1.0, 2 * 1.088806), day.sharedWhite, 1e-5)
        assertArrayEquals(doubleArrayOf(1.098490, 1.0, 6 * 0.355798), bulb.sharedWhite, 1e-5)
        val other = read(first = first + (50778 to Value.short(255)) + (50779 to Value.short(0)))
        assertTrue(other.colours.colourMatrices.isEmpty())
        assertEquals(
            "ColorMatrix1 was left out: it was made for light source 255, whose spectrum is not known; " +
                "ColorMatrix2 was left out: it was made for light source 0, whose spectrum is not known",
            other.colours.matricesLeftOut,
        )
        for ((code, light) in mapOf(1 to "D55", 3 to "A", 4 to "D55", 9 to "D55", 10 to "D65", 11 to "D75")) {
            assertEquals(light, read(first = first + (50778 to Value.short(code))).colours.colourMatrices[0].light)
        }
    }

    private fun matrix(vararg values: Int) = Value.srational(*values.flatMap { listOf(it, 10_000) }.toIntArray())

    /** The same files and words as in Python's test_mosaic.py. */
    @Test
    fun matricesThatNoCameraHas() {
        val placeholder = matrix(19549, -7877, -2582, -5724, 10121, 1917, -1267, -110, 6621)
        val display = matrix(32406, -15372, -4986, -9689, 18758, 415, 557, -2040, 10570)
        val another = matrix(7838, -2177, -840, -4786, 12913, 1437, -855, 2016, 4163)
        val own = matrix(9599, -1936, -1469, -6018, 14024, 1557, -3651, 5602, 6610)
        val neutral = Value.rational(6059, 10000, 1, 1, 8591, 10000)
        val equal = Value.rational(1, 1, 1, 1, 1, 1)
        fun leftOut(matrix: Value, light: Int, white: Value?) =
            read(first = mapOf(50721 to matrix, 50778 to Value.short(light), 50728 to white)).colours.matricesLeftOut
        for (white in listOf(neutral, equal, null)) {
            assertEquals(
                "ColorMatrix1 was left out: it gives a white under D65 whose red is 1.17 of its green, as no sensor's is",
                leftOut(placeholder, 21, white),
            )
            assertTrue("whose red is 1.00" in leftOut(display, 21, white))
            assertTrue("whose red is 2.8" in leftOut(placeholder, 17, white))
            assertEquals("", leftOut(own, 21, white))
        }
        assertEquals(
            "the colour matrices were left out: with them AsShotNeutral is the white of no lamp",
            leftOut(another, 21, neutral),
        )
        assertEquals("", leftOut(another, 21, equal))
    }

    /** LibRaw does not use the byte counts either, and some writers compute them wrongly. */
    @Test
    fun byteCountsAreNotTrusted() {
        for (compression in listOf(1, 7, 8)) {
            val expected = Variants.smooth(12, 24, 20)
            fun file(count: Int?) = DngWriter(
                24, 20, expected, 12, compression = compression, rowsPerStrip = 7,
                raw = if (count == null) emptyMap() else mapOf(279 to Value.long(count, count, count)),
            ).encode()
            for (count in listOf(null, 0, 1, 100, 252, 1_000_000)) {
                val found = DngReader.read(DngSource.of(file(count), "photo.dng"))
                assertArrayEquals(
                    expected,
                    IntArray(480) {
                        found.samples[it].toInt() and 0xffff
                    },
                    "$compression $count",
                )
            }
        }
    }

    @Test
    fun rowsPaddedToAStride() {
        for ((bits, pad) in listOf(16 to 6, 16 to 3, 12 to 4)) {
            val stored = Variants.smooth(bits, 24 + pad, 20)
            val expected = IntArray(480) { stored[it / 24 * (24 + pad) + it % 24] }
            val wide = DngWriter(24 + pad, 20, stored, bits, raw = mapOf(256 to Value.long(24))).encode()
            val found = DngReader.read(DngSource.of(wide, "photo.dng"))
            assertArrayEquals(expected, IntArray(480) { found.samples[it].toInt() and 0xffff }, "$bits $pad")
        }
    }

    @Test
    fun maskedAreas() {
        val tags = area(4, 8, 24, 24) + (50830 to Value.long(0, 0, 24, 8, 0, 8, 4, 24, 9, 9, 9, 99))
        assertEquals(listOf(Region(0, 0, 8, 24), Region(8, 0, 24, 4)), read(tags).sensor.maskedAreas)
    }

    @Test
    fun opcodes() {
        val head = arrayOf<Number>(0, 1, 22, 23, 0, 1, 2, 2, 2, 3, 1.0, 0.5, 0.0, 0.25, 1)
        val gains = arrayOf<Number>(1f, 1.5f, 2f, 1.25f, 1.75f, 2.5f)
        val map = OpcodeWriter.opcode(9, OpcodeWriter.content(*head, *gains), optional = true)
        val constant = OpcodeWriter.opcode(4, OpcodeWriter.content(77, 0))
        val places = OpcodeWriter.opcode(5, OpcodeWriter.content(0, 2, 1, 3, 4, 5, 6, 10, 11, 12, 13))
        val warp = OpcodeWriter.opcode(1, ByteArray(20), optional = true)
        val polynomial = OpcodeWriter.opcode(8, ByteArray(8), optional = true)
        val tags: Tags = mapOf(
            51008 to OpcodeWriter.list(places, polynomial),
            51009 to OpcodeWriter.list(map, constant),
            51022 to OpcodeWriter.list(warp, OpcodeWriter.opcode(99, ByteArray(3), optional = true)),
        )
        for (order in listOf(ByteOrder.LITTLE_ENDIAN, ByteOrder.BIG_ENDIAN)) {
            val found = read(tags, order = order)
            val shading = found.corrections.gainMaps.single()
            assertEquals(2, shading.list)
            assertEquals(Region(1, 0, 23, 22), shading.area)
            assertEquals(listOf(0, 1, 2, 2), shading.run { listOf(plane, planes, rowPitch, columnPitch) })
            assertEquals(listOf(2, 3, 1), listOf(shading.pointsV, shading.pointsH, shading.mapPlanes))
            assertEquals(listOf(1.0, 0.5), listOf(shading.spacingV, shading.spacingH))
            assertEquals(listOf(0.0, 0.25), listOf(shading.originV, shading.originH))
            assertArrayEquals(doubleArrayOf(1.0, 1.5, 2.0, 1.25, 1.75, 2.5), shading.gains.values)
            val (listed, valued) = found.corrections.badPixels
            assertArrayEquals(doubleArrayOf(3.0, 4.0, 5.0, 6.0), listed.points.values)
            assertEquals(listOf(Region(11, 10, 13, 12)), listed.areas)
            assertEquals(1, listed.list)
            assertEquals(77, valued.constant)
        }
    }

    @Test
    fun theHashIsOfTheFile() {
        val bytes = Variants.all.first().bytes
        val expected = java.security.MessageDigest.getInstance("SHA-256").digest(bytes)
        val found = DngReader.read(DngSource.of(bytes, "a"))
        assertEquals(expected.joinToString("") { "%02x".format(it) }, found.origin.sha256)
    }
}
