package org.camssf.finder

import org.camssf.InvalidArgument
import org.camssf.photo.Mosaic
import org.camssf.photo.Region
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Test
import kotlin.math.floor
import kotlin.math.sqrt

/** Every form of a picture as codes of 0 to 4095. */
class CodesTest {
    private fun codes(picture: Picture) = Codes().also { it.read(picture) }

    private fun assertCodes(found: Codes, width: Int, height: Int, channels: Int, value: (Int, Int, Int) -> Int) {
        assertEquals(listOf(width, height, channels), listOf(found.width, found.height, found.channels))
        for (c in 0 until channels) {
            for (y in 0 until height) {
                for (x in 0 until width) {
                    assertEquals(value(x, y, c), found.values[(c * height + y) * width + x], "$x, $y, $c")
                }
            }
        }
    }

    private fun plane(width: Int, height: Int, of: (Int, Int) -> Int) =
        Plane(ByteArray(width * height) { of(it % width, it / width).toByte() }, width)

    private fun level(x: Int, y: Int, c: Int) = (31 * x + 17 * y + 101 * c) % 256

    @Test
    fun `bytes are sixteenths of a code`() {
        val planes = List(3) { c -> plane(40, 33) { x, y -> level(x, y, c) } }
        val found = codes(Picture.rgb(planes[0], planes[1], planes[2], 40, 33))
        assertCodes(found, 40, 33, 3) { x, y, c -> 16 * level(x, y, c) }
        assertEquals(listOf(7.0, 9.0), listOf(found.toSource(7.0, 0), found.toSource(9.0, 1)))
        assertCodes(codes(Picture.luma(planes[1], 40, 33)), 40, 33, 1) { x, y, _ -> 16 * level(x, y, 1) }
    }

    @Test
    fun `more than 960 px a side are taken together`() {
        for ((width, height, step) in listOf(Triple(960, 34, 1), Triple(961, 34, 2), Triple(67, 1921, 3))) {
            val found = codes(Picture.luma(plane(width, height) { x, y -> level(x, y, 0) }, width, height))
            assertEquals(step, found.step)
            assertCodes(found, width / step, height / step, 1) { x, y, _ ->
                val total = (0 until step * step).sumOf { level(step * x + it % step, step * y + it / step, 0) }
                floor(16.0 * total / (step * step) + 0.5).toInt()
            }
            assertEquals((step - 1) / 2.0 + 5 * step, found.toSource(5.0, 0))
        }
    }

    /** ITU-R BT.601 in full range; chroma of every second pixel, its bytes two apart. */
    @Test
    fun `luma and chroma are red, green and blue`() {
        for (width in listOf(40, 41)) {
            val half = (width + 1) / 2
            fun chroma(x: Int, y: Int, c: Int) = level(3 * (x / 2), 2 * (y / 2), c)
            val (u, v) = List(2) { c ->
                Plane(
                    ByteArray(2 * half * 17) { level(3 * (it / 2 % half), 2 * (it / 2 / half), c + 1).toByte() },
                    2 * half, 2,
                )
            }
            val found = codes(Picture.yuv(plane(width, 34) { x, y -> level(x, y, 0) }, u, v, width, 34))
            val size = width * 34
            for (at in 0 until 3 * size) {
                val (x, y) = at % width to at % size / width
                val (cb, cr) = chroma(x, y, 1) - 128 to chroma(x, y, 2) - 128
                val light = level(x, y, 0) + when (at / size) {
                    0 -> 1.402 * cr
                    1 -> -0.344136 * cb - 0.714136 * cr
                    else -> 1.772 * cb
                }
                assertEquals(light.coerceIn(0.0, 255.0), found.values[at] / 16.0, 0.501)
                assertEquals(0, found.values[at] % 16)
            }
        }
    }

    private fun root(share: Double) = floor(4095 * sqrt(share)).toInt()

    @Test
    fun `light is told by roots, each colour by its largest`() {
        fun light(x: Int, y: Int, c: Int) = when {
            x == 3 && y == 4 -> Float.NaN
            else -> (10f * c + (7 * x + 3 * y) % 50) * (c + 1) - 4
        }
        val planes = List(3) { c -> FloatArray(50 * 40) { light(it % 50, it / 50, c) } }
        val most =
            List(3) { c -> (0 until 1360).maxOf { i -> light(i % 40, i / 40, c).let { if (it.isNaN()) 0f else it } } }
        val found = codes(Picture.light(planes, 40, 34, 50))
        assertCodes(found, 40, 34, 3) { x, y, c ->
            val own = light(x, y, c)
            if (own.isNaN() || own < 0) 0 else root(own.toDouble() / most[c])
        }
        val dark = codes(Picture.light(listOf(FloatArray(1600)), 40, 40))
        assertCodes(dark, 40, 40, 1) { _, _, _ -> 0 }
        // Two by two of a large one.
        val large =
            codes(Picture.light(listOf(FloatArray(1000 * 64) { (it % 1000 + it / 1000).toFloat() }), 1000, 64))
        val brightest = 4.0 * (998 + 62 + 1)
        assertCodes(large, 500, 32, 1) { x, y, _ -> root(4.0 * (2 * x + 2 * y + 1) / brightest) }
    }

