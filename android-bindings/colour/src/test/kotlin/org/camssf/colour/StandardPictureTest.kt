package org.camssf.colour

import org.camssf.CalibrationException
import org.camssf.InvalidArgument
import org.camssf.UnsupportedRaw
import org.camssf.photo.GainMap
import org.camssf.photo.LensShading
import org.camssf.photo.Mosaic
import org.camssf.photo.PhotoSource
import org.camssf.photo.PhysicalCamera
import org.camssf.photo.Region
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertFalse
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Tag
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.TestInstance
import kotlin.math.abs

/** Pictures in standard colour; the golden stage `picture` holds their numbers. */
@Tag("R-COLOUR")
@TestInstance(TestInstance.Lifecycle.PER_CLASS) // one table of colours, which takes seconds, for all tests
class StandardPictureTest {
    private val text = GoldenResult.text
    private val d55 = Lamp.read("D55")
    private val card = PaintedPhoto.of(40, 30, origin = PaintedPhoto.origin("white.dng")) { _, _, _ -> 1.0 }
    private val standardiser =
        Standardiser.read(text, d55, Reference(RawRegion.measure(card, listOf(Region(0, 0, 30, 28))).single()))

    /** A picture's numbers, and those of its uncertainty. */
    private class Numbers(val pixels: IntArray, val uncertainty: IntArray, val strips: Int)

    private fun numbers(picture: StandardPicture): Numbers {
        val pixels = ArrayList<Int>()
        val uncertainty = ArrayList<Int>()
        var strips = 0
        picture.strips { top, rows, ofStrip, deviations ->
            assertEquals(pixels.size, 3 * picture.width * top)
            assertEquals(ofStrip.size, 3 * picture.width * rows)
            assertTrue(rows * picture.width <= maxOf(1 shl 16, 2 * picture.width))
            strips++
            ofStrip.mapTo(pixels) { it.toInt() and 0xffff }
            deviations.mapTo(uncertainty) { it.toInt() and 0xffff }
        }
        assertEquals(3 * picture.width * picture.height, pixels.size)
        assertEquals(3 * (picture.width / 2) * (picture.height / 2), uncertainty.size)
        return Numbers(pixels.toIntArray(), uncertainty.toIntArray(), strips)
    }

    @Test
    fun `white is white, grey is grey, and below black is black`() {
        val light = numbers(standardiser.picture(card))
        assertTrue(light.pixels.all { it > 65200 }, "${light.pixels.minOrNull()}")
        val grey = PaintedPhoto.of(12, 10) { _, _, _ -> 0.18 }
        val known = 65535 * (1.055 * Math.pow(0.18, 1 / 2.4) - 0.055)
        assertTrue(numbers(standardiser.picture(grey)).pixels.all { abs(it - known) < 150 })
        val dark = numbers(standardiser.picture(PaintedPhoto.of(12, 10) { _, _, _ -> -0.001 }))
        assertTrue(dark.pixels.all { it == 0 })
        val linear = numbers(standardiser.picture(card, PictureSpace.XYZ_D50)).pixels
        val d50 = listOf(0.9642, 1.0, 0.8249)
        for (c in 0..2) assertEquals(32768 * d50[c], linear[c].toDouble(), 250.0)
    }

    @Test
    fun `what a clipped sample reached is marked and white`() {
        val photo = PaintedPhoto.of(24, 20) { x, y, _ -> if (x == 9 && y == 9) 5.0 else 0.2 }
        val found = numbers(standardiser.picture(photo))
        for (y in 0 until 20) {
            for (x in 0 until 24) {
                val white = (0..2).all { found.pixels[3 * (24 * y + x) + it] == 65535 }
                assertEquals(abs(x - 9) <= 2 && abs(y - 9) <= 2, white, "$x, $y")
            }
        }
        val marked = (0 until 120).count { found.uncertainty[3 * it] == StandardPicture.CLIPPED }
        assertEquals(9, marked) // cells 3 to 5 each way
    }

