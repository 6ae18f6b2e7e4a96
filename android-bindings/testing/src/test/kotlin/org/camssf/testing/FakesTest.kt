package org.camssf.testing

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.CalibrationResult
import org.camssf.Channel
import org.camssf.InvalidArgument
import org.camssf.Refusal
import org.camssf.photo.MeasuredCapture
import org.camssf.verdict.Status
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File

/** As an app's tests would use them; ONNX Runtime is not on this class path. */
class FakesTest {
    private fun assumptions(of: CalibrationResult) = Json.parseToJsonElement(of.toJson())
        .jsonObject.getValue("assumptions").jsonArray.map { it.jsonObject.getValue("code").jsonPrimitive.content }

    @Test
    fun `an answer`() {
        val found = Fakes.recovered()
        assertEquals(Status.ACCEPTED, found.verdict.outcome)
        for (c in Channel.entries) {
            assertEquals(1.0, found.curve(c).max())
            assertTrue(found.band(c)!!.all { it == found.band(c)!![0] && it > 0 })
        }
        val (red, green, blue) = Channel.entries.map { c ->
            found.curve(c).let { curve -> (0 until curve.size).maxByOrNull { curve[it] }!! }
        }
        assertTrue(blue < green && green < red, "$blue $green $red")
        assertTrue(Fakes.FAKE in found.assumptions.map { it.code } && Fakes.FAKE in assumptions(found))
        assertEquals(682, found.toCsv().trim().lines().size)
        assertThrows(ClassNotFoundException::class.java) { Class.forName("ai.onnxruntime.OrtEnvironment") }
    }

    @Test
    fun `a doubtful one, and one of given curves`() {
        val curves = DoubleArray(3 * 681) { if (it % 3 == 2 && it > 1000) 0.0 else 1.0 + it / 3 }
        val found = Fakes.recovered(listOf("glare"), curves)
        assertEquals(
            Status.DOUBTFUL to listOf("glare"),
            found.verdict.outcome to found.verdict.reasons.map { it.code },
        )
        assertArrayEquals(DoubleArray(681) { (1.0 + it) / 681 }, found.curve(Channel.RED).toDoubleArray(), 1e-12)
        for (wrong in listOf(DoubleArray(5), DoubleArray(3 * 681))) {
            assertThrows(InvalidArgument::class.java) { Fakes.recovered(emptyList(), wrong) }
        }
    }

    @Test
    fun `a refusal`() {
        val error = Refusal.of("overexposed.region", "region" to 1, "share" to 0.4, value = 0.4, threshold = 0.02)
        val found = Fakes.refused(error)
        assertEquals(error, found.error)
        assertEquals(Status.REFUSED to "overexposed", found.verdict.outcome to found.verdict.reasons[0].code)
        assertTrue("\"refused\"" in found.toJson() && "40.0%" in found.toJson())
    }

    @Test
    fun `the sample is measured and saved without a model`() {
        val shot = SampleCapture.measured()
        assertEquals(24, shot.pose.patches.size)
        val text = MeasuredCapture.of(listOf(shot), SampleCapture.chart()).toJson()
        assertEquals(text, MeasuredCapture.fromJson(text).toJson())
        for (found in listOf(Fakes.recovered(), Fakes.recovered(listOf("glare")))) {
            assertEquals(text, MeasuredCapture.fromJson(found.toJson()).toJson())
        }
        val golden = File(System.getProperty("camssf.root"), "golden/dng/chart-turned-0.dng")
        assertArrayEquals(golden.readBytes(), SampleCapture.bytes())
    }
}
