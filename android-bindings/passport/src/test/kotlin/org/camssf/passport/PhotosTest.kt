package org.camssf.passport

import org.camssf.InvalidArgument
import org.camssf.UnitDiffers
import org.camssf.photo.Photo
import org.camssf.photo.dng.DngSource
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Tag
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.assertThrows
import java.io.ByteArrayOutputStream
import java.io.File
import java.nio.ByteBuffer
import java.nio.ByteOrder
import kotlin.time.Instant

/** What the photos say of unit and time goes into the passport, as Python's `draw_up` takes it of their files. */
@Tag("R-PASSPORT")
class PhotosTest {
    private val now = Instant.parse("2026-11-22T03:00:00Z")
    private val photo = photo("a.dng", "2026:11:20 09:15:00")
    private val result = result(photo)
    private val whole = CameraUnit("Maker", "Model 1", "", "body 9", "Wide 24 mm", 24.7, 1.8)

    private fun CameraUnit.copy(
        serial: String = this.serial,
        lens: String = this.lens,
        focalLength: Double? = this.focalLength,
        aperture: Double? = this.aperture,
    ) = CameraUnit(make, model, cameraId, serial, lens, focalLength, aperture)

    /** [Fixtures.SMALL] of these photos. */
    @Suppress("UNCHECKED_CAST")
    private fun result(vararg of: Photo): ByteArray = Fixtures.changed { document ->
        val capture = Fixtures.part(document, "capture")
        val shot = (capture.getValue("shots") as List<*>).single() as Map<String, Any?>
        capture["shots"] = of.map { photo ->
            val noFrames = mapOf("white" to null, "dark" to null)
            val own = Fixtures.part(shot, "photo") - setOf("unit", "active_area") +
                mapOf("sha256" to photo.sha256, "make" to "Maker", "model" to "Model 1")
            shot + noFrames + mapOf("photo" to own, "means" to Fixtures.part(shot, "means") + noFrames)
        }
        val answer = Fixtures.part(document, "answer")
        for (name in listOf("used", "level", "predicted", "unseen", "predicted_std", "unseen_std", "lights")) {
            val rows = answer[name] as List<*>? ?: continue
            answer[name] = if (rows.isEmpty()) rows else of.map { rows[0] }
        }
    }.toByteArray()

    @Test
    fun `unit and time are the photo's`() {
        val found = Passport.create(result, PassportRequest(CameraUnit(cameraId = "2")), now, listOf(photo))
        assertEquals(CameraUnit("Maker", "Model 1", "2", "body 9", "Wide 24 mm", 24.7, 1.8), found.unit)
        assertEquals("2026-11-20T09:15:00+01:00", found.captured)
        val said = PassportRequest(captured = "2026-11-21T00:00")
        assertEquals("2026-11-21T00:00:00", Passport.create(result, said, now, listOf(photo)).captured)
        val alone = Passport.create(result, now = now)
        assertEquals(CameraUnit("Maker", "Model 1") to "", alone.unit to alone.captured)
        val claims = found.claims().toMap()
        assertEquals(
            """{"make":"Maker","model":"Model 1","camera_id":"2","serial":"body 9","lens":"Wide 24 mm",""" +
                """"focal_length":24.7,"aperture":1.8}""",
            claims.getValue("unit"),
        )
        assertEquals("\"2026-11-20T09:15:00+01:00\"", claims.getValue("captured"))
    }

    @Test
    fun `of several shots the first that knows the time tells it`() {
        val silent = photo("silent.dng", "0000:00:00 00:00:00")
        val later = photo("later.dng", "2026:11:20 09:20:00")
        val found = Passport.create(result(silent, later, photo), now = now, photos = listOf(silent, later, photo))
        assertEquals("2026-11-20T09:20:00+01:00" to whole, found.captured to found.unit)
    }

    @Test
    fun `what does not agree is refused, in Python's words`() {
        fun refused(said: PassportRequest, photos: List<Photo>): String =
            assertThrows<InvalidArgument> { Passport.create(result, said, now, photos) }.message
        val words = refused(PassportRequest(CameraUnit(serial = "x")), listOf(photo))
        assertEquals("a.dng names another camera: serial is 'body 9' there, not 'x'.", words)
        val sizes = refused(PassportRequest(CameraUnit(focalLength = 50.0)), listOf(photo))
        assertEquals("a.dng names another camera: focal_length is 24.7 there, not 50.0.", sizes)
        val other = photo("other.dng", "2026:11:20 09:16:00")
        assertEquals("The result was not made from other.dng.", refused(PassportRequest(), listOf(other)))
        assertTrue(
            "the result names another camera: model is 'Model 1'" in
                refused(PassportRequest(CameraUnit(model = "2")), emptyList()),
        )
    }

