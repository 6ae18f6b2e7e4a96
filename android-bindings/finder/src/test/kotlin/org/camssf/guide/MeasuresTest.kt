package org.camssf.guide

import org.camssf.finder.Candidate
import org.camssf.finder.ChartKind
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNotNull
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.abs
import kotlin.math.exp
import kotlin.math.ln

/** Each measure of single frames of which the truth is known. */
class MeasuresTest {
    private val plain = Drawn()

    private fun within(range: ClosedFloatingPointRange<Double>, found: Double?, what: String) =
        assertTrue(found != null && found in range, "$what is $found, not in $range")

    /** What a good frame says, as colours, as a camera's planes and as brightness alone. */
    @Test
    fun `a good frame`() {
        for (picture in listOf(plain.rgb(), plain.yuv(), plain.luma())) {
            val m = plain.measures(picture)
            within(0.445..0.455, m.size, "size")
            within(2.5..2.8, m.margin, "margin")
            within(0.0..0.1, m.tilt, "tilt")
            within(0.67..0.69, m.white, "white") // 0.9 of 0.75
            assertEquals(0.0, m.clipped)
            within(0.4..0.7, m.blur, "blur")
            assertEquals(emptyList<Int>(), m.glare)
            within(0.03..0.04, m.veil, "veil")
            within(0.0..0.15, m.shadow, "shadow")
            within(0.0..0.06, m.gradient, "gradient")
            assertNull(m.speed)
        }
        within(0.0..0.03, plain.measures(plain.yuv()).tint, "tint")
        assertNull(plain.measures(plain.luma()).tint)
    }

    private fun measures(candidate: Candidate, focal: Double = 0.75) =
        FrameMeter(focal).measure(plain.rgb(), candidate, ChartPlane.of(candidate)!!, null)

    @Test
    fun `the tilt is the angle to the line of sight, about any axis`() {
        for (tilt in listOf(0.0, 8.0, 25.0, 40.0, 55.0)) {
            for (axis in listOf(0.0, 30.0, 90.0, 160.0)) {
                val drawn = Drawn(tilt = tilt, axis = axis, rotation = 2 * axis)
                val found = measures(drawn.candidate())
                assertEquals(tilt, found.tilt, 0.01, "about $axis")
            }
        }
        // Of a chart that faces the camera's plane beside its middle, the angle under which it is seen.
        val aside = measures(Drawn(shiftX = 0.3).candidate())
        assertEquals(Math.toDegrees(Math.atan(0.3 / 0.75)), aside.tilt, 0.01)
        // Half the focal length that was told: perspective says twice the tilt, or nearly.
        assertTrue(measures(Drawn(tilt = 20.0).candidate(), 1.5).tilt > 30)
    }

    @Test
    fun `size and margin`() {
        for (fill in listOf(0.2, 0.35, 0.6)) {
            val m = measures(Drawn(fill = fill).candidate())
            assertEquals(fill, m.size, 0.01)
        }
        fun margin(x: Double, y: Double) = measures(Drawn(fill = 0.5, shiftX = x, shiftY = y).candidate()).margin
        val pitch = 0.5 * 640 / 5.88
        assertEquals((239.5 - 2.25 * pitch) / pitch, margin(0.0, 0.0), 1e-3)
        assertEquals((319.5 - 3.25 * pitch - 0.2 * 640) / pitch, margin(0.2, 0.0), 1e-3)
        assertEquals((319.5 - 3.25 * pitch - 0.2 * 640) / pitch, margin(-0.2, 0.0), 1e-3)
        assertEquals((239.5 - 2.25 * pitch - 0.25 * 480) / pitch, margin(0.0, 0.25), 1e-3)
        assertTrue(margin(0.0, -0.3) < 0)
    }

    /** Where white is clipped, the other patches tell how much, up to three stops. */
    @Test
    fun `the white patch's level, clipped or not`() {
        for (exposure in listOf(0.06, 0.75, 1.5, 7.0)) {
            val m = Drawn(exposure = exposure).measures()
            val true_ = exposure * Drawn.PATCHES[54]
            assertEquals(0.0, ln(m.white / true_) / ln(2.0), 0.15, "at $exposure")
            assertEquals(true_ > 1, m.clipped > 0.5, "at $exposure")
        }
        val lost = Drawn(exposure = 60.0).measures()
        assertTrue(lost.white > 2)
        assertNull(lost.blur)
    }

    @Test
    fun `blur is that of the lens, and grows`() {
        for (fill in listOf(0.3, 0.7)) {
            val found = listOf(0.5, 1.0, 1.5, 2.0, 3.0, 5.0).map { Drawn(fill = fill, blur = it).measures().blur!! }
            assertEquals(found.sorted(), found)
            within(0.8..1.25, found[1], "blur 1")
            within(1.2..1.8, found[2], "blur 1.5")
            assertTrue(found[4] > 1.8, "$found")
        }
    }

    @Test
    fun `a spot is named by its patches`() {
        val spot = Drawn(shine = Drawn.spot(2.0, 1.0, 0.5, 0.25)).measures()
        assertTrue(8 in spot.glare, "${spot.glare}")
        assertTrue(spot.glare.all { it in setOf(1, 2, 3, 7, 8, 9, 13, 14, 15) }, "${spot.glare}")
        val small = Drawn(shine = Drawn.spot(5.0, 3.0, 0.15, 0.3)).measures() // on black
        assertEquals(listOf(23), small.glare)
    }

