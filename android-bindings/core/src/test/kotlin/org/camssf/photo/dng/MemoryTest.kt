package org.camssf.photo.dng

import com.sun.management.ThreadMXBean
import org.camssf.UnreadableRaw
import org.camssf.photo.Mosaic
import org.camssf.photo.Region
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.assertThrows
import java.lang.management.ManagementFactory
import java.nio.ByteBuffer
import java.nio.ByteOrder

/** All that a read allocates, garbage included: the samples, one piece of the file, and little else. */
class MemoryTest {
    private val megabyte = 1L shl 20

    private fun allocated(bytes: ByteArray, region: Region? = null): Pair<Long, Mosaic> {
        val bean = ManagementFactory.getThreadMXBean() as ThreadMXBean
        val thread = Thread.currentThread().id
        val source = DngSource.of(bytes, "photo.dng")
        val before = bean.getThreadAllocatedBytes(thread)
        val found = DngReader.read(source, region)
        return bean.getThreadAllocatedBytes(thread) - before to found
    }

    @Test
    fun twelveMegapixels() {
        val width = 4000
        val height = 3000
        val samples = IntArray(width * height) { (it * 7 xor it / width) and 0xffff }
        val bytes = DngWriter(width, height, samples, tile = 400 to 300).encode()
        val (whole, found) = allocated(bytes)
        assertTrue(whole < 2L * samples.size + megabyte, "$whole bytes")
        assertEquals(samples[2999 * width + 3999], found[3999, 2999])
        val (part, _) = allocated(bytes, Region(1000, 1000, 2000, 1500))
        assertTrue(part < 2 * megabyte, "$part bytes")
    }

    @Test
    fun aPieceOfCodedDataAtATime() {
        val samples = Variants.smooth(12, 400, 300)
        for (compression in listOf(7, 8)) {
            for (tile in listOf(null, 80 to 60)) {
                val bytes = DngWriter(400, 300, samples, 12, compression = compression, tile = tile).encode()
                val (whole, _) = allocated(bytes)
                val piece = if (tile == null) bytes.size else bytes.size / 20
                assertTrue(whole < 2L * samples.size + piece + megabyte, "$whole bytes of $compression, $tile")
            }
        }
    }

    /** 64 directories of 65,535 entries, one inside the other, each with an entry that is wanted. */
    @Test
    fun manyLargeDirectories() {
        val length = 12 * 65535
        val bytes = ByteBuffer.allocate(8 + 64 * 12 + 2 + length + 4).order(ByteOrder.LITTLE_ENDIAN)
        bytes.put("II*\u0000".toByteArray()).putInt(8)
        for (at in 8 until bytes.capacity() - 12 step 12) { // as a directory: 65,535 entries; as an entry: tag 65535
            bytes.putShort(at, -1)
            bytes.putShort(at + 2, 256)
            bytes.putShort(at + 4, 4)
        }
        for (number in 0 until 64) {
            bytes.putInt(
                8 + 12 * number + 2 + length,
                if (number <
                    63
                ) {
                    20 + 12 * number
                } else {
                    0
                },
            )
        }
        val bean = ManagementFactory.getThreadMXBean() as ThreadMXBean
        val before = bean.getThreadAllocatedBytes(Thread.currentThread().id)
        val error = assertThrows<UnreadableRaw> { allocated(bytes.array()) }
        assertTrue("TIFF picture" in error.message, error.message)
        val whole = bean.getThreadAllocatedBytes(Thread.currentThread().id) - before
        assertTrue(whole < 64L * 65535 * (12 + 32) + megabyte, "$whole bytes") // an entry, two boxed numbers
    }
}