    /** Black 10 to 40 DN by place of the cell; the part begins at odd places, the codes with its first whole cell. */
    @Test
    fun `a mosaic's cells are pixels, their greens added`() {
        fun sample(x: Int, y: Int) = 100 + (13 * x + 29 * y) % 400
        for ((cfa, red) in listOf("RGGB" to 0, "GRBG" to 1, "GBRG" to 2, "BGGR" to 3)) {
            for ((left, top) in listOf(0 to 0, 3 to 5, 4 to 2)) {
                val region = Region(left, top, 90, 80)
                val samples = ShortArray(region.width * region.height) {
                    sample(left + it % region.width, top + it / region.width).toShort()
                }
                val sensor = Mosaic.Sensor(cfa, doubleArrayOf(10.0, 20.0, 30.0, 40.0), 1000.0)
                val found = codes(Picture.of(Mosaic(Mosaic.Origin("a"), 100, 90, region, samples, sensor)))
                val (x0, y0) = (left + 1) / 2 * 2 to (top + 1) / 2 * 2
                fun above(x: Int, y: Int, place: Int) =
                    sample(x0 + 2 * x + place % 2, y0 + 2 * y + place / 2) - 10.0 * (place + 1)
                fun light(x: Int, y: Int, c: Int) = when (c) {
                    0 -> above(x, y, red)
                    1 -> above(x, y, red xor 1) + above(x, y, red xor 2)
                    else -> above(x, y, red xor 3)
                }
                val (width, height) = (90 - x0) / 2 to (80 - y0) / 2
                val most = List(3) { c -> (0 until width * height).maxOf { light(it % width, it / width, c) } }
                assertCodes(found, width, height, 3) { x, y, c -> root(light(x, y, c) / most[c]) }
                assertEquals(x0 + 0.5, found.toSource(0.0, 0))
                assertEquals(y0 + 2.5, found.toSource(1.0, 1))
            }
        }
    }

    @Test
    fun `cells of a large mosaic are taken together`() {
        val region = Region(0, 0, 2000, 140)
        val samples = ShortArray(2000 * 140) { (it % 2000 + 10 * (it / 2000)).toShort() }
        val sensor = Mosaic.Sensor("RGGB", DoubleArray(4), 4000.0)
        val found = codes(Picture.of(Mosaic(Mosaic.Origin("a"), 2000, 140, region, samples, sensor)))
        fun red(x: Int, y: Int) = (0..3).sumOf { 4 * x + 2 * (it % 2) + 10 * (4 * y + 2 * (it / 2)) }.toDouble()
        assertEquals(listOf(500, 35, 4), listOf(found.width, found.height, found.step))
        val most = red(499, 34)
        for (at in 0 until 17500 step 7) assertEquals(root(red(at % 500, at / 500) / most), found.values[at])
    }

    @Test
    fun `half the size is means of four`() {
        val whole = codes(Picture.luma(plane(67, 71) { x, y -> level(x, y, 0) }, 67, 71))
        val half = Codes().also { it.halve(whole) }
        assertCodes(half, 33, 35, 1) { x, y, _ ->
            val total = (0..3).sumOf { whole.values[(2 * y + it / 2) * 67 + 2 * x + it % 2] }
            floor(total / 4.0 + 0.5).toInt()
        }
        assertEquals(2, half.step)
        assertEquals(0.5, half.toSource(0.0, 1))
    }

    @Test
    fun `a plane holds the picture's last pixel`() {
        fun bytes(size: Int, rowStride: Int, pixelStride: Int = 1) = Plane(ByteArray(size), rowStride, pixelStride)
        Picture.luma(bytes(31 * 50 + 40, 50), 40, 32)
        Picture.luma(bytes(31 * 80 + 39 * 2 + 1, 80, 2), 40, 32)
        val wrong = listOf(
            { Picture.luma(bytes(31 * 50 + 39, 50), 40, 32) },
            { Picture.luma(bytes(31 * 80 + 39 * 2, 80, 2), 40, 32) },
            { Picture.luma(bytes(9999, -1), 40, 32) },
            { Picture.luma(bytes(9999, 40, 0), 40, 32) },
            { Picture.yuv(bytes(41 * 33, 41), bytes(21 * 17, 21), bytes(21 * 17 - 1, 21), 41, 33) },
            { Picture.yuv(bytes(41 * 33, 41), bytes(21 * 17 - 1, 21), bytes(21 * 17, 21), 41, 33) },
            { Picture.luma(bytes(9999, 40), 31, 32) },
            { Picture.luma(bytes(9999, 40), 32, 31) },
            { Picture.light(listOf(FloatArray(31 * 50 + 39)), 40, 32, 50) },
            { Picture.light(List(2) { FloatArray(9999) }, 40, 32) },
            { Picture.light(List(4) { FloatArray(9999) }, 40, 32) },
        )
        for (each in wrong) assertThrows(InvalidArgument::class.java) { each() }
        Picture.yuv(bytes(41 * 33, 41), bytes(21 * 17, 21), bytes(21 * 17, 21), 41, 33)
        Picture.luma(bytes(9999, 40), 32, 32)
        Picture.luma(bytes(9999, 0), 32, 32)
        Picture.light(listOf(FloatArray(31 * 50 + 40)), 40, 32, 50)
        Picture.light(List(3) { FloatArray(9999) }, 40, 32)
    }

    /** Of a mosaic 32 cells a side count, wherever they begin. */
    @Test
    fun `a mosaic has 32 cells to each side`() {
        fun of(width: Int, height: Int): Picture {
            val region = Region(0, 0, width, height)
            val sensor = Mosaic.Sensor("RGGB", DoubleArray(4), 1000.0)
            return Picture.of(Mosaic(Mosaic.Origin("a"), width, height, region, ShortArray(width * height), sensor))
        }
        assertEquals(65 to 66, of(65, 66).let { it.width to it.height })
        assertThrows(InvalidArgument::class.java) { of(64, 66) }
        assertThrows(InvalidArgument::class.java) { of(66, 64) }
    }
}