    @Test
    fun `every orientation turns the same picture, in strips and of odd sizes, too`() {
        for ((width, height) in listOf(23 to 18, 14 to 21, 7 to 16000, 13001 to 9)) {
            val upright = numbers(standardiser.picture(PaintedPhoto.of(width, height, signal = PaintedPhoto::varied)))
            for (orientation in if (width * height < 1000) 2..8 else 6..7) {
                val origin = PaintedPhoto.origin(orientation = orientation)
                val photo = PaintedPhoto.of(width, height, origin = origin, signal = PaintedPhoto::varied)
                val picture = standardiser.picture(photo)
                val found = numbers(picture)
                assertEquals(width * height > 1 shl 16, found.strips > 1)
                assertEquals(if (orientation > 4) height else width, picture.width)
                assertArrayEquals(turned(upright.pixels, width, height, orientation), found.pixels)
                val layer = turned(upright.uncertainty, width / 2, height / 2, orientation)
                assertArrayEquals(layer, found.uncertainty)
            }
        }
    }

    /** By the definition of TIFF's tag 274: which corner of the upright picture the sensor's first row and column are. */
    private fun turned(pixels: IntArray, width: Int, height: Int, orientation: Int): IntArray {
        val (rows, columns) = if (orientation > 4) width to height else height to width
        return IntArray(pixels.size) {
            val (y, x) = it / 3 / columns to it / 3 % columns
            val (row, column) = when (orientation) {
                2 -> y to width - 1 - x
                3 -> height - 1 - y to width - 1 - x
                4 -> height - 1 - y to x
                5 -> x to y
                6 -> height - 1 - x to y
                7 -> height - 1 - x to rows - 1 - y
                8 -> x to rows - 1 - y
                else -> y to x
            }
            pixels[3 * (row * width + column) + it % 3]
        }
    }

    @Test
    fun `a mirrored scene under mirrored filters is the mirrored picture`() {
        val (width, height) = 22 to 16
        val known = numbers(standardiser.picture(PaintedPhoto.of(width, height, signal = PaintedPhoto::varied)))
        for ((cfa, orientation) in listOf("GRBG" to 2, "BGGR" to 3, "GBRG" to 4)) {
            val photo = PaintedPhoto.of(width, height, cfa) { x, y, channel ->
                val column = if (orientation == 4) x else width - 1 - x
                PaintedPhoto.varied(column, if (orientation == 2) y else height - 1 - y, channel)
            }
            val found = numbers(standardiser.picture(photo))
            assertArrayEquals(turned(known.pixels, width, height, orientation), found.pixels, cfa)
            assertArrayEquals(turned(known.uncertainty, width / 2, height / 2, orientation), found.uncertainty, cfa)
        }
    }

    @Test
    fun `another camera or unit is refused, another exposure is scaled`() {
        fun code(entry: () -> Any) = assertThrows(CalibrationException::class.java) { entry() }.code
        fun photo(origin: Mosaic.Origin) = PaintedPhoto.of(12, 10, origin = origin) { _, _, _ -> 0.2 }
        val tablet = photo(PaintedPhoto.origin(model = "tablet"))
        assertEquals("frames_differ", code { standardiser.picture(tablet) })
        assertEquals("frames_differ", code { StandardPicture.read(text, d55, PhotoSource.of(tablet)) })
        val twin = photo(PaintedPhoto.origin(camera = PhysicalCamera("0", "S-2")))
        assertEquals("unit_differs", code { standardiser.picture(twin) })
        assertEquals("frames_differ", code { standardiser.picture(photo(PaintedPhoto.origin(exposure = null))) })
        assertEquals("invalid_argument", code { standardiser.picture(card, lensShading = LensShading.APPLY) })
        val (one, longer) = listOf(0.01, 0.02).map { exposure ->
            val level = 0.2 * exposure / 0.01
            PaintedPhoto.of(12, 10, origin = PaintedPhoto.origin(exposure = exposure)) { _, _, _ -> level }
        }.map { numbers(standardiser.picture(it)) }
        for (i in one.pixels.indices) assertEquals(one.pixels[i].toDouble(), longer.pixels[i].toDouble(), 60.0)
    }

    @Test
    fun `without a reference the white balance is the calibration's, less surely`() {
        val photo = PaintedPhoto.of(12, 10) { _, _, _ -> 0.4 }
        val found = StandardPicture.read(text, d55, PhotoSource.of(photo))
        assertFalse(found.fromReference)
        assertNull(found.chiSquared)
        assertEquals(listOf("D55" to 1.0), found.lamps.map { it.name to it.weight })
        assertEquals(16000 - PaintedPhoto.BLACK, found.white[1], 1e-9) // green saturates first
        assertEquals(0.55, found.white[0] / found.white[1], 1e-9)
        val (own, known) = numbers(found) to numbers(standardiser.picture(photo))
        val deviation = { of: Numbers -> of.uncertainty.filterIndexed { i, _ -> i % 3 > 0 }.average() }
        assertTrue(deviation(own) > deviation(known), "${deviation(own)} ${deviation(known)}")
        val unnamed = assertThrows(InvalidArgument::class.java) {
            StandardPicture.read(text, Lamp.auto(), PhotoSource.of(photo))
        }
        assertEquals("The lamp is unknown, and nothing in the photo tells it.", unnamed.message)
        assertEquals("white-led", StandardPicture.read(text, Lamp.torch(), PhotoSource.of(photo)).lamps.single().name)
        val lost = assertThrows(InvalidArgument::class.java) {
            StandardPicture.read(GoldenResult.unnamed(), d55, PhotoSource.of(photo))
        }
        assertTrue("light of its first photo" in lost.message, lost.message)
    }