    @Test
    fun `a veil lifts black`() {
        val veil = Drawn(shine = { _, _ -> 0.1 }).measures()
        within(0.12..0.14, veil.veil, "veil")
        assertEquals(emptyList<Int>(), veil.glare)
        // A shadow on black or white is not a veil, and no spot.
        for (angle in 0 until 360 step 90) {
            val shaded = Drawn(light = Drawn.shadow(angle.toDouble(), 0.3, 0.4)).measures()
            assertNull(shaded.veil)
            assertEquals(emptyList<Int>(), shaded.glare, "$angle")
        }
    }

    @Test
    fun `a shadow's depth in stops, whatever way it lies`() {
        for (angle in 0 until 360 step 60) {
            for (factor in listOf(0.4, 0.75)) {
                val m = Drawn(light = Drawn.shadow(angle.toDouble(), 0.4, factor)).measures()
                val stops = -ln(factor) / ln(2.0)
                assertEquals(stops, m.shadow!!, 0.25 * stops, "$angle, $factor")
                within(0.0..0.2, m.gradient, "gradient")
            }
        }
    }

    /** The benchmark's find: a deep shadow under a maker's tone curve was called glare. */
    @Test
    fun `a deep shadow stays a shadow under a steep tone curve`() {
        for (angle in listOf(0, 230)) {
            val m = Drawn(light = Drawn.shadow(angle.toDouble(), 0.3, 0.35), contrast = 1.35).measures()
            assertEquals(emptyList<Int>(), m.glare, "$angle")
            assertEquals(1.5, m.shadow!!, 0.4, "$angle")
        }
    }

    @Test
    fun `a gradient in stops, and no shadow`() {
        for (stops in listOf(0.3, 1.2)) {
            for (place in listOf<(Double, Double) -> Double>({ u, _ -> u / 5 }, { _, v -> v / 3 })) {
                val m = Drawn(light = { u, v -> exp(-ln(2.0) * stops * place(u, v)) }).measures()
                assertEquals(stops, m.gradient, 0.08)
                assertEquals(0.0, m.shadow!!, 0.15)
            }
        }
    }

    @Test
    fun `colour around is counted in the chart's own light`() {
        val red = listOf(0.5, 0.15, 0.12)
        within(0.36..0.44, Drawn(wall = red).measures().tint, "tint")
        val lamp = listOf(1.25, 1.0, 0.6)
        // A warm lamp on a grey wall: what is grey to the chart's white is no colour.
        val warm = Drawn(wall = listOf(0.3, 0.3, 0.3)).lit(lamp).measures()
        within(0.0..0.04, warm.tint, "tint")
        within(0.33..0.47, Drawn(wall = red).lit(lamp).measures().tint, "tint")
        assertEquals(0.0, Drawn(fill = 0.85, wall = red).measures().tint) // nothing of it is seen
    }

    @Test
    fun `noise does not move the measures`() {
        val m = Drawn(noise = 6.0).measures()
        within(0.0..0.2, m.shadow, "shadow")
        within(0.0..0.15, m.gradient, "gradient")
        assertEquals(emptyList<Int>(), m.glare)
        within(0.4..0.8, m.blur, "blur")
    }

    /** Without a table of its colours the SG has all but the shadow and the veil's reference. */
    @Test
    fun `a Semi Gloss is measured by its brightest patch`() {
        val own = plain.candidate()
        val grid = List(140) { i ->
            val (a, b) = own.patches[0] to own.patches[23]
            val (u, v) = i % 14 / 13.0 to i / 14 / 9.0
            org.camssf.photo.Point(a.x + (b.x - a.x) * u, a.y + (b.y - a.y) * v)
        }
        val candidate = Candidate(own.corners, ChartKind.SG_140, false, 0.9, grid, 140)
        val m = measures(candidate)
        assertNull(m.shadow)
        assertNull(m.veil)
        assertNotNull(m.tint)
        within(0.6..0.7, m.white, "white")
    }

    @Test
    fun `what is no quadrilateral is not measured`() {
        val flat = Candidate(
            plain.candidate().corners, ChartKind.CLASSIC_24, false, 0.9,
            List(24) { org.camssf.photo.Point(it.toDouble(), 3.0) }, 24,
        )
        assertNull(ChartPlane.of(flat))
    }

    /** Speeds are of the fastest corner over a tenth of a second. */
    @Test
    fun `motion`() {
        val motion = Motion()
        val pitch = 49.0
        fun at(x: Double, time: Double) =
            motion.speed(Drawn(shiftX = x / 640).candidate(), (1e9 * time).toLong(), pitch)
        assertNull(at(0.0, 10.0))
        assertEquals(2.0 / pitch * 30, at(2.0, 10 + 1 / 30.0)!!, 1e-6)
        assertEquals(2.0 / pitch * 30, at(4.0, 10 + 2 / 30.0)!!, 1e-6)
        // One jump of three: of the last tenth of a second a third.
        repeat(5) { at(4.0, 10 + (3 + it) / 30.0) }
        assertTrue(abs(at(7.0, 10 + 8 / 30.0)!! - 3.0 / pitch * 10) < 0.2)
        assertNull(at(50.0, 12.0)) // after a pause
        assertNull(at(50.0, 11.0)) // a clock that goes back
    }
}
