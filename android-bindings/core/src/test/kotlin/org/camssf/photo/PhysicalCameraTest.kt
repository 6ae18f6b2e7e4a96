package org.camssf.photo

import org.camssf.Refused
import org.camssf.UnitDiffers
import org.camssf.chartCorners
import org.camssf.opened
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.camssf.photo.dng.DngWriter
import org.camssf.photo.dng.Value
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertFalse
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File

/** Photos of two physical cameras or lenses are refused, as far as both sides say: Python's tests/calibration/test_unit.py. */
class PhysicalCameraTest {
    private val area = Region(0, 0, 4000, 3000)
    private val wide = wide()

    private fun wide(
        id: String = "0",
        serial: String = "S1",
        lens: String = "Phone wide 6.8 mm",
        focalLength: Double = 6.81,
        aperture: Double = 1.85,
        activeArea: Region = area,
    ) = PhysicalCamera(id, serial, lens, focalLength, aperture, activeArea)

    @Test
    fun `what differs is named`() {
        val cases = mapOf(
            wide(id = "2") to "camera '2' against '0'",
            wide(serial = "S2") to "another serial number",
            wide(lens = "Phone tele") to "lens 'Phone tele' against 'Phone wide 6.8 mm'",
            wide(focalLength = 19.0) to "focal length 19 mm against 6.81 mm",
            wide(aperture = 2.8) to "aperture f/2.8 against f/1.85",
            wide(activeArea = Region(8, 8, 4008, 3008)) to
                "active area 8, 8, 3008, 4008 against 0, 0, 3000, 4000",
        )
        for ((other, words) in cases) {
            val error = assertThrows(UnitDiffers::class.java) { PhysicalCamera.check("a.dng", wide, "b.dng", other) }
            assertEquals("b.dng was taken by another camera or lens than a.dng: $words.", error.message)
            assertTrue("one physical camera" in error.advice)
            PhysicalCamera.check("a.dng", PhysicalCamera(), "b.dng", other)
            PhysicalCamera.check("a.dng", other, "b.dng", PhysicalCamera())
        }
        PhysicalCamera.check("a.dng", wide, "b.dng", wide(focalLength = 6.8, aperture = 1.86))
    }

    @Test
    fun `a DNG says it`() {
        val exif = mapOf(
            33437 to Value.rational(185, 100), 37386 to Value.rational(681, 100),
            42033 to Value.text("S1"), 42036 to Value.text("Phone wide 6.8 mm"),
        )
        val bytes = DngWriter(20, 16, IntArray(320), exif = exif).encode()
        val said = DngReader.read(DngSource.of(bytes, "a.dng")).origin.camera
        assertEquals(PhysicalCamera("", "S1", "Phone wide 6.8 mm", 6.81, 1.85, Region(0, 0, 20, 16)), said)
        val silent = DngWriter(20, 16, IntArray(320), first = mapOf(50735 to Value.text("S2"))).encode()
        val other = DngReader.read(DngSource.of(silent, "b.dng")).origin.camera
        assertEquals(PhysicalCamera("", "S2", "", null, null, Region(0, 0, 20, 16)), other)
    }

    /** The cases of Python's tests/photo/test_unit_of_a_photo.py, and a day that a year lacks. */
    @Test
    fun `a DNG says when it was taken`() {
        fun said(time: String, offset: String? = null): String {
            val exif = listOfNotNull(36867 to Value.text(time), offset?.let { 36881 to Value.text(it) }).toMap()
            val bytes = DngWriter(20, 16, IntArray(320), exif = exif).encode()
            val photo = Photo.read(DngSource.of(bytes, "a.dng"))
            assertEquals(DngReader.read(DngSource.of(bytes, "a.dng")).origin.captured, photo.captured)
            return photo.captured
        }
        assertEquals("2026-11-20T09:15:00+01:00", said("2026:11:20 09:15:00", "+01:00"))
        assertEquals("2026-11-20T09:15:00", said("2026:11:20 09:15:00"))
        assertEquals("2026-11-20T09:15:00", said("2026:11:20 09:15:00", "   :  "))
        assertEquals("2024-02-29T23:59:59-11:30", said("2024:02:29 23:59:59", "-11:30"))
        val none = listOf(
            "0000:00:00 00:00:00", "    :  :     :  :  ", "2026:13:45 99:99:99", "2026:02:29 09:15:00", "2026:11:20",
        )
        for (time in none) assertEquals("", said(time), time)
        assertEquals("", said("2026:11:20 09:15:00", "+25:00"))
        val silent = DngSource.of(File(System.getProperty("camssf.root"), "golden/dng/metadata.dng")).use {
            Photo.read(it)
        }
        assertEquals(listOf("Acme", "Phone 7", ""), listOf(silent.make, silent.model, silent.captured))
    }

    @Test
    fun `shots and frames are held to it, and no result names a serial number`() {
        val file = File(System.getProperty("camssf.root"), "golden/dng/chart-turned-0.dng")
        val whole = DngSource.of(file).use { DngReader.read(it) }
        val chart = ChartTable.read("classic24")
        fun frame(name: String, camera: PhysicalCamera) = PhotoSource.of(
            Mosaic(
                Mosaic.Origin(name, whole.origin.make, whole.origin.model, sha256 = name, camera = camera),
                whole.width, whole.height, whole.region, whole.samples, whole.sensor, whole.corrections,
            ),
        )
        val one = Shot(frame("a", wide), Lamp.read("E"), chartCorners)
        val two = Shot(frame("b", wide(id = "2", serial = "S2")), Lamp.read("E"), chartCorners)
        opened("phones").use { calibrator ->
            val found = calibrator.calibrateBlocking(Capture(listOf(one, two), chart)) as Refused
            assertEquals("unit_differs", found.error.code)
            assertTrue(found.error.message.startsWith("b was taken by another camera or lens than a: camera '2'"))
            assertFalse("S2" in found.toJson())
            val framed = Shot(frame("a", wide), Lamp.read("E"), chartCorners, frame("w", wide(lens = "tele")))
            val error = assertThrows(UnitDiffers::class.java) { calibrator.measureBlocking(framed, chart) }
            val words = "The white frame w was taken by another camera or lens than the chart photo a"
            assertTrue(error.message.startsWith(words), error.message)
        }
    }
}
