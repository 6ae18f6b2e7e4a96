package org.camssf.colour

import org.camssf.Camssf
import org.camssf.InvalidArgument
import org.camssf.photo.PhotoSource
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNotNull
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.TestInstance
import org.w3c.dom.Element
import java.awt.color.ICC_Profile
import java.io.ByteArrayInputStream
import java.io.ByteArrayOutputStream
import java.util.zip.InflaterInputStream
import javax.imageio.ImageIO
import javax.imageio.metadata.IIOMetadataNode

/** PNG files of pictures, as another reader sees them. */
@TestInstance(TestInstance.Lifecycle.PER_CLASS) // the pictures, whose tables take seconds, serve all tests
class PicturePngTest {
    private val text = GoldenResult.text

    /** More than one chunk of pixels, and odd sizes. */
    private val photo = PaintedPhoto.of(151, 203) { x, y, channel ->
        if (x < 20 && y < 20) 5.0 else PaintedPhoto.varied(x, y, channel)
    }

    private val pictures = PictureSpace.values().associateWith {
        StandardPicture.read(text, Lamp.read("D55"), PhotoSource.of(photo), it)
    }

    /** What ImageIO reads: numbers row by row, bits, and the file's own description. */
    private class Read(val numbers: IntArray, val bits: Int, val metadata: Element) {
        fun chunk(name: String): IIOMetadataNode? =
            metadata.getElementsByTagName(name).let { if (it.length == 0) null else it.item(0) as IIOMetadataNode }

        val texts: Map<String, String>
            get() = metadata.getElementsByTagName("iTXtEntry").let { all ->
                (0 until all.length).map { all.item(it) as Element }
                    .associate { it.getAttribute("keyword") to it.getAttribute("text") }
            }
    }

    private fun read(png: ByteArray): Read {
        val reader = ImageIO.getImageReadersByFormatName("png").next()
        ImageIO.createImageInputStream(ByteArrayInputStream(png)).use { input ->
            reader.input = input
            val raster = reader.read(0).raster
            val numbers = raster.getPixels(0, 0, raster.width, raster.height, null as IntArray?)
            val metadata = reader.getImageMetadata(0).let { it.getAsTree(it.nativeMetadataFormatName) as Element }
            return Read(numbers, raster.sampleModel.getSampleSize(0), metadata)
        }
    }

    @Test
    fun `another reader finds the numbers, the profile and the texts`() {
        val words = "Colour for the record; 5 µm"
        for ((space, made) in pictures) {
            val pixels = ArrayList<Int>()
            val layer = ArrayList<Int>()
            made.strips { _, _, numbers, deviations ->
                numbers.mapTo(pixels) { it.toInt() and 0xffff }
                deviations.mapTo(layer) { it.toInt() and 0xffff }
            }
            val (first, second) = ByteArrayOutputStream() to ByteArrayOutputStream()
            val shares = made.writePng(first, second, description = words)
            val (colour, uncertainty) = listOf(first, second).map { read(it.toByteArray()) }
            assertEquals(16, colour.bits)
            assertArrayEquals(pixels.toIntArray(), colour.numbers)
            assertArrayEquals(layer.toIntArray(), uncertainty.numbers)
            assertEquals(words, colour.texts["Description"])
            assertEquals("camssf ${Camssf.VERSION}", colour.texts["Software"])
            assertTrue(uncertainty.texts.getValue("Description").startsWith("Standard deviation of L*, a*, b* "))
            assertNull(uncertainty.chunk("iCCP"))
            val cells = layer.chunked(3)
            fun share(mark: Int) = cells.count { cell -> cell.all { it == mark } } / cells.size.toDouble()
            assertEquals(share(StandardPicture.CLIPPED), shares.clipped, 1e-12)
            assertEquals(share(StandardPicture.OUT_OF_REACH), shares.outOfReach, 1e-12)
            assertTrue(shares.clipped > 0.01)
            val profile = colour.chunk("iCCP")
            if (!space.curved) {
                assertNull(profile)
            } else {
                assertNotNull(profile)
                val content = InflaterInputStream((profile!!.userObject as ByteArray).inputStream()).readBytes()
                assertEquals(ICC_Profile.CLASS_DISPLAY, ICC_Profile.getInstance(content).profileClass)
                assertArrayEquals(space.profile, content)
            }
        }
    }

    @Test
    fun `8 bits are the nearest ones, for a display`() {
        val made = pictures.getValue(PictureSpace.DISPLAY_P3)
        val (fine, coarse) = listOf(16, 8).map { bits ->
            read(ByteArrayOutputStream().also { made.writePng(it, bits = bits) }.toByteArray())
        }
        assertEquals(8, coarse.bits)
        assertArrayEquals(IntArray(fine.numbers.size) { Math.rint(fine.numbers[it] / 257.0).toInt() }, coarse.numbers)
        assertTrue("Description" !in coarse.texts)
        for ((space, bits) in listOf(PictureSpace.XYZ_D50 to 8, PictureSpace.SRGB to 12)) {
            val out = ByteArrayOutputStream()
            val made = pictures.getValue(space)
            val error = assertThrows(InvalidArgument::class.java) { made.writePng(out, bits = bits) }
            assertEquals("A picture of $bits bits in ${space.word} cannot be written as .png.", error.message)
            assertEquals("Take 16 bits; 8 are for PNG in srgb or display-p3.", error.advice)
            assertEquals(0, out.size())
        }
    }
}
