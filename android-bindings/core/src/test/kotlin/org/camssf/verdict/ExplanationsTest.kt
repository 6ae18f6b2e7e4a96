package org.camssf.verdict

import org.camssf.Reason
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertSame
import org.junit.jupiter.api.Test

/** Which explanation rule 3 names, at the limits of rules.json, and what rule 2 calls a poor fit. */
class ExplanationsTest {
    private fun goodnessOfFit(total: Double, vararg all: Explanation) = GoodnessOfFit(total, 0.0, 60, all.toList())

    private fun of(cause: Cause, gain: Double, amount: Double = 0.1) = Explanation(cause, null, gain, amount)

    /** Upper quantiles of χ² of 60 and of the normal distribution, from tables. */
    @Test
    fun `a sum of squares is told as a normal number`() {
        for ((square, normal) in listOf(59.335 to 0.0, 79.082 to 1.6449, 99.607 to 3.0902, 43.188 to -1.6449)) {
            assertEquals(normal, goodnessOfFit(square).z, 0.01)
            assertEquals(normal, GoodnessOfFit(square - 20, 20.0, 60, emptyList()).z, 0.01)
        }
    }

    @Test
    fun `an ordinary fit needs a strong explanation`() {
        assertNull(goodnessOfFit(60.0).bestExplanation())
        assertNull(goodnessOfFit(60.0, of(Cause.TONE, 24.0)).bestExplanation())
        val strong = of(Cause.TONE, 24.1)
        val all = goodnessOfFit(60.0, of(Cause.LIGHT, 24.05), strong, of(Cause.PATCH, 3.0))
        assertSame(strong, all.bestExplanation())
    }

    /** 160 for 60 rows: 100 too much, of which a explanation must explain 30. */
    @Test
    fun `of a poor fit an explanation must explain its share`() {
        assertNull(goodnessOfFit(160.0, of(Cause.WHITE, 29.9)).bestExplanation())
        assertEquals(Cause.WHITE, goodnessOfFit(160.0, of(Cause.WHITE, 30.1)).bestExplanation()!!.cause)
        // At z of 3.5 and less it is none: 24 are enough.
        assertEquals(Cause.WHITE, goodnessOfFit(104.0, of(Cause.WHITE, 24.1)).bestExplanation()!!.cause)
        assertNull(goodnessOfFit(104.0, of(Cause.WHITE, 23.9)).bestExplanation())
        assertEquals(Cause.WHITE, goodnessOfFit(110.0, of(Cause.WHITE, 15.1)).bestExplanation()!!.cause)
    }

    @Test
    fun `a veil is favoured by a fifth, but must explain as much`() {
        val light = of(Cause.LIGHT, 30.0)
        assertEquals(Cause.VEIL, goodnessOfFit(60.0, of(Cause.VEIL, 25.1), light).bestExplanation()!!.cause)
        assertSame(light, goodnessOfFit(60.0, of(Cause.VEIL, 24.9), light).bestExplanation())
        assertNull(goodnessOfFit(60.0, of(Cause.VEIL, 23.0), of(Cause.LIGHT, 27.0)).bestExplanation())
    }

    @Test
    fun `without a dark frame the likelier of a veil and a black level is named`() {
        val black = of(Cause.BLACK, 9.0)
        val veil = of(Cause.VEIL, 8.5)
        assertSame(black, goodnessOfFit(60.0, veil, black).bestExplanation())
        assertSame(veil, goodnessOfFit(60.0, veil, of(Cause.BLACK, 8.4)).bestExplanation())
        assertNull(goodnessOfFit(60.0, veil).bestExplanation())
        val strong = of(Cause.BLACK, 29.0)
        assertSame(strong, goodnessOfFit(60.0, of(Cause.VEIL, 28.0), of(Cause.TONE, 30.0), strong).bestExplanation())
    }

    @Test
    fun `an offset is named in the place of what only imitates it`() {
        val light = of(Cause.LIGHT, 100.0)
        val black = of(Cause.BLACK, 30.1)
        assertSame(black, goodnessOfFit(60.0, light, black).bestExplanation())
        assertSame(light, goodnessOfFit(60.0, light, of(Cause.BLACK, 29.9)).bestExplanation())
        assertSame(light, goodnessOfFit(60.0, light, of(Cause.VEIL, 50.0)).bestExplanation())
        assertEquals(Cause.TONE, goodnessOfFit(60.0, of(Cause.TONE, 100.0), black).bestExplanation()!!.cause)
    }

    @Test
    fun `the black level stands in for a veil that takes away`() {
        val black = of(Cause.BLACK, 9.0)
        assertSame(black, goodnessOfFit(60.0, of(Cause.VEIL, 30.0, -0.1), black).bestExplanation())
        assertEquals(Cause.VEIL, goodnessOfFit(60.0, of(Cause.VEIL, 30.0, 0.1), black).bestExplanation()!!.cause)
        assertEquals(Cause.VEIL, goodnessOfFit(60.0, of(Cause.VEIL, 30.0, 0.0), black).bestExplanation()!!.cause)
        assertEquals(Cause.VEIL, goodnessOfFit(60.0, of(Cause.VEIL, 30.0, -0.1)).bestExplanation()!!.cause)
        assertEquals(Cause.TONE, goodnessOfFit(60.0, of(Cause.TONE, 30.0, -0.1), black).bestExplanation()!!.cause)
        assertSame(black, goodnessOfFit(60.0, of(Cause.TONE, 5.0), black).bestExplanation())
        assertNull(goodnessOfFit(60.0, of(Cause.TONE, 5.0), of(Cause.BLACK, 8.0)).bestExplanation())
    }

    @Test
    fun `each refusal is of the kind that its reason names`() {
        val codes = listOf(
            "glare", "chart_unfit", "frames_differ", "uneven_light", "not_sensor_raw", "lamp_unfit", "camera_unusual",
        )
        for (code in codes) {
            val mild = Reason("blurred", "mild", "wait", 1.0, 2.0)
            val grave = Reason(code, "grave", "go", 3.0, 4.0, true)
            val error = Reasons.refusal(Verdict(Status.REFUSED, listOf(mild, grave)))
            val fields = error.run { listOf(code, message, advice, value, threshold) }
            assertEquals(listOf(code, "grave", "go", 3.0, 4.0), fields)
        }
        val (mild, grave) = listOf(false, true).map { Reason("glare", "", "", null, null, it) }
        assertEquals(Status.ACCEPTED, Status.of(emptyList()))
        assertEquals(Status.DOUBTFUL, Status.of(listOf(mild)))
        assertEquals(Status.REFUSED, Status.of(listOf(mild, grave)))
    }
}
