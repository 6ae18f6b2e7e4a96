package org.camssf

import org.camssf.model.Models
import org.camssf.photo.Agreement
import org.camssf.recovery.Choice
import org.camssf.spectra.Lamp
import org.camssf.verdict.Light
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test

/** rules.json: read strictly. */
class RulesTest {
    private val text = Models.read("rules.json").decodeToString()

    private fun refused(changed: String): String {
        assertTrue(changed != text)
        val error = assertThrows(InvalidArgument::class.java) { Rules.parse(changed) }
        assertTrue("camssf-model" in error.advice)
        return error.message
    }

    @Test
    fun `numbers, rivals and reasons are those of the file`() {
        val rules = Rules.parse(text)
        assertEquals(3.5, rules.number("verdict.goodness_of_fit"))
        assertEquals(12, rules.whole("verdict.few_patches"))
        assertEquals(1.0 / 3.0, rules.number("covariance.absolute"))
        assertEquals("glare.veil", rules.ground("veil").message)
        assertEquals(listOf("explanation", "misfit_refuses"), rules.ground("veil").limits)
    }

    @Test
    fun `what a preview's first frame needs is the file's`() {
        assertEquals(Rules.shipped.number("pose.chroma"), Agreement.CHROMA)
        assertEquals(Rules.shipped.number("pose.darkest"), Agreement.DARKEST)
    }

    @Test
    fun `every rival is a lamp`() {
        for (name in Light.RIVALS) assertTrue(Lamp.read(name).sharedValues.max() > 0, name)
        assertEquals(18, Light.RIVALS.toSet().size)
    }

    @Test
    fun `makers speak for the bases that are weighed`() {
        assertEquals(Choice.MAKERS_OF.values.toSet(), Rules.shipped.makers.keys)
        assertEquals(Choice.FAMILIES, Choice.MAKERS_OF.keys.toList())
        val all = Rules.shipped.makers.values.flatten()
        assertTrue("google" in Rules.shipped.makers.getValue("phones") && all.all { it == it.lowercase() })
        assertEquals(all.size, all.toSet().size)
    }

    @Test
    fun `a bound knows on which side it breaks, and which one refuses`() {
        val veil = Rules.shipped.bound("verdict.veil")!!
        assertEquals(listOf(false, "above", "veil_refuses"), listOf(veil.refused, veil.beyond, veil.graver))
        val misfit = Rules.shipped.bound("verdict.misfit_refuses")!!
        assertEquals(listOf(true, "above", null), listOf(misfit.refused, misfit.beyond, misfit.graver))
        assertEquals("below", Rules.shipped.bound("verdict.smooth")!!.beyond)
        assertEquals(null, Rules.shipped.bound("verdict.share"))
    }

    @Test
    fun `a damaged file is refused`() {
        assertTrue("no JSON" in refused(text.dropLast(5)))
        assertTrue("camssf-rules/2" in refused(text.replace("camssf-rules/1", "camssf-rules/2")))
        assertTrue("verdict.goodness_of_fit" in refused(text.replace("\"value\": 3.5", "\"value\": \"3.5\"")))
        assertTrue("verdict.goodness_of_fit" in refused(text.replace("\"value\": 3.5", "\"value\": 0.0")))
        assertTrue("valu" in refused(text.replaceFirst("\"value\": 3.5", "\"valu\": 3.5")))
        assertTrue("glare.mist" in refused(text.replace("glare.veil", "glare.mist")))
        assertTrue(
            "limits" in refused(text.replaceFirst("[\"explanation\", \"misfit_refuses\"]", "[\"explanations\"]")),
        )
        assertTrue("verdict.mist" in refused(text.replace("\"refuses\": \"veil_refuses\"", "\"refuses\": \"mist\"")))
        assertTrue(
            "verdict.rough" in refused(text.replace("\"refuses\": \"veil_refuses\"", "\"refuses\": \"rough\"")),
        )
        assertTrue(
            "verdict.veil" in
                refused(text.replaceFirst("\"beyond\": \"above\", \"refuses\": \"veil_refuses\", ", "")),
        )
        assertTrue("rivals" in refused(text.replace(Regex("\"rivals\": \\[[^]]*]"), "\"rivals\": []")))
        assertTrue("rivals" in refused(text.replace("\"2300K\", ", "\"2300K\", \"2300K\", ")))
        assertTrue("makers, phones" in refused(text.replace("\"google\", ", "\"google\", \"google\", ")))
        assertTrue("makers" in refused(text.replace("\"makers\"", "\"maker\"")))
        assertTrue("makers, phones" in refused(text.replace(Regex("\"phones\": \\[[^]]*]"), "\"phones\": []")))
        val half = Rules.parse(text.replace("\"value\": 12,", "\"value\": 12.5,"))
        assertThrows(InvalidArgument::class.java) { half.whole("verdict.few_patches") }
    }
}
