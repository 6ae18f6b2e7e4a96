package org.camssf.dng

import com.sun.management.ThreadMXBean
import org.camssf.DngReader
import org.camssf.DngSource
import org.camssf.Mosaic
import org.camssf.Region
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.lang.management.ManagementFactory

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

    /** Directories that overlap cost no more memory than one. */
    @Test
    fun manyLargeDirectories() {
        val bytes = ByteArray(900_000)
        "II*\u0000".toByteArray().copyInto(bytes)
        bytes[4] = 8
        bytes[8] = -1
        bytes[9] = -1
        val error = runCatching { allocated(bytes) }.exceptionOrNull()
        assertEquals("unreadable_raw", (error as? org.camssf.RawError)?.code)
    }
}
