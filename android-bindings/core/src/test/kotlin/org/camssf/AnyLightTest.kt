package org.camssf

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.double
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.photo.Capture
import org.camssf.photo.MeasuredShot
import org.camssf.photo.PhotoSource
import org.camssf.photo.Shot
import org.camssf.recovery.LampPosterior
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File
import java.util.concurrent.CancellationException
import kotlin.math.abs

/** A golden photo in an unnamed light; its numbers are held to Python's by the golden stage `light`. */
class AnyLightTest {
    private val root = File(System.getProperty("camssf.root"))
    private val photo = PhotoSource.of(File(root, "golden/dng/chart-turned-0.dng"))
    private val chart = ChartTable.read("classic24")
    private val capture = Capture(Shot(photo, chartCorners), chart)

    @Test
    fun `the light is in the answer and in the document`() = opened("phones").use { calibrator ->
        assertTrue(capture.shots[0].lamp.unnamed)
        var solving = 0
        val counting = CalibrationOptions.Builder().progress { if (it.stage == Stage.SOLVING) solving++ }.build()
        val found = calibrator.calibrateBlocking(capture, counting) as Recovered
        // One before all; then the evidence of all kinds, the answers, their bands and their lights, a call each.
        assertEquals(5, solving)
        val light = found.lights.single()!!
        assertEquals(listOf("daylight", "bulb", "white-led", "fluorescent"), light.kinds.keys.toList())
        assertEquals(1.0, light.kinds.values.sum(), 1e-12)
        assertEquals(1.0, light.sharedPower.average(), 1e-12)
        assertTrue(light.sharedStd.all { it > 0 } && light.kelvinStd > 0)
        val document = Json.parseToJsonElement(found.toJson()).jsonObject
        val shot = document.getValue("capture").jsonObject.getValue("shots").jsonArray.single().jsonObject
        assertEquals("""{"kind":"unnamed","name":"auto"}""", shot.getValue("lamp").toString())
        val answer = document.getValue("answer").jsonObject
        val written = answer.getValue("lights").jsonArray.single().jsonObject
        assertEquals(light.kelvin, written.getValue("kelvin").jsonPrimitive.double)
        val power = written.getValue("power").jsonArray.map { it.jsonPrimitive.double }
        assertArrayEquals(light.sharedPower, power.toDoubleArray())
        val kinds = answer.getValue("choice").jsonArray.map {
            it.jsonObject.getValue("kinds").jsonArray.single().jsonPrimitive.content
        }
        assertEquals(light.kinds.keys, kinds.map { Lamp.kindOf(it) }.toSet())
        val said = found.assumptions.single { it.code == "lamp" }.message
        assertTrue(said.startsWith("the light was not named"), said)
    }

    @Test
    fun `a named lamp is told as ever`() = opened("phones").use { calibrator ->
        val named = Capture(Shot(photo, Lamp.read("E"), chartCorners), chart)
        val found = calibrator.calibrateBlocking(named) as Recovered
        assertEquals(emptyList<Any?>(), found.lights + found.basis.hypotheses)
        assertNull(Json.parseToJsonElement(found.toJson()).jsonObject.getValue("answer").jsonObject["lights"])
    }

    @Test
    fun `a camera that may be no phone is refused with what to name`() = opened("auto").use { calibrator ->
        val found = calibrator.calibrateBlocking(capture) as Refused
        assertEquals("lamp_unfit", found.error.code)
        assertTrue("spectrum was not given" in found.error.message, found.error.message)
        assertTrue("daylight, bulb, white-led, fluorescent" in found.error.advice, found.error.advice)
        assertTrue("\"name\":\"auto\"" in found.toJson())
    }

    @Test
    fun `too many lights, and a basis that weighs nothing, are a wrong call`() {
        opened("phones").use { calibrator ->
            val one = calibrator.measureBlocking(capture.shots[0], chart)
            fun other(name: String): MeasuredShot {
                val from = one.photo
                val photo = org.camssf.photo.Photo(
                    name, from.width, from.height, 1, null, null, false, from.make, from.model, name,
                )
                return MeasuredShot(Lamp.auto(), photo, null, null, one.pose, one.means, one.lensShading)
            }
            val four = listOf(one, other("b"), other("c"), other("d"))
            val error = assertThrows(InvalidArgument::class.java) { calibrator.solveBlocking(four, chart) }
            assertTrue("4 shots was not named; at most 3" in error.message, error.message)
        }
        opened("gaussian").use { calibrator ->
            val error = assertThrows(InvalidArgument::class.java) { calibrator.calibrateBlocking(capture) }
            assertTrue("light cannot be estimated" in error.message, error.message)
        }
    }

    @Test
    fun `a step between two hypotheses ends it`() = opened("phones").use { calibrator ->
        var solving = 0
        val ending = CalibrationOptions.Builder()
            .progress {
                if (it.stage == Stage.SOLVING &&
                    ++solving == 3
                ) {
                    throw CancellationException("enough")
                }
            }.build()
        assertThrows(CancellationException::class.java) { calibrator.calibrateBlocking(capture, ending) }
        assertEquals(3, solving)
    }

    @Test
    fun `the colour temperature is McCamy's, and its slope that of differences`() {
        for ((name, kelvin) in listOf("A" to 2856.0, "D50" to 5003.0, "D65" to 6504.0)) {
            val power = Lamp.read(name).sharedValues
            val (found, slope) = LampPosterior.temperature(power)
            assertEquals(kelvin, found, 0.005 * kelvin, name)
            for (at in listOf(50, 200, 340, 500)) {
                fun moved(by: Double) =
                    LampPosterior.temperature(power.copyOf().also { it[at] += by }).first
                val rise = (moved(1e-2) - moved(-1e-2)) / 2e-2
                assertTrue(abs(rise - slope[at]) <= 1e-5 * abs(rise) + 1e-7, "$name: $rise, ${slope[at]}")
            }
        }
    }
}
