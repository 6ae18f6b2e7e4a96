package org.camssf.photo

import org.camssf.ChartNotFound
import org.camssf.InvalidArgument
import org.camssf.chartCorners
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.camssf.photo.dng.Variants
import org.camssf.spectra.ChartTable
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File
import java.util.concurrent.CancellationException

/** A photo that is read part by part is the photo that is read at once. */
class ReadingTest {
    private val root = File(System.getProperty("camssf.root"))
    private val photo = File(root, "golden/dng/chart-turned-0.dng")
    private val chart = ChartTable.read("classic24")

    private fun collect(reading: Reading, part: Region): ShortArray {
        val found = ShortArray(part.width * part.height)
        val seen = BooleanArray(found.size)
        reading.scan(part) { y, x, count, samples, at ->
            for (i in 0 until count) {
                val place = (y - part.top) * part.width + x + i - part.left
                assertTrue(!seen[place], "twice")
                seen[place] = true
                found[place] = samples[at + i]
            }
        }
        assertTrue(seen.all { it }, "not all")
        return found
    }

    @Test
    fun `rows of every form of DNG are its samples`() {
        for (variant in Variants.all) {
            val whole = DngReader.read(DngSource.of(variant.bytes, "a.dng"))
            val source = PhotoSource.dng { DngSource.of(variant.bytes, "a.dng") } as ByRows
            for (part in listOf(whole.region, Region(1, 2, whole.width - 1, whole.height), Region(3, 3, 4, 4))) {
                val reading = source.rows(part)
                val wanted = DngReader.read(DngSource.of(variant.bytes, "a.dng"), part)
                assertArrayEquals(wanted.samples, collect(reading, part))
                assertEquals(whole.origin.sha256, reading.sha256)
                assertEquals(whole.width to whole.height, reading.facts.width to reading.facts.height)
            }
        }
    }

    @Test
    fun `pose and means are the same by rows, in bands and at once`() {
        val whole = DngReader.read(DngSource.of(photo))
        val pose = ChartPose.refine(whole, chartCorners, chart)
        val means = PatchMeans.measure(whole, pose)
        assertEquals("PatchMeans(chart=FrameMeans(24 patches), white=null, dark=null)", means.toString())
        val region = ChartPose.region(chartCorners)
        val source = PhotoSource.of(photo)
        for (reading in listOf((source as ByRows).rows(region), Banded(source, region, true, 500))) {
            val found = ChartPose.refine(reading, chartCorners, chart)
            assertArrayEquals(pose.sharedQuads, found.sharedQuads)
            for (together in listOf(1L, 400L, 8L shl 20)) {
                val frames = ArrayList<Triple<Int, Int, Double>>()
                val quads = List(24) { found.sharedQuads.copyOfRange(8 * it, 8 * it + 8) }
                PatchFrames(listOf(reading), quads, together).each { patch, position, sample ->
                    frames += Triple(patch, position, sample[0].mean)
                }
                assertEquals(96, frames.map { it.first to it.second }.toSet().size)
                for ((patch, position, mean) in frames) {
                    if (position == 0) assertEquals(means.chart.sharedMean[3 * patch], mean)
                    if (position == 3) assertEquals(means.chart.sharedMean[3 * patch + 2], mean)
                }
            }
        }
    }

    @Test
    fun `bands are read one at a time, and their hash is that of the whole`() {
        val whole = DngReader.read(DngSource.of(photo))
        val nameless = Mosaic(
            Mosaic.Origin("frame"), whole.width, whole.height, whole.region, whole.samples, whole.sensor,
        )
        val asked = ArrayList<Region>()
        val source = PhotoSource { region ->
            asked += region!!
            val samples = ShortArray(region.width * region.height) {
                nameless[region.left + it % region.width, region.top + it / region.width].toShort()
            }
            nameless.facts.mosaic(region, samples)
        }
        val banded = Banded(source, whole.region, true, whole.width * 10L)
        assertArrayEquals(whole.samples, collect(banded, whole.region))
        assertEquals(
            (0 until whole.height step 10).map { it to minOf(it + 10, whole.height) },
            asked.map {
                it.top to
                    it.bottom
            },
        )
        assertEquals(Whole(nameless).sha256, banded.sha256)
    }

    @Test
    fun `of a frame that is not the chart's, two rows are read for its facts`() {
        val asked = ArrayList<Region>()
        val source = PhotoSource { region ->
            asked += region!!
            PhotoSource.of(photo).read(region)
        }
        val region = ChartPose.region(chartCorners)
        val frame = Reading.of(source, region, false) {}
        assertEquals("RGGB".length, frame.facts.sensor.cfa.length)
        assertEquals(listOf(2), asked.map { it.height })
        val chart = Reading.of(source, region, true) {}
        asked.clear()
        chart.facts
        chart.scan(chart.facts.clipped(region)) { _, _, _, _, _ -> }
        assertEquals(listOf(region), asked)
    }

    /** Between two rows and between two runs of a model a cancelled run ends; the latter in SsfCalibratorTest. */
    @Test
    fun `a cancelled scan ends at the next row`() {
        val rows = PhotoSource.of(photo)
        for (source in listOf(rows, PhotoSource { rows.read(it) })) {
            var count = 0
            val reading = Reading.of(source, ChartPose.region(chartCorners), false) {
                if (++count == 3) throw CancellationException()
            }
            assertThrows(CancellationException::class.java) { ChartPose.refine(reading, chartCorners, chart) }
            assertEquals(3, count)
        }
    }

    @Test
    fun `a source that gives less than was asked for is told so`() {
        val part = DngSource.of(photo).use { DngReader.read(it, Region(0, 0, 90, 60)) }
        val reading = Reading.of(PhotoSource { part }, ChartPose.region(chartCorners), true) {}
        val error = assertThrows(InvalidArgument::class.java) { ChartPose.refine(reading, chartCorners, chart) }
        assertTrue("Read that part too" in error.advice)
    }

    @Test
    fun `the first patch that fails is named, whatever the order of reading`() {
        val whole = Whole(DngReader.read(DngSource.of(photo)))
        val pose = ChartPose.refine(whole, chartCorners, chart)
        val quads = List(24) { pose.sharedQuads.copyOfRange(8 * it, 8 * it + 8) }.toMutableList()
        quads[20] = doubleArrayOf(4.0, 4.0, 5.0, 4.0, 5.0, 5.0, 4.0, 5.0) // read first, as it stands above the others
        quads[7] = DoubleArray(8) { quads[7][it % 2] + it / 4.0 }
        quads[22] = DoubleArray(8) { -5.0 }
        val error =
            assertThrows(ChartNotFound::class.java) { PatchFrames(listOf(whole), quads, 1L).each { _, _, _ -> } }
        assertTrue("patch 8 holds" in error.message, error.message)
    }
}
