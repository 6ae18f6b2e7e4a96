package org.camssf

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.model.Models
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Photo
import org.camssf.photo.PhotoSource
import org.camssf.photo.Shot
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.camssf.verdict.Check
import org.camssf.verdict.UnitDrift
import org.junit.jupiter.api.AfterAll
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNotEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.TestInstance
import java.io.File

/** A previous result of the same unit: what it may be, and what it adds. Python's numbers: tests/kotlin/test_kotlin.py. */
@TestInstance(TestInstance.Lifecycle.PER_CLASS)
class PreviousResultTest {
    private val photo = File(System.getProperty("camssf.root"), "golden/dng/chart-turned-0.dng")
    private val chart = ChartTable.read("classic24")
    private val calibrator = SsfCalibrator.openBlocking()
    private val shot = calibrator.measureBlocking(Shot(PhotoSource.of(photo), Lamp.read("E"), chartCorners), chart)

    /** Accepted, whatever was thought of this flat lamp. */
    private val text = calibrator.solveBlocking(listOf(shot), chart).toJson().replace("\"doubtful\"", "\"accepted\"")
        .replace(Regex(",\"sha256\":\"[0-9a-f]{64}\"\\}\n$"), "}")

    @AfterAll
    fun close() = calibrator.close()

    private fun later(make: String = shot.photo.make, width: Int = shot.photo.width): MeasuredShot {
        val own = shot.photo
        val photo = Photo(
            own.name, width, own.height, own.orientation, own.exposure, own.iso, own.gainMap, make, own.model,
            "1".repeat(64),
        )
        return MeasuredShot(shot.lamp, photo, null, null, shot.pose, shot.means, shot.lensShading)
    }

    private fun solved(shot: MeasuredShot, text: String, lightPerPatch: Double? = null) = calibrator.solveBlocking(
        listOf(shot),
        chart,
        null,
        CalibrationOptions.Builder()
            .previous(SavedResult.read(text, "first.json")).lightPerPatch(lightPerPatch).build(),
    )

    @Test
    fun `its shots are solved together with new ones`() {
        val found = solved(later(), text) as Recovered
        assertEquals(listOf("1".repeat(64), shot.photo.sha256), found.capture.shots.map { it.photo.sha256 })
        assertTrue("previous_result" in found.assumptions.map { it.code })
        val document = Json.parseToJsonElement(found.toJson()).jsonObject
        val inputs = document.getValue("capture").jsonObject.getValue("files").jsonObject
        val sha256 = Models.sha256(text.toByteArray())
        assertEquals(sha256, inputs.getValue("previous result: first.json").jsonPrimitive.content)
        val checks = document.getValue("verdict").jsonObject.getValue("checks").jsonArray.map { it.jsonObject }
        assertTrue(checks.any { it.getValue("name").jsonPrimitive.content == "unit_drift" })
    }

    @Test
    fun `a table that it chose from its photo is that of the same chart`() {
        val chosen = text.replace("\"name\":\"classic24\"", "\"name\":\"classic24:ohta\"")
        assertNotEquals(text, chosen)
        solved(later(), chosen)
    }

    @Test
    fun `one photo in two roles is called that`() {
        val source = PhotoSource.of(photo)
        for ((white, dark) in listOf(source to null, null to source)) {
            val error = assertThrows(InvalidArgument::class.java) {
                calibrator.measureBlocking(Shot(source, Lamp.read("E"), chartCorners, white, dark), chart)
            }
            assertTrue("The chart's photo and the ${if (dark == null) "white" else "dark"} frame" in error.message)
        }
    }

    @Test
    fun `its signals are those that were measured`() {
        val found = solved(later(), text) as Recovered
        val (new, old) = List(2) { found.signals.sharedValues.copyOfRange(72 * it, 72 * it + 72) }
        for (i in new.indices) assertEquals(new[i], old[i], 1e-12)
    }

    @Test
    fun `what cannot be a previous result`() {
        val lamp = Regex("\"lamp\":\\{.*?\\}")
        for ((changed, words) in listOf(
            text.replace("\"accepted\"", "\"doubtful\"") to "was doubtful",
            text.replace(lamp, "\"lamp\":{\"kind\":\"unnamed\",\"name\":\"auto\"}") to "names no lamp",
            text.replace("\"classic24\"", "\"nano24\"") to "on the chart nano24",
            text.replace("\"width\":", "\"width\":0") to "first.json is not valid JSON",
            text.replace("\"greens\"", "\"green\"") to "capture.shots[0].means.chart has the unknown key",
            text.replace("camssf/2", "camssf-result/1") to
                "first.json: the document is camssf-result/1, not camssf/2",
            MeasuredCapture.of(listOf(shot), chart).toJson() to "first.json: the document lacks verdict",
        )) {
            assertNotEquals(text, changed)
            val error = assertThrows(InvalidArgument::class.java) { solved(later(), changed) }
            assertTrue(words in error.message, error.message)
        }
        val twice = assertThrows(InvalidArgument::class.java) { solved(shot, text) }
        assertTrue("already in the previous result" in twice.message, twice.message)
        assertThrows(InvalidArgument::class.java) {
            solved(later(), text, lightPerPatch = 0.1)
        }
        for (other in listOf(later(make = "Other"), later(width = 77))) {
            val error = (solved(other, text) as Refused).error
            assertTrue(error is UnitDiffers, error.message)
        }
    }

    @Test
    fun `the torch needs a photo with the torch off and no white frame`() {
        val source = PhotoSource.of(photo)
        for ((white, dark) in listOf(null to null, source to source)) {
            val error = assertThrows(InvalidArgument::class.java) {
                calibrator.measureBlocking(Shot(source, Lamp.torch(), chartCorners, white, dark), chart)
            }
            assertTrue("with the torch off" in error.message, error.message)
        }
    }

    @Test
    fun `what contradicts a previous result`() {
        fun check(name: String, value: Double) = Check(name, null, value, 1.0, null, "above")
        fun found(drift: Double?, fit: Double?, over: Double?, own: Double?) = UnitDrift.contradiction(
            listOfNotNull(
                drift?.let { check("unit_drift", it) },
                fit?.let { check("goodness_of_fit", it) },
                over?.let { check("misfit_refuses", it) },
            ),
            listOfNotNull(own?.let { check("goodness_of_fit", it) }),
        )?.let { it.code to it.value }
        assertEquals("unit_differs" to 1.01, found(1.01, 0.5, 4.0, null))
        assertEquals(null, found(1.0, 1.0, 4.0, null)) // neither is beyond its limit
        assertEquals("chart_unfit" to 1.01, found(1.0, 1.01, 4.0, null))
        assertEquals("chart_unfit" to 1.01, found(null, 1.01, 4.0, 1.0))
        assertEquals(null, found(null, 1.01, 4.0, 1.01)) // the new photos alone do not fit either
        assertEquals(null, found(null, 1.01, null, null))
        assertEquals(null, found(null, null, 4.0, null))
    }
}
