package org.camssf.photo

import org.camssf.FramesDiffer
import org.camssf.UnitDiffers
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Test

/** What a white or dark frame must share with the chart photo, field by field. */
class AlikeTest {
    private fun facts(
        name: String = "white.dng",
        make: String = "Maker",
        model: String = "One",
        exposure: Double? = 0.5,
        iso: Double? = 200.0,
        width: Int = 40,
        height: Int = 30,
        cfa: String = "RGGB",
        black: List<Double> = listOf(64.0, 64.0, 64.0, 64.0),
        white: Double = 1000.0,
        camera: PhysicalCamera = PhysicalCamera("0"),
    ) = Facts(
        Mosaic.Origin(name, make, model, exposure, iso, camera = camera),
        width,
        height,
        Mosaic.Sensor(cfa, black.toDoubleArray(), white),
        Mosaic.Corrections(),
        Mosaic.Colours(),
    )

    private val chart = facts("chart.dng")

    private fun refused(frame: Facts, of: Facts = chart): String =
        assertThrows(FramesDiffer::class.java) { Alike.check(of, frame, "white") }.message

    @Test
    fun `what differs is named with both values`() {
        val cases = listOf(
            facts(width = 41) to "size 41 × 30 against 40 × 30",
            facts(height = 31) to "size 40 × 31 against 40 × 30",
            facts(cfa = "BGGR") to "CFA pattern BGGR against RGGB",
            facts(make = "Other") to "camera make 'Other' against 'Maker'",
            facts(model = "Two") to "camera model 'Two' against 'One'",
            facts(white = 1001.0) to "white level 1001 against 1000 DN",
            facts(exposure = 0.25) to "exposure 0.25 s against 0.5 s",
            facts(iso = 400.0) to "iso 400 against 200",
            facts(make = "Other", iso = 400.0) to "camera make 'Other' against 'Maker'; iso 400 against 200",
        )
        for ((frame, words) in cases) {
            assertEquals("The white frame white.dng differs from the chart photo chart.dng: $words.", refused(frame))
        }
    }

    @Test
    fun `what a file does not tell is no difference`() {
        for (silent in listOf(facts(make = ""), facts(model = ""), facts(exposure = null), facts(iso = null))) {
            Alike.check(chart, silent, "white")
            Alike.check(silent, chart, "white")
        }
    }

    /** Each position's black level may be off by half a percent of the white level, which is told as one. */
    @Test
    fun `black levels may differ by half a percent of the white level`() {
        for (position in 0..3) {
            for (sign in listOf(-1, 1)) {
                fun off(by: Double) = facts(black = List(4) { if (it == position) 64.0 + sign * by else 64.0 })
                Alike.check(chart, off(5.0), "white")
                val mean = if (sign > 0) "65.275" else "62.725"
                val words = "black level $mean against 64 DN"
                assertEquals(words, refused(off(5.1)).substringAfter("chart.dng: ").removeSuffix("."))
            }
        }
        // Of another white level nothing is said of the black.
        val other = refused(facts(white = 2000.0, black = List(4) { 128.0 }))
        assertEquals("white level 2000 against 1000 DN.", other.substringAfter("chart.dng: "))
    }

    /** One per cent of the larger: files round exposures. */
    @Test
    fun `exposures that files round are the same`() {
        for ((ours, theirs) in listOf(100.0 to 99.0, 99.0 to 100.0)) {
            Alike.check(facts(iso = ours), facts(iso = theirs), "white")
            Alike.check(facts(exposure = ours), facts(exposure = theirs), "white")
        }
        assertEquals("iso 98.9 against 100.", refused(facts(iso = 98.9), facts(iso = 100.0)).substringAfter(": "))
        assertEquals("iso 100 against 98.9.", refused(facts(iso = 100.0), facts(iso = 98.9)).substringAfter(": "))
    }

    @Test
    fun `another physical camera is told as such`() {
        val error = assertThrows(UnitDiffers::class.java) {
            Alike.check(chart, facts(camera = PhysicalCamera("2")), "white")
        }
        assertEquals(
            "The white frame white.dng was taken by another camera or lens than the chart photo chart.dng: " +
                "camera '2' against '0'.",
            error.message,
        )
    }
}
