package org.camssf.colour

import org.camssf.CalibrationException
import org.camssf.InvalidArgument
import org.camssf.Recovered
import org.camssf.SsfCalibrator
import org.camssf.photo.Capture
import org.camssf.photo.Corners
import org.camssf.photo.LensShading
import org.camssf.photo.Mosaic
import org.camssf.photo.PhotoSource
import org.camssf.photo.PhysicalCamera
import org.camssf.photo.Region
import org.camssf.photo.Shot
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Tag
import org.junit.jupiter.api.Test
import java.io.File

/** Raw signals keep their photo: another camera is refused, another exposure scaled or refused, at every entry. */
@Tag("R-COLOUR")
class SignalSourceTest {
    private val root = File(System.getProperty("camssf.root"))
    private val text = GoldenResult.text
    private val d55 = Lamp.read("D55")
    private val area = Region(0, 0, 30, 28)
    private val black = 64.0

    /** An even surface; `level` is its signal in parts of white, at 10 ms and ISO 100. */
    private fun photo(
        level: Double,
        name: String = "strip.dng",
        make: String = "golden",
        model: String = "phone",
        exposure: Double? = 0.01,
        iso: Double? = 100.0,
        camera: PhysicalCamera = PhysicalCamera("0", "S-1", "wide", 6.8, 1.8),
        white: Double = 16000.0,
    ): Mosaic {
        val scale = (exposure ?: 0.01) * (iso ?: 100.0)
        val samples = ShortArray(40 * 30) {
            val c = it / 40 % 2 + it % 40 % 2
            (black + 8000 * level * scale * doubleArrayOf(0.55, 1.0, 0.7)[c]).toInt().toShort()
        }
        val origin = Mosaic.Origin(name, make, model, exposure, iso, camera = camera)
        val sensor = Mosaic.Sensor("RGGB", DoubleArray(4) { black }, white)
        return Mosaic(origin, 40, 30, Region(0, 0, 40, 30), samples, sensor)
    }

    private fun region(photo: Mosaic) = RawRegion.measure(photo, listOf(area)).single()

    private val white = photo(1.0, "white.dng")
    private val reference = Reference(region(white))
    private val standardiser = Standardiser.read(text, d55, reference)
    private val estimator = SpectrumEstimator.read(text, listOf(PhotoLight(d55, reference)))
    private val pixels = RawPixels.of(area, 4)

    /** Every public entry that takes a photo's signals. */
    private fun entries(photo: Mosaic): Map<String, () -> Any> = mapOf(
        "colourOf" to { standardiser.colourOf(region(photo)) },
        "spectrumOf" to { estimator.spectrumOf(region(photo)) },
        "standardise" to { standardiser.standardise(photo, pixels) },
    )

    private fun refused(photo: Mosaic): Set<String> = entries(photo).map { (name, entry) ->
        assertThrows(CalibrationException::class.java, { entry() }, name).also {
            assertTrue("strip.dng" in it.message, it.message)
        }.code
    }.toSet()

    @Test
    fun `another camera is refused`() {
        assertEquals(setOf("frames_differ"), refused(photo(0.5, model = "tablet")))
        assertEquals(setOf("frames_differ"), refused(photo(0.5, make = "silver")))
        assertEquals(setOf("frames_differ"), refused(photo(0.3, white = 4000.0)))
        assertEquals(setOf("unit_differs"), refused(photo(0.5, camera = PhysicalCamera("2"))))
        assertEquals(setOf("unit_differs"), refused(photo(0.5, camera = PhysicalCamera(serial = "S-2"))))
        assertEquals(setOf("unit_differs"), refused(photo(0.5, camera = PhysicalCamera(lens = "tele"))))
        assertEquals(setOf("unit_differs"), refused(photo(0.5, camera = PhysicalCamera(aperture = 2.8))))
    }

