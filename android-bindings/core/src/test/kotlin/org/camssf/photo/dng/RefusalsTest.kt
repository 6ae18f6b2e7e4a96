package org.camssf.photo.dng

import org.camssf.CalibrationException
import org.camssf.InvalidArgument
import org.camssf.NotSensorRaw
import org.camssf.RawError
import org.camssf.UnreadableRaw
import org.camssf.UnsupportedRaw
import org.camssf.photo.Region
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.DynamicTest
import org.junit.jupiter.api.DynamicTest.dynamicTest
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.TestFactory
import org.junit.jupiter.api.assertThrows
import org.junit.jupiter.api.io.TempDir
import java.io.ByteArrayInputStream
import java.io.File
import java.io.IOException
import java.nio.ByteBuffer
import java.nio.ByteOrder

/** What the reader must not read: which code, and that the message names the reason. */
class RefusalsTest {
    private fun read(bytes: ByteArray, region: Region? = null) =
        DngReader.read(DngSource.of(bytes, "photo.dng"), region)

    private inline fun <reified T : CalibrationException> refused(bytes: ByteArray, vararg words: String) {
        val error = assertThrows<T> { read(bytes) }
        assertTrue("photo.dng" in error.message, error.message)
        assertTrue(error.advice.endsWith("."), error.advice)
        for (word in words) assertTrue(word in error.message, "no '$word' in: ${error.message}")
    }

    private fun dng(
        raw: Tags = emptyMap(), first: Tags = emptyMap(), bits: Int = 12, compression: Int = 1, predictor: Int = 1,
        tile: Pair<Int, Int>? = null, jpeg: (Int) -> JpegWriter = { JpegWriter(bits, it) },
    ) = DngWriter(
        24, 20, Variants.smooth(bits, 24, 20), bits, compression = compression, predictor = predictor, tile = tile,
        raw = raw, first = first, jpeg = jpeg,
    ).encode()

    @TestFactory
    fun formsThatAreNotRead(): List<DynamicTest> = listOf(
        "JPEG XL" to mapOf(259 to Value.short(52546)),
        "JPEG XL" to mapOf(259 to Value.short(50002)),
        "lossy JPEG" to mapOf(259 to Value.short(34892)),
        "LZW" to mapOf(259 to Value.short(5)),
        "number 4711" to mapOf(259 to Value.short(4711)),
        "floating-point" to mapOf(339 to Value.short(3)),
        "3 samples" to mapOf(277 to Value.short(3), 258 to Value.short(12, 12, 12)),
        "7 bits" to mapOf(258 to Value.short(7)),
        "17 bits" to mapOf(258 to Value.short(17)),
        "lowest bit first" to mapOf(266 to Value.short(2)),
        "(6 × 6)" to mapOf(33421 to Value.short(6, 6), 33422 to Value.bytes(*IntArray(36) { it % 3 })),
        "R??G" to mapOf(33422 to Value.bytes(0, 3, 4, 1)),
        "unnamed" to mapOf(33422 to null),
        "RGGB" to mapOf(50711 to Value.short(2)),
        "no mosaic" to mapOf(262 to Value.short(2)),
        "no mosaic" to mapOf(254 to Value.long(1)),
    ).map { (word, tags) -> dynamicTest(word) { refused<UnsupportedRaw>(dng(tags), word) } }

    /** Readers disagree on what it means beyond packed samples, and no camera writes it: never a guess. */
    @Test
    fun fillOrderTwoInEveryForm() {
        val reversed = mapOf(266 to Value.short(2))
        refused<UnsupportedRaw>(dng(reversed, bits = 16), "FillOrder 2")
        refused<UnsupportedRaw>(dng(reversed, compression = 7), "FillOrder 2")
        refused<UnsupportedRaw>(dng(reversed, compression = 8), "FillOrder 2")
        read(dng(mapOf(266 to Value.short(1)), bits = 16))
    }

    @Test
    fun linearRawIsNotTheSensors() {
        refused<NotSensorRaw>(dng(mapOf(262 to Value.short(34892))), "linear")
        val merged = mapOf(262 to Value.short(34892), 277 to Value.short(3), 259 to Value.short(52546))
        refused<NotSensorRaw>(dng(merged), "linear")
    }

