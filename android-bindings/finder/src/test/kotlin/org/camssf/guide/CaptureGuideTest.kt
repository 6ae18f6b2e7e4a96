package org.camssf.guide

import org.camssf.InvalidArgument
import org.camssf.finder.Finding
import org.camssf.finder.Found
import org.camssf.finder.Picture
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.util.Random
import kotlin.math.abs
import kotlin.math.exp
import kotlin.math.ln

/** Advice over sequences of frames. */
class CaptureGuideTest {
    private val good = Drawn()
    private val nothing = Found(emptyList(), setOf(Finding.NONE))

    /** A guide and a clock of 30 frames a second. */
    private class Run(val guide: CaptureGuide = CaptureGuide()) {
        var time = 0L
        val said = ArrayList<Guidance>()

        fun frame(picture: Picture, found: Found): Guidance {
            time += 33_333_333
            return guide.take(picture, found, time).also { said += it }
        }

        fun hold(drawn: Drawn, frames: Int): Guidance {
            val picture = drawn.rgb()
            val found = drawn.found()
            repeat(frames) { frame(picture, found) }
            return said.last()
        }

        fun changes(from: Int = 0) = said.drop(from).zipWithNext().count { (a, b) -> a.advice != b.advice }
    }

    private fun advice(drawn: Drawn, frames: Int = 12): Guidance = Run().hold(drawn, frames)

    @Test
    fun `a good frame that lasts ends in now`() {
        val run = Run()
        run.hold(good, 25)
        val all = run.said.map { it.advice }
        assertEquals(listOf(Advice.NO_CHART, Advice.STEADY, Advice.NOW), all.distinct())
        assertTrue(all.indexOf(Advice.NOW) in Limits.HELD..Limits.HELD + 2, "$all")
        assertEquals("Now.", run.said.last().words)
        assertTrue(run.said.all { it is Guidance.Measured && it.ready == (it.advice == Advice.NOW) })
        assertNull((run.said.first() as Guidance.Measured).measures.speed)
    }

    @Test
    fun `each fault has its advice, with a number`() {
        val cases = listOf(
            Drawn(fill = 0.2) to Advice.TOO_FAR,
            Drawn(shiftX = 0.33) to Advice.CUT,
            Drawn(tilt = 40.0) to Advice.TILTED,
            Drawn(tilt = 30.0, axis = 70.0) to Advice.TILTED,
            Drawn(exposure = 0.75 / 8) to Advice.TOO_DARK,
            Drawn(exposure = 2.0) to Advice.TOO_BRIGHT,
            Drawn(blur = 4.0) to Advice.OUT_OF_FOCUS,
            Drawn(shine = Drawn.spot(2.2, 1.6, 0.6, 0.3)) to Advice.GLARE,
            Drawn(shine = { _, _ -> 0.15 }, exposure = 0.65) to Advice.GLARE,
            Drawn(light = Drawn.shadow(20.0, 0.5, 0.5)) to Advice.SHADOW,
            Drawn(light = { u, _ -> exp(-ln(2.0) * u / 5) }) to Advice.UNEVEN,
            Drawn(wall = listOf(0.5, 0.15, 0.12)) to Advice.TINTED,
        )
        val amounts = cases.map { (drawn, wanted) ->
            val found = advice(drawn)
            assertEquals(wanted, found.advice, "${found.words}")
            if (wanted.unit.isNotEmpty()) assertTrue(found.amount > 0, "$wanted: ${found.amount}")
            found.amount
        }
        assertEquals(2.0, amounts[0], 0.05)
        assertEquals(40.0, amounts[2], 0.5)
        assertEquals(ln(0.65 / (0.75 / 8 * 0.9)) / ln(2.0), amounts[4], 0.2)
        assertEquals(ln(1.8 / 0.65) / ln(2.0), amounts[5], 0.2)
    }

    @Test
    fun `moving is said, and the words`() {
        val run = Run()
        val picture = good.rgb()
        for (i in 0..15) run.frame(picture, good.copy(shiftX = -0.1 + 0.01 * i).found())
        assertEquals(Advice.MOVING, run.said.last().advice)
        assertEquals(0.01 * 640 * 30 / (0.45 * 640 / 5.88), run.said.last().amount, 0.1)
        assertEquals("Hold still.", run.said.last().words)
    }

    @Test
    fun `mirrors and second charts come first`() {
        val both = listOf(Finding.MIRRORED to Advice.MIRRORED, Finding.TWO_CHARTS to Advice.TWO_CHARTS)
        for ((finding, advice) in both) {
            val run = Run()
            val (picture, found) = good.rgb() to Drawn(tilt = 30.0).found(finding)
            repeat(20) { run.frame(picture, found) }
            assertEquals(advice, run.said.last().advice)
        }
    }

    @Test
    fun `no chart is said after some frames without one, and now ends at once`() {
        val run = Run()
        val picture = good.rgb()
        assertEquals(Advice.NO_CHART, run.frame(picture, nothing).advice)
        run.hold(good, 20)
        assertEquals(Advice.NOW, run.said.last().advice)
        assertEquals(Advice.STEADY, run.frame(picture, nothing).advice)
        assertEquals(Advice.STEADY, run.frame(picture, good.found()).advice) // one frame lost is not said
        repeat(Limits.LOST - 1) { assertEquals(Advice.STEADY, run.frame(picture, nothing).advice) }
        assertEquals(Advice.NO_CHART, run.frame(picture, nothing).advice)
        assertTrue(run.said.last() is Guidance.Searching)
        run.guide.reset()
        assertEquals(Advice.NO_CHART, run.frame(picture, good.found()).advice)
    }

