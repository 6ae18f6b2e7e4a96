package org.camssf.finder

import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.abs
import kotlin.math.sqrt

/** Blobs, held to a search from pixel to pixel. */
class BlobsTest {
    private val limits = FinderFile.limits
    private val blobs = Blobs()

    /** The sums of the channels. */
    private fun light(codes: Codes): IntArray {
        val size = codes.width * codes.height
        return IntArray(size) { i -> (0 until codes.channels).sumOf { codes.values[it * size + i] } }
    }

    /** Which pixels exceed `sixteenths` of the mean over the part of their window that is in the picture. */
    private fun bright(codes: Codes, reach: Int, sixteenths: Int): BooleanArray {
        val light = light(codes)
        return BooleanArray(light.size) { i ->
            var total = 0
            var count = 0
            for (y in maxOf(i / codes.width - reach, 0)..minOf(i / codes.width + reach, codes.height - 1)) {
                for (x in maxOf(i % codes.width - reach, 0)..minOf(i % codes.width + reach, codes.width - 1)) {
                    total += light[y * codes.width + x]
                    count++
                }
            }
            16 * count * light[i] > sixteenths * total
        }
    }

    /** The pixels of each component, by its first pixel in reading order. */
    private fun components(bright: BooleanArray, width: Int): List<List<Int>> {
        val left = bright.copyOf()
        return left.indices.mapNotNull { first ->
            if (!left[first]) return@mapNotNull null
            val own = arrayListOf(first)
            left[first] = false
            var at = 0
            while (at < own.size) {
                val i = own[at++]
                for (next in listOf(i - width, i + width, i - 1, i + 1)) {
                    val beside = next in left.indices && (next % width == i % width || next / width == i / width)
                    if (!beside || !left[next]) continue
                    left[next] = false
                    own += next
                }
            }
            own
        }
    }

    /** x, y, area, xx, xy, yy, determinant of the moments. */
    private fun measured(pixels: List<Int>, width: Int): DoubleArray {
        val x = pixels.sumOf { it % width } / pixels.size.toDouble()
        val y = pixels.sumOf { it / width } / pixels.size.toDouble()
        val xx = pixels.sumOf { (it % width - x) * (it % width - x) } / pixels.size + 1.0 / 12
        val xy = pixels.sumOf { (it % width - x) * (it / width - y) } / pixels.size
        val yy = pixels.sumOf { (it / width - y) * (it / width - y) } / pixels.size + 1.0 / 12
        return doubleArrayOf(x, y, pixels.size.toDouble(), xx, xy, yy, xx * yy - xy * xy)
    }

    private fun searched(codes: Codes): List<DoubleArray> {
        val kept = ArrayList<DoubleArray>()
        for ((reach, sixteenths) in limits.passes.map { it[0] to it[1] }) {
            for (pixels in components(bright(codes, reach, sixteenths), codes.width)) {
                val blob = measured(pixels, codes.width)
                val (x, y, area) = blob
                val share = area / (12 * sqrt(blob[6]))
                val long = (blob[3] + blob[5]) * (blob[3] + blob[5]) / blob[6] > limits.longestShape
                if (area < limits.smallestArea || area * limits.largestShare > codes.width * codes.height) continue
                if (long || share < limits.full[0] || share > limits.full[1]) continue
                val known = kept.any {
                    val (p, q, other) = it
                    (x - p) * (x - p) + (y - q) * (y - q) < 0.1 * area && other >= area / 2 && other <= 2 * area
                }
                if (!known) kept += blob
            }
        }
        return kept
    }

    @Test
    fun `blobs are what a search from pixel to pixel finds`() {
        val pictures = listOf(
            Painter(150, 110).keys(14).noise(6),
            Painter(110, 150).chart(55.0, 70.0, 17.0, 25.0).noise(10),
            Painter(40, 33).keys(9).noise(3),
            Painter(120, 90).keys(25).chart(60.0, 45.0, 12.0, 70.0).noise(25),
        )
        var all = 0
        for (picture in pictures + pictures) { // once more in what is left of the others
            val codes = Codes().also { it.read(picture.picture()) }
            val expected = searched(codes)
            blobs.find(codes)
            assertEquals(expected.size, blobs.size)
            for ((i, blob) in expected.withIndex()) {
                val own = listOf(blobs.x, blobs.y, blobs.area, blobs.xx, blobs.xy, blobs.yy, blobs.det)
                for (k in 0..6) assertEquals(blob[k], own[k][i], 1e-9 * (1 + abs(blob[k])))
            }
            all += blobs.size
        }
        assertTrue(all > 100, "$all blobs")
    }

    @Test
    fun `there are no more blobs than the limit`() {
        blobs.find(Codes().also { it.read(Painter().keys(9).picture()) })
        assertEquals(limits.mostBlobs, blobs.size)
    }
}