    @TestFactory
    fun otherRawFiles(): List<DynamicTest> = listOf(
        "II*\u0000\u0010\u0000\u0000\u0000CR\u0002\u0000",
        "\u0000\u0000\u0000\u0018ftypcrx ",
        "FUJIFILMCCD-RAW 0201",
        "IIU\u0000\u0008\u0000\u0000\u0000",
        "IIRO\u0008\u0000\u0000\u0000",
        "MMOR\u0008\u0000\u0000\u0000",
        "FOVb\u0000\u0000\u0000\u0000",
        "\u0000MRM\u0000\u0000\u0000\u0000",
    ).map {
        dynamicTest(it.take(8)) {
            refused<UnsupportedRaw>(it.toByteArray(Charsets.ISO_8859_1) + ByteArray(64), "no DNG")
        }
    }

    @Test
    fun tiffFilesThatAreNoDng() {
        refused<UnsupportedRaw>("II+\u0000".toByteArray() + ByteArray(64), "BigTIFF")
        refused<UnsupportedRaw>("MM\u0000+".toByteArray() + ByteArray(64), "BigTIFF")
        refused<UnsupportedRaw>(dng(first = mapOf(50706 to null)), "no DNG")
        refused<UnreadableRaw>(dng(mapOf(262 to Value.short(1)), mapOf(50706 to null)), "TIFF picture")
        refused<UnsupportedRaw>(dng(first = mapOf(50706 to Value.bytes(2, 0, 0, 0))), "version 2")
        refused<UnreadableRaw>(ByteArray(0), "empty")
        refused<UnreadableRaw>("\u0089PNG\r\n\u001a\n and more".toByteArray(), "not a DNG")
        refused<UnreadableRaw>("II".toByteArray(), "not a DNG")
    }

    @TestFactory
    fun numbersThatContradictTheFile(): List<DynamicTest> = listOf(
        "samples" to mapOf(256 to Value.long(0)),
        "pieces of data" to mapOf(256 to Value.long(60000), 257 to Value.long(60000)),
        "too short" to mapOf(257 to Value.long(40), 278 to Value.long(40)),
        "pieces" to mapOf(278 to Value.long(0)),
        "1 pieces of data instead of 2" to mapOf(278 to Value.long(10)),
        "0 pieces" to mapOf(273 to null),
        "ends at byte" to mapOf(273 to Value.long(100_000)).mapKeys { 273 },
        "too short" to mapOf(278 to Value.long(10), 273 to Value.long(8, 100), 279 to Value.long(360, 360)),
        "overlap" to mapOf(278 to Value.long(10), 273 to Value.long(8, 8), 279 to Value.long(700, 700)),
        "active area" to mapOf(50829 to Value.long(0, 0, 21, 24)),
        "active area" to mapOf(50829 to Value.long(5, 0, 6, 24)),
        "tag 50829" to mapOf(50829 to Value.long(0, 0, 20)),
        "white level" to mapOf(50717 to Value.long(0)),
        "white level" to mapOf(50717 to Value.rational(1, 0)),
        "tag 50717" to mapOf(50717 to Value.long(1, 2)),
        "black level" to mapOf(50714 to Value.rational(1, 0)),
        "black level" to mapOf(50714 to Value.rational(0, 0)),
        "black level" to mapOf(50713 to Value.short(0, 2)),
        "tag 50714" to mapOf(50713 to Value.short(2, 2), 50714 to Value.short(1)),
        "tag 50715" to mapOf(50715 to Value.srational(1, 1)),
        "linearization" to mapOf(50712 to Value.long(1, 65536)),
        "whole" to mapOf(256 to Value.rational(49, 2)),
        "opcode list" to mapOf(51009 to Value.blob(byteArrayOf(0, 0, 0, 1))),
        "shading" to mapOf(51009 to OpcodeWriter.list(OpcodeWriter.opcode(9, ByteArray(76)))),
        "opcode list" to
            mapOf(51009 to OpcodeWriter.list(OpcodeWriter.opcode(5, OpcodeWriter.content(0, 1 shl 30, 1)))),
    ).map { (word, tags) ->
        dynamicTest("$word, tag ${tags.keys.first()}") {
            val words = if (word == "ends at byte") "end at byte" else word
            refused<UnreadableRaw>(dng(tags), "damaged", words)
        }
    }

