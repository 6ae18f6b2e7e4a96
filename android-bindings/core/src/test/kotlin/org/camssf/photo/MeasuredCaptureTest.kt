package org.camssf.photo

import org.camssf.InvalidArgument
import org.camssf.Recovered
import org.camssf.UnitDiffers
import org.camssf.chartCorners
import org.camssf.opened
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File

/** Measured now, saved, read by another process and solved then. */
class MeasuredCaptureTest {
    private val root = File(System.getProperty("camssf.root"))
    private val chart = ChartTable.read("classic24")
    private val flat = Corners.of(19.44, 19.44, 160.56, 19.44, 160.56, 112.56, 19.44, 112.56)

    private fun dng(name: String) = PhotoSource.of(File(root, "golden/dng/$name.dng"))

    private val shots = listOf(
        Shot(
            dng("chart-turned-0"), Lamp.read("daylight"),
            chartCorners,
        ),
        Shot(
            dng("chart-turned-0"), Lamp.auto(),
            chartCorners,
        ),
        Shot(
            dng("patches-shaded"), Lamp.read("D55").withTolerance("300K"), flat,
            dng("patches-white"), dng("patches-dark"),
        ),
    )

    @Test
    fun `it comes back to the last bit, and is solved to the same result`() {
        opened("phones").use { calibrator ->
            for (shot in shots) {
                val measured = calibrator.measureBlocking(shot, chart)
                val text = MeasuredCapture.of(listOf(measured), chart).toJson()
                val again = MeasuredCapture.fromJson(text)
                assertEquals(text, again.toJson())
                val results = listOf(
                    calibrator.solveBlocking(listOf(measured), chart),
                    calibrator.solveBlocking(again.shots, again.chart),
                ).map { it.toJson() }
                assertEquals(results[0], results[1])
                assertEquals(text, MeasuredCapture.fromJson(results[0]).toJson())
                assertTrue(text.length < 150_000, "${text.length}")
            }
        }
    }

    private fun measured(serial: String, name: String = "a", sample: Int = 0): MeasuredShot {
        val whole = DngSource.of(File(root, "golden/dng/chart-turned-0.dng")).use { DngReader.read(it) }
        val camera = PhysicalCamera("0", serial, "wide", 6.81, 1.85, Region(0, 0, 180, 132))
        val (make, model) = whole.origin.make to whole.origin.model
        val origin =
            Mosaic.Origin(name, make, model, camera = camera, captured = TIME, uniqueModel = "A B")
        val samples = whole.samples.copyOf().also { it[0] = sample.toShort() }
        val mosaic = Mosaic(origin, whole.width, whole.height, whole.region, samples, whole.sensor)
        return opened("phones").use {
            it.measureBlocking(Shot(PhotoSource.of(mosaic), Lamp.read("D55"), shots[0].corners), chart)
        }
    }

    @Test
    fun `serial number and time are in it only where the app says so`() {
        val shot = measured("S1")
        val capture = MeasuredCapture.of(listOf(shot), chart)
        fun again(text: String) = MeasuredCapture.fromJson(text).shots[0].photo
        val whole = again(capture.toJson(identifying = true))
        assertEquals(listOf(shot.photo.camera, TIME, "A B"), listOf(whole.camera, whole.captured, whole.uniqueModel))
        val bare = again(capture.toJson())
        assertEquals(listOf("", "", "wide"), listOf(bare.camera.serial, bare.captured, bare.camera.lens))
        assertTrue("S1" !in capture.toJson() && TIME !in capture.toJson())
        assertEquals(shot.photo.camera.serialCheck, bare.camera.serialCheck)
        val result = opened("phones").use {
            it.solveBlocking(listOf(shot), chart)
        }
        assertTrue(result is Recovered && "S1" !in result.toJson() && TIME !in result.toJson())
    }

    @Test
    fun `shots of two units are told apart without their serial numbers`() {
        fun restored(shot: MeasuredShot) =
            MeasuredCapture.fromJson(MeasuredCapture.of(listOf(shot), chart).toJson()).shots[0]
        val first = restored(measured("S1"))
        val same = restored(measured("S1", "b", 1))
        assertEquals(2, MeasuredCapture.of(listOf(first, same), chart).shots.size)
        val other = restored(measured("S2", "c", 2))
        val error = assertThrows(UnitDiffers::class.java) { MeasuredCapture.of(listOf(first, other), chart) }
        assertTrue("another serial number" in error.message, error.message)
    }

    @Test
    fun `files of lamp and chart keep their hashes in their roles`() {
        val table = (380..730 step 10).joinToString("\n") { "$it,${it / 10}" }.toByteArray()
        val lamp = Lamp.parse("bulb.csv", table)
        val one = opened("phones").use { calibrator ->
            listOf(shots[0], shots[2]).map {
                calibrator.measureBlocking(Shot(it.photo, lamp, it.corners), chart)
            }
        }
        val texts = one.map { MeasuredCapture.of(listOf(it), chart).toJson() }
        val again = texts.map { MeasuredCapture.fromJson(it).shots[0] }
        assertEquals(listOf(lamp.file, lamp.file), again.map { it.lamp.file })
        assertTrue(texts.all { "\"files\":{\"shot 1, lamp: bulb.csv\":\"${lamp.file!!.sha256}\"}" in it })
        val both = PartialCapture(chart, again.map { it.lamp }, again).files
        assertEquals(setOf("shot 1, lamp: bulb.csv", "shot 2, lamp: bulb.csv"), both.keys)
    }

    @Test
    fun `what is no whole capture is refused`() {
        val refused = opened("phones").use { calibrator ->
            calibrator.calibrateBlocking(Capture(Shot(dng("bits-14"), Lamp.read("D55"), flat), chart))
        }
        assertEquals("refused", refused.verdict.outcome.word)
        val error = assertThrows(InvalidArgument::class.java) { MeasuredCapture.fromJson(refused.toJson(), "x.json") }
        assertEquals("The capture of x.json was refused before all its photos were measured.", error.message)
    }

    private companion object {
        const val TIME = "2026-11-20T09:15:00+01:00"
    }
}
