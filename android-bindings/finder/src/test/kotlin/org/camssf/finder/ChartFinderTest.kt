package org.camssf.finder

import org.camssf.InvalidArgument
import org.camssf.photo.Mosaic
import org.camssf.photo.Region
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File
import java.lang.management.ManagementFactory
import java.nio.ByteBuffer
import kotlin.math.abs

/** What an app sees of the finder; the golden stage holds it to Python's numbers. */
class ChartFinderTest {
    private val finder = ChartFinder()

    private fun read(name: String): Mosaic {
        val file = File(System.getProperty("camssf.root"), "golden/dng/$name")
        return DngSource.of(file).use { DngReader.read(it) }
    }

    private fun assertAt(x: Double, y: Double, candidate: Candidate, patch: Int) {
        val found = candidate.patches[patch]
        assertTrue(abs(found.x - x) < 0.6 && abs(found.y - y) < 0.6, "patch $patch at $found, not ($x, $y)")
    }

    @Test
    fun `a chart is found where it lies, its first patch named, in each quarter`() {
        for (turn in 0..3) {
            val found = finder.find(Painter().chart(300.0, 250.0, 40.0, 90.0 * turn).picture())
            val candidate = found.candidate!!
            assertEquals(emptySet<Finding>(), found.findings)
            assertEquals(ChartKind.CLASSIC_24, candidate.kind)
            assertEquals(turn, candidate.corners.quarterTurns)
            val (dx, dy) = listOf(-100.0 to -60.0, 60.0 to -100.0, 100.0 to 60.0, -60.0 to 100.0)[turn]
            assertAt(300 + dx, 250 + dy, candidate, 0)
            assertAt(300 - dx, 250 - dy, candidate, 23)
            assertTrue(
                candidate.confidence > 0.99 && candidate.seen >= 18,
                "${candidate.confidence}, ${candidate.seen}",
            )
        }
    }

    @Test
    fun `the corners are half a patch beyond the corner patches`() {
        val candidate = finder.find(Painter().chart(300.0, 250.0, 40.0).picture()).candidate!!
        val corners = candidate.corners.toArray()
        val wanted = doubleArrayOf(182.4, 172.4, 417.6, 172.4, 417.6, 327.6, 182.4, 327.6)
        for (i in wanted.indices) assertEquals(wanted[i], corners[i], 0.6)
    }

    @Test
    fun `a mirrored chart is said to be one`() {
        for (turn in listOf(0.0, 70.0)) {
            val found = finder.find(Painter().chart(320.0, 240.0, 40.0, turn, mirrored = true).picture())
            assertEquals(setOf(Finding.MIRRORED), found.findings)
            assertTrue(found.candidate!!.mirrored)
        }
    }

    @Test
    fun `two charts are two candidates`() {
        val found = finder.find(Painter().chart(150.0, 120.0, 40.0).chart(480.0, 350.0, 35.0, 180.0).picture())
        assertEquals(setOf(Finding.TWO_CHARTS), found.findings)
        assertEquals(setOf(0, 2), found.candidates.map { it.corners.quarterTurns }.toSet())
    }

    @Test
    fun `without a chart, with half of one, or with only its greys there is none`() {
        val half = Painter().chart(0.0, 240.0, 50.0)
        val keys = Painter().keys(24)
        for (picture in listOf(Painter(), Painter().noise(60), keys, half)) {
            val found = finder.find(picture.picture())
            assertEquals(setOf(Finding.NONE), found.findings)
            assertNull(found.candidate)
        }
    }

    @Test
    fun `a finder that has seen one picture finds the same in the next`() {
        val picture = Painter().keys(24).chart(300.0, 250.0, 30.0, 20.0).picture()
        val first = finder.find(picture).candidate!!
        finder.find(Painter(200, 900).noise(40).picture())
        assertEquals(first.corners, finder.find(picture).candidate!!.corners)
        assertEquals(first.corners, ChartFinder().find(picture).candidate!!.corners)
    }