    @Test
    fun directoriesInCirclesOrTooDeep() {
        val small = ByteBuffer.allocate(40).order(ByteOrder.LITTLE_ENDIAN)
        small.put("II*\u0000".toByteArray()).putInt(8).putShort(0).putInt(8)
        refused<UnreadableRaw>(small.array(), "circle")
        refused<UnreadableRaw>(nested { _, at -> at }, "circle")
        refused<UnreadableRaw>(nested { level, at -> if (level < 5) at + 18 else 0 }, "circle")
        refused<UnreadableRaw>(nested { level, at -> if (level < 4) at + 18 else 0 }, "TIFF picture")
        val long = ByteBuffer.allocate(8 + 65 * 6).order(ByteOrder.LITTLE_ENDIAN)
        long.put("II*\u0000".toByteArray()).putInt(8)
        for (number in 1..65) long.putShort(0).putInt(if (number < 65) 8 + 6 * number else 0)
        refused<UnreadableRaw>(long.array(), "too many")
    }

    /** Directories of one SubIFD entry each, at 18 bytes' distance; `child` is told the level and its own place. */
    private fun nested(child: (Int, Int) -> Int): ByteArray {
        val buffer = ByteBuffer.allocate(8 + 7 * 18).order(ByteOrder.LITTLE_ENDIAN)
        buffer.put("II*\u0000".toByteArray()).putInt(8)
        for (level in 0 until 7) {
            val next = child(level, 8 + 18 * level)
            buffer.putShort(1).putShort(if (next == 0) 254 else 330).putShort(4).putInt(1).putInt(next).putInt(0)
        }
        return buffer.array()
    }

    /** A small file that would fill the memory: SECURITY.md states the limit. */
    @Test
    fun moreSamplesThanAPhotoHas() {
        val side = Value.long(15_000)
        fun bomb(at: Int) =
            dng(mapOf(256 to side, 257 to side, 278 to side, 273 to Value.long(at)), compression = 8)
        refused<UnsupportedRaw>(bomb(bomb(8).size) + ByteArray(500_000), "15000 × 15000", "220 million")
    }

    @Test
    fun opcodesThatMayNotBeSkipped() {
        fun list(tag: Int, number: Int, optional: Boolean = false) =
            dng(mapOf(tag to OpcodeWriter.list(OpcodeWriter.opcode(number, ByteArray(8), optional))))
        for ((list, tag) in listOf(51008, 51009, 51022).withIndex()) {
            refused<UnsupportedRaw>(list(tag, 8), "requires opcode 8 (MapPolynomial) of opcode list ${list + 1}")
            for (number in listOf(7, 10, 11, 12, 13)) refused<UnsupportedRaw>(list(tag, number), "opcode $number (")
            refused<UnsupportedRaw>(list(tag, 99), "opcode 99 (unknown)")
            for (number in listOf(1, 2, 3, 6, 14)) read(list(tag, number))
            read(list(tag, 8, optional = true))
        }
    }

    // Lossless JPEG -----------------------------------------------------------------------------------------------

    private val plainJpeg by lazy { dng(compression = 7, jpeg = { JpegWriter(12, it / 2, 1, 2) }) }
    private val restarted by lazy { dng(compression = 7, jpeg = { JpegWriter(12, it, 4, restart = 5) }) }

    private fun ByteArray.at(vararg bytes: Int): Int {
        for (start in 0..size - bytes.size) {
            if (bytes.indices.all { this[start + it] == bytes[it].toByte() }) return start
        }
        error("not there")
    }

    private fun ByteArray.with(at: Int, vararg bytes: Int): ByteArray =
        copyOf().also { copy -> bytes.forEachIndexed { i, byte -> copy[at + i] = byte.toByte() } }

