package org.camssf.colour

import org.camssf.InvalidArgument
import org.camssf.UnreadableRaw
import org.camssf.photo.Mosaic
import org.camssf.photo.PhotoSource
import org.camssf.photo.Region
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.TestInstance
import java.io.ByteArrayOutputStream
import java.io.File
import java.io.IOException
import java.util.concurrent.TimeUnit

/** Photos that are read in bands while their pictures are computed. */
@TestInstance(TestInstance.Lifecycle.PER_CLASS) // one table of colours, which takes seconds, for all tests
class PicturePartsTest {
    private val white = RawRegion.measure(PaintedPhoto.of(40, 30) { _, _, _ -> 1.0 }, listOf(Region(0, 0, 30, 28)))
    private val standardiser = Standardiser.read(GoldenResult.text, Lamp.read("D55"), Reference(white.single()))

    /** A photo that is nowhere as a whole, and what was read of it. */
    private class Drawn(val width: Int, val height: Int, val orientation: Int) : PhotoSource {
        val asked = ArrayList<Region>()

        override fun read(region: Region?): Mosaic = region!!.within(width, height).let { part ->
            asked += part
            val origin = PaintedPhoto.origin(orientation = orientation)
            val signal = { x: Int, y: Int, c: Int -> PaintedPhoto.varied(part.left + x, part.top + y, c) }
            // Bands begin at even rows and columns.
            val drawn = PaintedPhoto.of(part.width, part.height, signal = signal)
            Mosaic(origin, width, height, part, drawn.samples, drawn.sensor)
        }
    }

    @Test
    fun `each band is read once, and holds what its strips need`() {
        for (orientation in 1..8) {
            val source = Drawn(8191, 6001, orientation)
            val parts = PictureParts.of(source)
            source.asked.clear()
            val starts = (0 until parts.length step parts.step).toList()
            for (start in if (parts.backwards) starts.reversed() else starts) {
                val held = parts.around(start).region
                val (from, to) = if (parts.turned) held.left to held.right else held.top to held.bottom
                assertTrue(from <= maxOf(start - 4, 0) && to >= minOf(start + parts.step + 4, parts.length))
                assertTrue(held.width.toLong() * held.height <= (4L shl 20) + 8L * parts.across)
            }
            assertTrue(source.asked.size in 12..14, "${source.asked.size}")
            assertEquals(source.asked.size, source.asked.distinct().size)
        }
    }

    @Test
    fun `a picture of bands is that of the mosaic`() {
        val source = Drawn(11, 20001, 6)
        val whole = source.read(Region(0, 0, 11, 20001))
        val (one, other) = listOf(source, PhotoSource.of(whole)).map { photo ->
            ByteArrayOutputStream().also { out ->
                standardiser.picture(photo).writePng(out)
            }.toByteArray()
        }
        assertArrayEquals(other, one)
    }

    @Test
    fun `a source that fails or gives another part ends it`() {
        val source = Drawn(40, 30, 1)
        val broken = PhotoSource { if (it!!.width > 2) throw IOException("gone") else source.read(it) }
        val small = PhotoSource { source.read(Region(0, 0, 2, 2)) }
        fun write(photo: PhotoSource) = standardiser.picture(photo).writePng(ByteArrayOutputStream())
        assertThrows(UnreadableRaw::class.java) { write(broken) }
        assertThrows(InvalidArgument::class.java) { write(small) }
    }

    /** In a JVM of its own, whose limit is the test. */
    @Test
    fun `the first bands of 50 megapixels in a heap of 64 MB`() {
        val command = listOf(
            File(System.getProperty("java.home"), "bin/java").path, "-Xmx64m", "-XX:+UseSerialGC",
            "-Dcamssf.root=${System.getProperty("camssf.root")}",
            "-cp", System.getProperty("java.class.path"), LargePicture::class.java.name,
        )
        val process = ProcessBuilder(command).redirectErrorStream(true).start()
        try {
            val said = process.inputStream.bufferedReader().readText()
            assertTrue(process.waitFor(2, TimeUnit.MINUTES), "still running")
            assertEquals(0, process.exitValue(), said)
        } finally {
            process.destroyForcibly()
        }
    }

    internal object LargePicture {
        private class Enough : RuntimeException()

        /** With an argument the whole picture. */
        @JvmStatic
        fun main(arguments: Array<String>) {
            val started = System.nanoTime()
            val photo = Drawn(8192, 6144, 1)
            val picture = StandardPicture.read(GoldenResult.text, Lamp.read("D55"), photo)
            var rows = 0
            try {
                picture.strips { _, more, _, _ ->
                    rows += more
                    if (arguments.isEmpty() && photo.asked.size == 3) throw Enough() // the first was of 2 × 2 pixels
                }
            } catch (_: Enough) {
                println("$rows rows")
            }
            println("${(System.nanoTime() - started) / 1_000_000} ms")
            check(rows > 512)
        }
    }
}