    @Test
    fun `with a dark photo the picture is that in the torch's light, and the noise that of both photos`() {
        fun photo(level: Double, exposure: Double = 0.01) =
            PaintedPhoto.of(40, 30, origin = PaintedPhoto.origin(exposure = exposure)) { x, y, _ ->
                level + 0.02 * ((7 * x + 13 * y + x * y) % 5 - 2) // noise, as far as a measurement knows
            }
        val (room, torch) = 0.3 to 0.4
        val area = listOf(Region(0, 0, 30, 28))
        val white = RawRegion.measure(photo(room + torch), area, photo(room)).single()
        val alone = RawRegion.measure(photo(torch), area).single()
        val (both, less) = white.signalToNoise!!.toDoubleArray() to alone.signalToNoise!!.toDoubleArray()
        assertTrue(both.indices.all { both[it] < less[it] })
        val lit = Standardiser.read(text, d55, Reference(white))
        val made = numbers(lit.picture(photo(room + 0.2), dark = photo(room)))
        val known = numbers(Standardiser.read(text, d55, Reference(alone)).picture(photo(0.2)))
        val middle = { of: Numbers -> of.pixels.sorted()[of.pixels.size / 2].toDouble() }
        assertEquals(middle(known), middle(made), 600.0)
        val deviation = { of: Numbers -> of.uncertainty.average() }
        assertTrue(deviation(made) > deviation(known))
        val other = assertThrows(CalibrationException::class.java) {
            lit.picture(photo(room + 0.2), dark = photo(room, exposure = 0.02))
        }
        assertEquals("frames_differ", other.code)
    }

    @Test
    fun `spaces have Python's names`() {
        assertEquals(PictureSpace.values().toList(), PictureSpace.values().map { PictureSpace.of(it.word) })
        val error = assertThrows(InvalidArgument::class.java) { PictureSpace.of("adobe") }
        assertEquals("There is no space 'adobe' for a picture.", error.message)
        assertEquals("Take one of srgb, display-p3, xyz-d65, xyz-d50.", error.advice)
    }

    @Test
    fun `a map that cannot be applied, and a part of a photo, are refused at once`() {
        val net = GainMap.Net(1, 1, 1.0, 1.0, 0.0, 0.0, 1, floatArrayOf(2f))
        fun photo(list: Int) = PaintedPhoto.of(
            12, 10, corrections = Mosaic.Corrections(listOf(GainMap(list, Region(0, 0, 12, 10), 0, 1, 1, 1, net))),
        ) { _, _, _ -> 0.2 }
        assertThrows(UnsupportedRaw::class.java) {
            StandardPicture.read(text, d55, PhotoSource.of(photo(1)), lensShading = LensShading.APPLY)
        }
        val (stored, applied) = LensShading.values().map {
            numbers(StandardPicture.read(text, d55, PhotoSource.of(photo(2)), PictureSpace.XYZ_D65, it)).pixels
        }
        for (i in stored.indices) assertEquals(2.0, applied[i].toDouble() / stored[i], 1e-3)
        val whole = photo(2)
        val part = Mosaic(
            whole.origin, 12, 10, Region(0, 0, 12, 8), whole.samples.copyOf(96), whole.sensor,
        )
        assertThrows(InvalidArgument::class.java) { standardiser.picture(part) }
        assertThrows(InvalidArgument::class.java) { standardiser.picture(PaintedPhoto.of(1, 9) { _, _, _ -> 0.1 }) }
    }

    @Test
    fun `an interrupted thread ends it`() {
        val picture = standardiser.picture(card)
        Thread.currentThread().interrupt()
        assertThrows(InterruptedException::class.java) { numbers(picture) }
        assertFalse(Thread.interrupted())
    }
}
