package org.camssf.verdict

import org.camssf.Reason
import org.camssf.Rules
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertFalse
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test

/** Rule 4: gains of rival lamps. */
class LightTest {
    private val lamps = listOf("D55", "A")

    private fun rivalLamp(vararg rivals: Rival) = Light.rivalLamp(rivals.toList(), lamps)

    @Test
    fun `a gain up to the bound is no reason`() {
        assertEquals(emptyList<Reason>(), rivalLamp())
        assertEquals(emptyList<Reason>(), rivalLamp(Rival(0, "FL2", 4.0), Rival(1, "D55", -30.0)))
    }

    @Test
    fun `the lamp of the shot with the best rival is doubted`() {
        val found = rivalLamp(Rival(0, "FL2", 7.0), Rival(1, "FL7", 3.0), Rival(1, "LED-B1", 8.0)).single()
        assertTrue(found.message.startsWith("shot 2: the light is another than A,"), found.message)
        assertEquals("lamp_unfit", found.code)
        assertEquals(8.0 to 4.0, found.value to found.threshold)
        assertFalse(found.fatal)
    }

    @Test
    fun `out of the question, however far`() {
        for (gain in listOf(14.5, 800.0, 1e6)) {
            val found = rivalLamp(Rival(0, "FL2", gain), Rival(0, "FL7", -gain)).single()
            assertTrue(found.fatal)
            assertEquals(14.0, found.threshold)
        }
    }

    @Test
    fun `with the raw white of the same shot the smaller bound refuses, and the check says so`() {
        val checks = Checks()
        val found = Light.rivalLamp(listOf(Rival(0, "A", 5.0)), lamps, listOf(0), checks).single()
        assertTrue(found.fatal)
        assertEquals(4.0, found.threshold)
        assertEquals(4.0, checks.all.single().refuses)
    }

    @Test
    fun `rival lamps, their prior's width and the most shots are those of the rules`() {
        assertEquals(Rules.shipped.rivals, Light.RIVALS)
        assertEquals(18, Light.RIVALS.size)
        assertEquals(Rules.shipped.number("verdict.narrow"), Light.NARROW)
        assertEquals(Rules.shipped.whole("verdict.most_shots_compared"), Light.MOST_SHOTS_COMPARED)
    }
}