    @Test
    fun `strides and positions of a buffer change nothing`() {
        val painter = Painter().chart(300.0, 250.0, 40.0, 10.0)
        val plain = finder.find(painter.picture()).candidate!!
        val stride = 3 * 640 + 17
        val mixed = ByteBuffer.allocateDirect(480 * stride)
        for (y in 0 until 480) {
            for (x in 0 until 640) for (c in 0..2) mixed.put(y * stride + 3 * x + c, painter.planes[c][y * 640 + x])
        }
        val planes = List(3) { c ->
            mixed.clear()
            mixed.position(c)
            Plane(mixed.slice(), stride, 3)
        }
        mixed.position(7)
        val picture = Picture.rgb(planes[0], planes[1], planes[2], 640, 480)
        assertEquals(plain.corners, finder.find(picture).candidate!!.corners)
    }

    @Test
    fun `luma alone is enough in even light`() {
        val painter = Painter().chart(300.0, 250.0, 40.0, 100.0)
        val candidate = finder.find(Picture.luma(Plane(painter.planes[1], 640), 640, 480)).candidate!!
        assertEquals(1, candidate.corners.quarterTurns)
    }

    @Test
    fun `a larger picture is reduced, and its points are its own`() {
        val candidate = finder.find(Painter(2000, 1500).chart(1200.0, 900.0, 120.0).picture()).candidate!!
        val first = candidate.patches[0]
        assertTrue(abs(first.x - 900) < 2 && abs(first.y - 720) < 2, "$first")
    }

    @Test
    fun `a part of a mosaic gives points of the whole photo`() {
        val whole = read("finder-clutter.dng")
        val expected = finder.find(Picture.of(whole)).candidate!!
        val region = Region(101, 43, 379, 299)
        val samples = ShortArray(region.width * region.height) {
            whole.samples[(region.top + it / region.width) * whole.width + region.left + it % region.width]
        }
        val part = Mosaic(Mosaic.Origin("part"), whole.width, whole.height, region, samples, whole.sensor)
        val found = finder.find(Picture.of(part)).candidate!!
        for ((a, b) in expected.patches.zip(found.patches)) assertTrue(abs(a.x - b.x) < 0.5 && abs(a.y - b.y) < 0.5)
    }

    @Test
    fun `what is no picture is refused with advice`() {
        val plane = Plane(ByteArray(640 * 480), 640)
        val wrong = listOf(
            { Picture.luma(plane, 640, 481) },
            { Picture.luma(plane, 31, 31) },
            { Picture.luma(Plane(ByteArray(100), 0, 0), 640, 480) },
            { Picture.yuv(plane, plane, Plane(ByteArray(100), 320), 640, 480) },
            { Picture.light(listOf(FloatArray(10)), 640, 480) },
            { Picture.light(listOf(), 640, 480) },
        )
        for (each in wrong) {
            val error = assertThrows(InvalidArgument::class.java) { each() }
            assertTrue(error.advice.startsWith("Give"), error.advice)
        }
    }

    @Test
    fun `a search leaves little garbage, with a chart and without`() {
        val clock = ManagementFactory.getThreadMXBean() as com.sun.management.ThreadMXBean
        val me = Thread.currentThread().id
        val pictures = mapOf(
            "chart" to Painter().chart(300.0, 250.0, 40.0, 10.0).noise(4).picture(),
            "chart on keys" to Painter().keys(24).chart(300.0, 250.0, 30.0, 20.0).noise(4).picture(),
            "keys" to Painter().keys(22).noise(4).picture(),
            "noise" to Painter().noise(60).picture(),
        )
        repeat(15) { pictures.values.forEach { finder.find(it) } }
        for ((name, picture) in pictures) {
            val before = clock.getThreadAllocatedBytes(me)
            repeat(ROUNDS) { finder.find(picture) }
            val garbage = (clock.getThreadAllocatedBytes(me) - before) / ROUNDS
            assertTrue(garbage < 1_000_000, "$name: $garbage bytes")
        }
    }

    private companion object {
        const val ROUNDS = 20
    }
}