    @Test
    fun `the most urgent comes first, and one after the other until now`() {
        val run = Run()
        var drawn = Drawn(fill = 0.2, tilt = 30.0, exposure = 0.1, wall = listOf(0.5, 0.15, 0.12))
        val order = ArrayList<Advice>()
        for (mended in listOf<(Drawn) -> Drawn>(
            {
                it.copy(fill = 0.4)
            }, { it.copy(tilt = 0.0) }, { it.copy(exposure = 0.7) }, { it.copy(wall = good.wall) },
        )) {
            order += run.hold(drawn, 14).advice
            drawn = mended(drawn)
        }
        assertEquals(listOf(Advice.TOO_FAR, Advice.TILTED, Advice.TOO_DARK, Advice.TINTED), order)
        assertEquals(Advice.NOW, run.hold(drawn, 25).advice)
    }

    /** The measures of noisy frames cross each limit many times; what is said does not. */
    @Test
    fun `advice is stable where a measure wavers about its limit`() {
        val random = Random(11)
        val picture = good.rgb()
        for ((from, spread) in listOf(20.0 to 1.2, 19.0 to 1.2)) {
            val run = Run()
            val raw = ArrayList<Boolean>()
            repeat(300) {
                val tilt = from + spread * random.nextGaussian()
                val drawn = good.copy(tilt = abs(tilt))
                run.frame(picture, drawn.found())
                raw += (run.said.last() as Guidance.Measured).measures.tilt > 20
            }
            val changes = raw.zipWithNext().count { (a, b) -> a != b }
            val said = run.changes(30)
            println("tilt $from ± $spread: measured crosses $changes times, said changes $said times")
            assertTrue(said <= 2, "said changed $said times of $changes at $from")
            if (from == 20.0) assertTrue(changes > 60)
        }
    }

    @Test
    fun `noise from frame to frame changes nothing that is said`() {
        val random = Random(3)
        for (drawn in listOf(good, Drawn(exposure = 0.1), Drawn(light = Drawn.shadow(60.0, 0.0, 0.6)))) {
            val run = Run()
            val pictures = List(5) { drawn.copy(noise = 5.0, seed = it.toLong()).rgb() }
            repeat(60) {
                val shaken = drawn.copy(
                    shiftX = 0.0008 * random.nextGaussian(),
                    shiftY =
                    0.0008 * random.nextGaussian(),
                )
                run.frame(pictures[it % 5], shaken.found())
            }
            assertTrue(run.changes(Limits.HELD + 10) == 0, "${run.said.map { it.advice }}")
        }
    }

    @Test
    fun `one frame of something else is not said`() {
        for (other in listOf(Drawn(tilt = 50.0), Drawn(exposure = 0.05), Drawn(blur = 5.0))) {
            val run = Run()
            run.hold(Drawn(wall = listOf(0.5, 0.15, 0.12)), 12)
            run.hold(other, 1)
            run.hold(Drawn(wall = listOf(0.5, 0.15, 0.12)), 10)
            assertEquals(setOf(Advice.TINTED), run.said.drop(8).map { it.advice }.toSet())
        }
    }

    @Test
    fun `all words are one line with their number`() {
        for (advice in Advice.values()) {
            for (amount in listOf(0.3, 1.0, 2.6)) {
                val words = advice.words(amount)
                assertTrue(words.endsWith(".") && '\n' !in words && words.length < 90, words)
            }
        }
        assertEquals("Too dark: expose 2½ stops more.", Advice.TOO_DARK.words(2.6))
        assertEquals("Too dark: expose half a stop more.", Advice.TOO_DARK.words(0.1))
        assertEquals("Too bright: expose 1 stop less.", Advice.TOO_BRIGHT.words(1.1))
        assertEquals("Come nearer, about 1.6 times as near.", Advice.TOO_FAR.words(1.61))
        assertEquals("Something shines on a patch: turn the chart or move the lamp aside.", Advice.GLARE.words(1.0))
        assertEquals("Look straight at the chart: it is tilted by 41°.", Advice.TILTED.words(40.6))
    }

    @Test
    fun `light and mosaics are no preview`() {
        val light = Picture.light(listOf(FloatArray(640 * 480)), 640, 480)
        assertThrows(InvalidArgument::class.java) { CaptureGuide().take(light, good.found(), 0) }
    }

    /** Finder and guide together, as an app calls them. */
    @Test
    fun `the chart is looked for, and now is said`() {
        for (picture in listOf(good.yuv(), good.rgb(), Drawn(rotation = 190.0, tilt = 12.0).yuv())) {
            val guide = CaptureGuide()
            val said = (1..20L).map { guide.look(picture, it * 33_000_000) }
            assertEquals(Advice.NOW, said.last().advice, said.last().words)
        }
        val (guide, picture) = CaptureGuide() to Drawn(tilt = 40.0).yuv()
        val found = (1..10L).map { guide.look(picture, it * 33_000_000) }.last()
        assertEquals(Advice.TILTED, found.advice)
        assertEquals(40.0, found.amount, 2.0)
        val empty = Drawn(fill = 0.01).yuv()
        assertEquals(Advice.NO_CHART, CaptureGuide().look(empty, 0).advice)
    }

    @Test
    fun `a lens that there is not is refused`() {
        for (focal in listOf(0.0, -1.0, Double.NaN, 25.0)) {
            assertThrows(InvalidArgument::class.java) { CaptureGuide(focal) }
        }
    }
}
