package org.camssf.photo

import org.camssf.InvalidArgument
import org.camssf.SsfCalibrator
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File
import java.security.MessageDigest

/** Measured now, saved, read by another process and solved then. */
class SavedShotTest {
    private val root = File(System.getProperty("camssf.root"))
    private val chart = ChartTable.read("classic24")
    private val flat = Corners.of(19.44, 19.44, 160.56, 19.44, 160.56, 112.56, 19.44, 112.56)

    private fun dng(name: String) = PhotoSource.of(File(root, "golden/dng/$name.dng"))

    private val shots = listOf(
        Shot(
            dng("chart-turned-0"), Lamp.read("daylight"),
            Corners.of(22.44, 17.44, 156.56, 22.44, 162.56, 116.56, 16.44, 109.56),
        ),
        Shot(
            dng("chart-turned-0"), Lamp.auto(),
            Corners.of(22.44, 17.44, 156.56, 22.44, 162.56, 116.56, 16.44, 109.56),
        ),
        Shot(
            dng("patches-shaded"), Lamp.read("D55").withTolerance("300K"), flat,
            dng("patches-white"), dng("patches-dark"),
        ),
    )

    private fun signed(content: String): String {
        val digest = MessageDigest.getInstance("SHA-256").digest(content.toByteArray())
        return "camssf-shot/1 ${digest.joinToString("") { "%02x".format(it) }}\n$content\n"
    }

    @Test
    fun `it comes back to the last bit, and is solved to the same result`() {
        SsfCalibrator.open("phones").use { calibrator ->
            for (shot in shots) {
                val measured = calibrator.measure(shot, chart)
                val text = measured.toText()
                val again = MeasuredShot.fromText(text)
                assertEquals(text, again.toText())
                val results = listOf(measured, again).map { calibrator.solve(listOf(it), chart).toJson() }
                assertEquals(results[0], results[1])
                assertTrue(text.length < 200_000, "${text.length}")
            }
        }
    }

    @Test
    fun `unit and time come back`() {
        val file = File(root, "golden/dng/chart-turned-0.dng")
        val whole = DngSource.of(file).use { DngReader.read(it) }
        val camera = PhysicalCamera("0", "S1", "wide", 6.81, 1.85)
        val time = "2026-11-20T09:15:00+01:00"
        val (make, model) = whole.origin.make to whole.origin.model
        val origin = Mosaic.Origin("a", make, model, camera = camera, captured = time, uniqueModel = "A B")
        val mosaic = Mosaic(origin, whole.width, whole.height, whole.region, whole.samples, whole.sensor)
        val measured = SsfCalibrator.open("phones").use {
            it.measure(Shot(PhotoSource.of(mosaic), Lamp.read("D55"), shots[0].corners), chart)
        }
        val text = measured.toText()
        val again = MeasuredShot.fromText(text).photo
        assertEquals(listOf(camera, time, "A B"), listOf(again.camera, again.captured, again.uniqueModel))
    }

    @Test
    fun `damage, another format and a later version are told apart`() {
        val text = SsfCalibrator.open("phones").use { it.measure(shots[0], chart).toText() }
        fun error(of: String) = assertThrows(InvalidArgument::class.java) { MeasuredShot.fromText(of) }
        for (broken in listOf(text.dropLast(100), text.replaceFirst("0.", "1."), text.substringBefore('\n'))) {
            assertTrue("damaged" in error(broken).message && "again" in error(broken).advice)
        }
        assertTrue("no saved shot" in error("").message && "no saved shot" in error("{}").message)
        val later = text.replaceFirst("camssf-shot/1", "camssf-shot/2")
        assertEquals("The saved shot is of version 2, this camssf reads 1.", error(later).message)
        val content = text.substringAfter('\n').trimEnd()
        assertEquals(text, signed(content))
        val wrong = listOf(
            "[]", "{}", "nonsense", content.replace("\"mean\":[", "\"mean\":[1,"),
            content.replace("\"tolerance\":", "\"tolerances\":"),
            content.replace("\"saturation\":", "\"saturation\":1e999,\"x\":"),
            content.replace("\"lens_shading\":\"as-stored\"", "\"lens_shading\":\"other\""),
            content.replaceFirst(Regex(",\"captured\":\"[^\"]*\""), ""),
        )
        for (each in wrong) {
            assertTrue(each != content)
            error(signed(each))
        }
    }
}