    @Test
    fun jpegHeadersThatAreNotRead() {
        val frame = plainJpeg.at(0xff, 0xc3)
        for (process in listOf(0xc0, 0xc1, 0xc2, 0xc9)) {
            refused<UnsupportedRaw>(plainJpeg.with(frame + 1, process), "lossy JPEG")
        }
        refused<UnsupportedRaw>(plainJpeg.with(frame + 11, 0x21), "subsampled")
        val scan = plainJpeg.at(0xff, 0xda)
        refused<UnsupportedRaw>(plainJpeg.with(scan + 3, 8, 1, 1, 0, 1, 0, 0), "components lie apart")
        refused<UnreadableRaw>(plainJpeg.with(frame + 4, 17), "17 bits")
        refused<UnreadableRaw>(plainJpeg.with(frame + 8, 11), "a JPEG of 11 × 20 × 2 in a piece of 480 samples")
        refused<UnreadableRaw>(plainJpeg.with(frame + 1, 0xe3), "frame header")
        refused<UnreadableRaw>(plainJpeg.with(scan + 6, 0x20), "Huffman table")
        refused<UnreadableRaw>(plainJpeg.with(scan + 9, 8), "predictor 8")
        refused<UnreadableRaw>(plainJpeg.with(scan + 9, 0), "predictor 0")
        refused<UnreadableRaw>(plainJpeg.with(plainJpeg.at(0xff, 0xd8), 0, 0), "no JPEG")
        val table = plainJpeg.at(0xff, 0xc4)
        refused<UnreadableRaw>(plainJpeg.with(table + 5, 3), "Huffman table")
        refused<UnreadableRaw>(plainJpeg.with(table + 5, 3, 0, 0, 0, 14), "Huffman table")
        val interval = restarted.at(0xff, 0xdd)
        refused<UnreadableRaw>(restarted.with(interval + 5, 121), "within a line")
    }

    @Test
    fun jpegDataThatAreDamaged() {
        val scan = plainJpeg.at(0xff, 0xda)
        val end = plainJpeg.at(0xff, 0xd9)
        refused<UnreadableRaw>(plainJpeg.with(scan + 20, 0xff, 0, 0xff, 0, 0xff, 0), "in no table")
        refused<UnreadableRaw>(plainJpeg.with(end, 0xff, 0), "JPEG data")
        refused<UnreadableRaw>(plainJpeg.with(end + 1, 0xd0), "no proper end")
        refused<UnreadableRaw>(plainJpeg.with(end - 9, 0xff, 0xd9), "early")
        refused<UnreadableRaw>(plainJpeg.with(scan + 30, *IntArray(40)), "JPEG data")
        val wide = DngWriter(24, 20, Variants.smooth(14, 24, 20), 12, compression = 7).encode()
        refused<UnreadableRaw>(wide, "leave 12 bits")
        val filled = dng(compression = 7, jpeg = { JpegWriter(12, it, filling = 3) })
        read(filled)
        refused<UnreadableRaw>(filled.with(filled.at(0xff, 0xd9) - 2, 1), "too long")
        val marker = restarted.at(0xff, 0xd1)
        refused<UnreadableRaw>(restarted.with(marker + 1, 0xd2), "no proper end")
        refused<UnreadableRaw>(restarted.with(marker, 0, 0), "JPEG data")
    }

    /** A flip in the coded data is found (two in five of them), or else just changes samples. */
    @Test
    fun manyFlippedBitsInJpegDataAreFound() {
        val from = plainJpeg.at(0xff, 0xda) + 12
        val until = plainJpeg.at(0xff, 0xd9)
        var found = 0
        var tried = 0
        for (at in from until until) {
            for (bit in 0 until 8) {
                tried++
                try {
                    read(plainJpeg.with(at, plainJpeg[at].toInt() xor (1 shl bit)))
                } catch (error: UnreadableRaw) {
                    found++
                }
            }
        }
        assertTrue(found > tried / 3, "$found of $tried")
    }

    // Deflate -----------------------------------------------------------------------------------------------------

    @Test
    fun deflateThatIsDamaged() {
        val bytes = dng(compression = 8)
        val start = 8
        refused<UnreadableRaw>(bytes.with(start + 60, 0, 0, 0, 0, 0), "deflated")
        refused<UnreadableRaw>(bytes.with(start, 0, 0), "deflated")
        refused<UnreadableRaw>(dng(mapOf(257 to Value.long(19), 278 to Value.long(19)), compression = 8), "too many")
        refused<UnreadableRaw>(dng(mapOf(257 to Value.long(21), 278 to Value.long(21)), compression = 8), "early")
        refused<UnsupportedRaw>(dng(mapOf(317 to Value.short(3)), bits = 16, compression = 8), "predictor 3")
        refused<UnsupportedRaw>(dng(compression = 8, predictor = 2), "predictor 2 on samples of 12 bits")
        val length = ByteBuffer.wrap(dng(compression = 8, tile = 24 to 20)) // one tile: its count is in its directory
            .order(ByteOrder.LITTLE_ENDIAN).let { it.getInt(4) - 8 }
        val checksum = bytes.copyOf()
        for (at in start + length - 8 until start + length) checksum[at] = (checksum[at] + 1).toByte()
        refused<UnreadableRaw>(checksum, "deflated")
    }

