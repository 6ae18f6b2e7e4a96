package org.camssf

import org.camssf.photo.Capture
import org.camssf.photo.LargePhotos
import org.camssf.photo.PhotoSource
import org.camssf.photo.Shot
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.condition.EnabledIfSystemProperty
import org.junit.jupiter.api.io.TempDir
import java.io.File

/** A bar that a user looks at: forwards only, no further than the work, and at its end with the result. */
class ProgressTest {
    @TempDir
    private lateinit var folder: File

    /** k photos of one chart, each with its own noise. */
    private fun shots(k: Int, width: Int, height: Int): List<Shot> = List(k) { j ->
        val file = File(folder, "chart$j-$width.dng")
        if (!file.exists()) LargePhotos.write(file, "chart$j", width, height)
        LargePhotos.shot(listOf(file), width, height)
    }

    private fun into(steps: MutableList<Progress>) = CalibrationOptions.Builder().progress { steps += it }.build()

    private fun run(calibrator: SsfCalibrator, shots: List<Shot>): List<Progress> {
        val steps = ArrayList<Progress>()
        val found = calibrator.calibrateBlocking(Capture(shots, LargePhotos.chart), into(steps))
        assertTrue(found is Recovered, "$found")
        return steps
    }

    private fun check(steps: List<Progress>, k: Int) {
        assertEquals(0.0, steps.first().part)
        assertTrue(steps.zipWithNext().all { (one, next) -> one.part <= next.part }, "$steps")
        assertTrue(steps.zipWithNext().all { (one, next) -> one.shot != null || one.stage <= next.stage }, "$steps")
        // At its end with the result, and not before: the last step is still to be done.
        assertEquals(listOf(Progress(Stage.DONE, 1.0, null)), steps.filter { it.part > 0.999 })
        for (stage in listOf(Stage.READING, Stage.FINDING, Stage.MEASURING)) {
            assertEquals((0 until k).toList(), steps.filter { it.stage == stage }.map { it.shot })
        }
    }

    @Test
    fun `one shot and several`() = SsfCalibrator.openBlocking().use { calibrator ->
        for (k in listOf(1, 3)) {
            val steps = run(calibrator, shots(k, 360, 264))
            check(steps, k)
            // Each step is planned: what a step adds is its own work, so no two steps stand at one part.
            val parts = steps.map { it.part }
            assertEquals(parts.distinct(), parts, "$steps")
        }
    }

    @Test
    fun `an unnamed light, a paper's basis, and shots that were measured before`() {
        val shots = shots(2, 360, 264)
        opened("phones").use { calibrator ->
            val steps = run(calibrator, listOf(Shot(shots[0].photo, Lamp.auto(), shots[0].corners)))
            check(steps, 1)
            assertTrue(steps.filter { it.stage == Stage.SOLVING }.map { it.part }.distinct().size > 4, "$steps")
            val measured = shots.map { calibrator.measureBlocking(it, LargePhotos.chart) }
            val later = ArrayList<Progress>()
            calibrator.solveBlocking(measured, LargePhotos.chart, null, into(later))
            check(later, 0)
        }
        opened("gaussian").use { check(run(it, shots.take(1)), 1) }
    }

    /** A run that begins again, because another table fits the chart, or another fit than was planned. */
    @Test
    fun `steps that were not planned stand where the last one did`() {
        val options = CalibrationOptions.Builder().fit(listOf(1, 2, 3)).build()
        val plan = ProgressPlan.of(listOf(Lamp.auto()), options, 3, true)
        val steps = ArrayList<Progress>()
        steps += plan.begin(Stage.SOLVING, null)
        repeat(40) { steps += plan.proceed() }
        steps += plan.begin(Stage.SOLVING, null)
        repeat(3) { steps += plan.proceed() }
        steps += plan.begin(Stage.VALIDATING, null)
        steps += plan.begin(Stage.JUDGING, null)
        assertTrue(steps.zipWithNext().all { (one, next) -> one.part <= next.part }, "$steps")
        assertTrue(steps.last().part < 1.0 && steps.last().part > 0.5, "$steps")
        assertEquals(1.0, plan.begin(Stage.DONE, null).part)
    }

    /** A source that fails ends the run where it stands. */
    @Test
    fun `a refusal is never done`() = opened("phones").use { calibrator ->
        val (one, two) = shots(2, 360, 264)
        val lost =
            Shot(PhotoSource { throw Refusal.of("unreadable_raw.missing", "file" to "a.dng") }, two.lamp, two.corners)
        val steps = ArrayList<Progress>()
        calibrator.calibrateBlocking(Capture(listOf(one, lost), LargePhotos.chart), into(steps))
        assertEquals("reading the photo, shot 2: ${(100 * steps.last().part).toInt()} %", "${steps.last()}")
        assertTrue(steps.last().part < 0.5)
    }

    /** Prints the work of each step, the medians that [ProgressPlan] holds: -Dtest=ProgressTest -Dprogress.work. */
    @Test
    @EnabledIfSystemProperty(named = "progress.work", matches = ".*")
    fun `work of each step`() {
        for (basis in listOf("auto", "phones")) {
            opened(basis).use { calibrator ->
                for (k in 1..6) {
                    val shots = shots(k, 4000, 3000)
                    val times = HashMap<Stage, MutableList<Double>>()
                    repeat(if (k == 1) 12 else 6) { turn ->
                        var last: Stage? = null
                        var since = 0L
                        val timing = CalibrationOptions.Builder().progress {
                            val now = System.nanoTime()
                            val spent = (now - since) / 1e6
                            if (turn > 1) last?.let { stage -> times.getOrPut(stage) { ArrayList() } += spent }
                            last = it.stage
                            since = System.nanoTime()
                        }
                        calibrator.calibrateBlocking(Capture(shots, LargePhotos.chart), timing.build())
                    }
                    val medians = times.toSortedMap().map { (stage, each) ->
                        "$stage ${"%.1f".format(each.sorted()[each.size / 2])}"
                    }
                    println("$basis, $k shots: $medians")
                }
            }
        }
    }
}
