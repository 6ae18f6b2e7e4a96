package org.camssf

import org.camssf.json.JsonText
import org.camssf.json.members
import org.camssf.json.text
import org.camssf.photo.Capture
import org.camssf.photo.Corners
import org.camssf.photo.PhotoSource
import org.camssf.photo.Shot
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File
import java.util.zip.GZIPInputStream

/** A result comes back from its text. That broken texts are refused is BrokenDocumentsTest's. */
class SavedResultTest {
    private val folder = File(System.getProperty("camssf.root"), "golden/dng")
    private val flat = Corners.of(19.44, 19.44, 160.56, 19.44, 160.56, 112.56, 19.44, 112.56)
    private val chart = ChartTable.read("classic24")

    private fun dng(name: String) = PhotoSource.of(File(folder, "$name.dng"))

    private fun again(result: CalibrationResult): CalibrationResult {
        val text = result.toJson()
        return SavedResult.read(text).also { assertEquals(text, it.toJson()) }
    }

    private fun check(result: Recovered) {
        val read = again(result) as Recovered
        for (channel in Channel.entries) {
            assertEquals(result.curve(channel), read.curve(channel))
            assertEquals(result.band(channel), read.band(channel))
        }
        assertEquals(result.halfWidth, read.halfWidth)
        assertEquals(result.verdict, read.verdict)
        assertEquals(result.assumptions, read.assumptions)
        assertEquals(result.signals.values, read.signals.values)
        assertEquals(result.signals.sharedUsed.asList(), read.signals.sharedUsed.asList())
        assertEquals(result.provenance.files, read.provenance.files)
        assertEquals("$result", "$read")
    }

    @Test
    fun `named and unnamed lamps, of every basis`() {
        for (basis in SsfCalibrator.BASES) {
            opened(basis).use { calibrator ->
                val shot = Shot(dng("chart-turned-0"), Lamp.read("E"), chartCorners)
                val named = calibrator.calibrateBlocking(Capture(shot, chart)) as Recovered
                check(named)
                if (basis != "phones") return@use
                val unnamed = Shot(dng("chart-turned-0"), chartCorners)
                val lit = calibrator.calibrateBlocking(Capture(unnamed, chart)) as Recovered
                check(lit)
                assertEquals(lit.lights[0]!!.power, (again(lit) as Recovered).lights[0]!!.power)
            }
        }
    }

    @Test
    fun `a refusal, with what was measured until then`() {
        val shaded = Shot(dng("patches-shaded"), Lamp.read("D55"), flat)
            .withWhite(dng("patches-white")).withDark(dng("patches-dark"))
        val elsewhere = Corners.of(2.0, 2.0, 30.0, 2.0, 30.0, 24.0, 2.0, 24.0)
        val lost = Shot(dng("no such file"), Lamp.read("A"), chartCorners)
        val absent = Shot(dng("chart-turned-0"), elsewhere)
        SsfCalibrator.openBlocking().use { calibrator ->
            for (shots in listOf(listOf(shaded), listOf(absent), listOf(lost), listOf(absent, lost))) {
                val refused = calibrator.calibrateBlocking(Capture(shots, chart)) as Refused
                val read = again(refused) as Refused
                assertEquals(refused.error.javaClass, read.error.javaClass)
                assertEquals("$refused", "$read")
                assertEquals("${refused.shots}", "${read.shots}")
            }
        }
    }

    /** The same content, however Python spells its numbers. */
    @Test
    fun `results that Python wrote`() {
        val file = File(folder.parentFile.parentFile, "tests/support/passports/python.json.gz")
        val texts = members(JsonText.parse(GZIPInputStream(file.inputStream()).reader().use { it.readText() }))
        for (name in listOf("result", "small")) {
            val (known, read) = listOf(texts.text(name), SavedResult.read(texts.text(name)).toJson())
                .map { members(JsonText.parse(it)) }
            // A simulation's truth is no part of a result here; the hash is that of the whole.
            for (key in known.keys + read.keys - setOf("truth", "sha256")) {
                assertEquals(JsonText.hash(known[key]), JsonText.hash(read[key]), "$name: $key")
            }
        }
    }

    @Test
    fun `a code that this version does not know, and a capture that was not solved`() {
        SsfCalibrator.openBlocking().use { calibrator ->
            val lost = Shot(dng("no such file"), Lamp.read("A"), chartCorners)
            val text = calibrator.calibrateBlocking(Capture(lost, chart)).toJson()
                .replace("\"unreadable_raw\"", "\"another\"")
                .replace(Regex(",\"sha256\":\"[0-9a-f]{64}\"\\}\n$"), "}")
            val error = assertThrows(InvalidArgument::class.java) { SavedResult.read(text) }
            assertTrue("no refusal with the code another" in error.message, error.message)
            assertThrows(InvalidArgument::class.java) {
                SavedResult.read(text.replace(Regex("\"reasons\":\\[.*?\\]"), "\"reasons\":[]"))
            }
        }
    }
}