    // Any cut, regions, sources -----------------------------------------------------------------------------------

    @Test
    fun everyBeginningOfAFileIsRefused() {
        for (variant in Variants.all) { // the last 20 bytes are the name by which nobody asks
            for (length in 0 until variant.bytes.size - 20 step 61) {
                assertThrows<RawError>("${variant.name}, $length bytes") { read(variant.bytes.copyOf(length)) }
            }
        }
    }

    @Test
    fun damageOutsideTheRegionIsNotMet() {
        val bytes = dng(compression = 7, tile = 12 to 20, jpeg = { JpegWriter(12, it, 1) })
        val broken = bytes.with(bytes.at(0xff, 0xc3), 0, 0)
        refused<UnreadableRaw>(broken, "header")
        val found = read(broken, Region(13, 2, 22, 18))
        val samples = Variants.smooth(12, 24, 20)
        assertEquals(samples[2 * 24 + 13], found[13, 2])
        assertEquals(samples[17 * 24 + 21], found[21, 17])
        assertThrows<UnreadableRaw> { read(broken, Region(11, 2, 22, 18)) }
        val error = assertThrows<InvalidArgument> { found[12, 2] }
        assertEquals("invalid_argument", error.code)
        assertThrows<InvalidArgument> { read(bytes, Region(24, 0, 30, 10)) }
        assertThrows<InvalidArgument> { read(bytes, Region(5, 5, 5, 9)) }
    }

    /** One rule in both languages: a strip or tile that the part touches must be sound to its end. */
    @Test
    fun damageInATouchedPieceIsMetBehindTheRegion() {
        for (compression in listOf(7, 8)) {
            val bytes = dng(compression = compression)
            val end = if (compression == 7) {
                bytes.at(0xff, 0xd9)
            } else {
                ByteBuffer.wrap(bytes)
                    .order(ByteOrder.LITTLE_ENDIAN).getInt(4)
            }
            val broken = bytes.with(end - 8, 0xff, 0, 0xff, 0, 0xff, 0)
            assertThrows<UnreadableRaw> { read(broken, Region(0, 0, 24, 4)) }
        }
    }

    @Test
    fun onlyPiecesThatTheRegionTouchesAreDecoded() {
        val file = dng(tile = 12 to 10, bits = 16)
        val pieces = ArrayList<Long>()
        val source = DngSource.of(file, "photo.dng")
        val tiff = Tiff(
            object : DngSource by source {
                override fun read(at: Long, into: ByteArray, offset: Int, length: Int) {
                    pieces += at
                    source.read(at, into, offset, length)
                }
            },
        )
        val picture = storedPicture(tiff, rawDirectory(tiff))
        pieces.clear()
        decode(tiff, picture, Window(Region(13, 11, 20, 15), null), false)
        assertEquals(listOf(picture.offsets[3] + 24), pieces) // the last tile, from its second row on
    }

    @Test
    fun sources(@TempDir folder: File) {
        val variant = Variants.all.first()
        val file = File(folder, "a.dng").apply { writeBytes(variant.bytes) }
        val expected = read(variant.bytes)
        DngSource.of(file).use { assertTrue(expected.samples.contentEquals(DngReader.read(it).samples)) }
        val stream = DngSource.of(ByteArrayInputStream(variant.bytes), "a.dng")
        assertEquals(expected.origin.sha256, DngReader.read(stream).origin.sha256)
        assertThrows<UnsupportedRaw> { DngSource.of(ByteArrayInputStream(variant.bytes), "a.dng", 1000) }
        assertThrows<UnreadableRaw> { DngSource.of(folder) }
        assertThrows<UnreadableRaw> { DngSource.of(File(folder, "none.dng")) }
        val failing = object : DngSource by stream {
            override fun read(at: Long, into: ByteArray, offset: Int, length: Int) = throw IOException("unplugged")
        }
        val error = assertThrows<UnreadableRaw> { DngReader.read(failing) }
        assertTrue("unplugged" in error.message)
    }
}