    @Test
    fun `a photo of another unit is refused, in Python's words`() {
        fun passport(unit: CameraUnit) = Passport.create(result, PassportRequest(unit), now)
        passport(whole.copy(focalLength = 50.0, aperture = 8.0)).checkPhoto(photo)
        passport(CameraUnit()).checkPhoto(photo)
        val others = listOf(whole.copy(serial = "x"), whole.copy(lens = "35 mm"))
        val words = others.map { assertThrows<UnitDiffers> { passport(it).checkPhoto(photo) }.message }
        val unit = "a.dng was taken by another unit than that of the passport"
        val expected = listOf("$unit: serial 'body 9' against 'x'.", "$unit: lens 'Wide 24 mm' against '35 mm'.")
        assertEquals(expected, words)
    }

    private companion object {
        private const val ASCII = 2
        private const val RATIONAL = 5
        private const val EXIF = 34665

        private fun tag(entry: ByteArray): Int =
            ByteBuffer.wrap(entry).order(ByteOrder.LITTLE_ENDIAN).short.toInt() and 0xffff

        /** A photo of the golden vectors, and what an Exif directory says of it. */
        fun photo(name: String, time: String): Photo {
            val bytes = File(System.getProperty("camssf.root"), "golden/dng/chart-small.dng").readBytes()
            val exif = listOf(
                33437 to ratio(18, 10), 36867 to text(time), 36881 to text("+01:00"), 37386 to ratio(247, 10),
                42033 to text("body 9"), 42036 to text("Wide 24 mm"),
            )
            return Photo.read(DngSource.of(with(bytes, exif), name))
        }

        private fun text(of: String) = Triple(ASCII, of.length + 1, of.toByteArray() + 0)

        private fun ratio(above: Int, below: Int) = Triple(RATIONAL, 1, little(8) { putInt(above).putInt(below) })

        private fun little(size: Int, write: ByteBuffer.() -> Unit): ByteArray =
            ByteBuffer.allocate(size).order(ByteOrder.LITTLE_ENDIAN).apply(write).array()

        /** A little-endian TIFF with that Exif directory: its first directory anew at the end, and what it names. */
        private fun with(file: ByteArray, exif: List<Pair<Int, Triple<Int, Int, ByteArray>>>): ByteArray {
            val old = ByteBuffer.wrap(file).order(ByteOrder.LITTLE_ENDIAN)
            val first = old.getInt(4)
            val count = old.getShort(first).toInt()
            val out = ByteArrayOutputStream().apply { write(file) }
            val places = exif.map { (_, value) -> place(out, value.third) }
            val directory = little(6 + 12 * exif.size) {
                putShort(exif.size.toShort())
                exif.forEachIndexed { i, (tag, value) ->
                    putShort(tag.toShort()).putShort(value.first.toShort()).putInt(value.second).putInt(places[i])
                }
                putInt(0)
            }
            val place = place(out, directory)
            val pointer = little(12) { putShort(EXIF.toShort()).putShort(4).putInt(1).putInt(place) }
            val own = List(count) { file.copyOfRange(first + 2 + 12 * it, first + 14 + 12 * it) }
            val entries = (own.filter { tag(it) != EXIF } + pointer).sortedBy { tag(it) }
            val anew = little(6 + 12 * entries.size) {
                putShort(entries.size.toShort())
                entries.forEach { put(it) }
                putInt(0)
            }
            val at = place(out, anew)
            return out.toByteArray().also { ByteBuffer.wrap(it).order(ByteOrder.LITTLE_ENDIAN).putInt(4, at) }
        }

        /** Appends at an even place, which it gives; what is four bytes or less would stand in its entry. */
        private fun place(out: ByteArrayOutputStream, data: ByteArray): Int {
            if (out.size() % 2 == 1) out.write(0)
            return out.size().also { out.write(data) }
        }
    }
}
