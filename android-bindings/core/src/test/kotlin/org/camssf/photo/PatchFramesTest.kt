package org.camssf.photo

import org.junit.jupiter.api.AfterEach
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test

/** How often frames are read, and what is left of them in between. */
class PatchFramesTest {
    private val width = 120
    private val height = 90

    private val mosaic = Mosaic(
        Mosaic.Origin("a.dng"), width, height, Region(0, 0, width, height),
        ShortArray(width * height) { (it % 97).toShort() }, Mosaic.Sensor("RGGB", DoubleArray(4), 1000.0),
    )

    /** Writes down what is asked of it. */
    private inner class Recorder(val reading: Reading = Whole(mosaic), val meanwhile: () -> Unit = {}) :
        Reading by reading {
        val scans = ArrayList<Region>()
        var releases = 0

        override fun scan(region: Region, rows: Rows) {
            scans += region
            reading.scan(region, rows)
            meanwhile()
        }

        override fun release() {
            releases++
        }
    }

    /** Four patches in two rows, from below; the middle half of each is 20 × 20 px: 100 samples of each position. */
    private val quads = listOf(20 to 50, 70 to 50, 20 to 10, 70 to 10).map { (x, y) ->
        val (a, b) = x - 10.0 to y - 10.0
        DoubleArray(8) { listOf(a, b, a + 40, b, a + 40, b + 40, a, b + 40)[it] + if (it % 2 == 0) 0.5 else 10.5 }
    }

    private fun measured(frame: Recorder, together: Long): List<Int> {
        val found = ArrayList<Int>()
        PatchFrames(listOf(frame), quads, together).each { patch, _, _ -> found += patch }
        return found.distinct()
    }

    @Test
    fun `as many patches are read together as fit, from the top down`() {
        for ((together, scans) in listOf(1L to 4, 799L to 4, 800L to 2, 1199L to 2, 1200L to 2, 1600L to 1)) {
            val frame = Recorder()
            assertEquals(listOf(2, 3, 0, 1), measured(frame, together))
            assertEquals(scans, frame.scans.size, "$together")
            assertEquals(scans, frame.releases)
            assertTrue(frame.scans.zipWithNext().all { (one, next) -> one.top <= next.top })
        }
        val frame = Recorder()
        measured(frame, 1600L)
        assertEquals(Region(21, 21, 91, 81), frame.scans.single())
    }

    @Test
    fun `who interrupts before the photo is read spares it`() {
        val frame = Recorder()
        Thread.currentThread().interrupt()
        assertThrows(InterruptedException::class.java) { measured(frame, 1L) }
        assertEquals(0, frame.scans.size)
    }

    @Test
    fun `who interrupts while it is read gets no patch`() {
        val found = ArrayList<Int>()
        val frame = Recorder(meanwhile = { Thread.currentThread().interrupt() })
        assertThrows(InterruptedException::class.java) {
            PatchFrames(listOf(frame), quads, 1L).each { patch, _, _ -> found += patch }
        }
        assertEquals(emptyList<Int>(), found)
    }

    @AfterEach
    fun calm() {
        Thread.interrupted()
    }
}