    @Test
    fun `a reference in a photo of another camera than the result's is refused`() {
        val other = Reference(region(photo(1.0, "white.dng", model = "tablet")))
        for (entry in listOf(
            { Standardiser.read(text, d55, other) },
            { SpectrumEstimator.read(text, listOf(PhotoLight(d55, other))) },
            { SpectrumEstimator.read(text, listOf(PhotoLight(d55, reference), PhotoLight(Lamp.read("A"), other))) },
        )) {
            val error = assertThrows(CalibrationException::class.java) { entry() }
            assertEquals("frames_differ", error.code)
            assertEquals("white.dng was taken by golden tablet, the result is of golden phone.", error.message)
        }
        val twin = Reference(region(photo(1.0, "other.dng", camera = PhysicalCamera(serial = "S-2"))))
        val error = assertThrows(CalibrationException::class.java) {
            SpectrumEstimator.read(text, listOf(PhotoLight(d55, reference), PhotoLight(Lamp.read("A"), twin)))
        }
        assertEquals("unit_differs", error.code)
    }

    @Test
    fun `another exposure is scaled, and refused where the photos do not state it`() {
        val whole = photo(0.3)
        val others = listOf(0.005 to 100.0, 0.01 to 50.0, 0.02 to 25.0).map { (s, iso) ->
            photo(0.3, exposure = s, iso = iso)
        }
        for (other in others) {
            val (known, found) = listOf(whole, other).map { standardiser.colourOf(region(it)) }
            assertArrayEquals(known.lab.values, found.lab.values, 0.05) // samples are whole numbers
            val spectra = listOf(whole, other).map { estimator.spectrumOf(region(it)).reflectance.values }
            assertArrayEquals(spectra[0], spectra[1], 1e-3)
            val preview = listOf(whole, other).map { standardiser.standardise(it, pixels, space = Space.XYZ) }
            assertArrayEquals(preview[0], preview[1], 1e-3f)
        }
        for (silent in listOf(photo(0.3, exposure = null), photo(0.3, iso = null))) {
            assertEquals(setOf("frames_differ"), refused(silent))
        }
        val mute = photo(1.0, exposure = null, iso = null)
        val own = Standardiser.read(text, d55, Reference(region(mute)))
        assertEquals(100.0, own.colourOf(region(mute)).lab[0], 0.5) // one photo has one exposure
    }

    @Test
    fun `a shading that was treated in two ways is refused`() {
        val (stored, applied) = LensShading.values().map { SignalSource(white.facts, it) }
        val error = assertThrows(InvalidArgument::class.java) { stored.factor(applied) }
        assertTrue("lens shading" in error.message, error.message)
    }

    @Test
    fun `on the device that calibrated it another unit is refused`() {
        val file = File(root, "golden/dng/chart-turned-0.dng")
        val corners = Corners.of(22.44, 17.44, 156.56, 22.44, 162.56, 116.56, 16.44, 109.56)
        val mosaic = DngSource.of(file).use { DngReader.read(it) }
        fun of(serial: String): Mosaic = mosaic.origin.let {
            val origin = Mosaic.Origin(
                "$serial.dng", it.make, it.model, it.exposure, it.iso, camera = PhysicalCamera("0", serial),
            )
            Mosaic(origin, mosaic.width, mosaic.height, mosaic.region, mosaic.samples, mosaic.sensor)
        }
        val shot = Shot(PhotoSource.of(of("S-1")), d55, corners)
        val found = SsfCalibrator.Builder().basis("phones").openBlocking().use {
            it.calibrateBlocking(Capture(shot, ChartTable.read("classic24"))) as Recovered
        }
        val light = Region(28, 22, 40, 34)
        fun white(serial: String) = Reference(RawRegion.measure(of(serial), listOf(light)).single())
        for (entry in listOf<(Reference) -> Any>(
            { Standardiser.of(found, null, it) },
            { SpectrumEstimator.of(found, listOf(PhotoLight(null, it))) },
        )) {
            val error = assertThrows(CalibrationException::class.java) { entry(white("S-2")) }
            assertEquals("unit_differs", error.code)
            entry(white("S-1"))
        }
    }
}
