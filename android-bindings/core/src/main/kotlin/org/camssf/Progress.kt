package org.camssf

import org.camssf.photo.Capture
import org.camssf.recovery.AnyLight
import org.camssf.recovery.Recover
import org.camssf.spectra.Lamp
import org.camssf.verdict.Light
import kotlin.math.min

/**
 * How far a calibration is, at the begin of a step.
 *
 * @property stage what is done next.
 * @property part share of the work that is finished, 0 to 1: never smaller than before, and 1 only at [Stage.DONE].
 *   The work of each step is a median measured on a desktop (docs/android.md), so a part is no promise of time.
 * @property shot index of the shot that is measured, from 0; null after [Stage.MEASURING].
 */
public class Progress internal constructor(
    public val stage: Stage,
    public val part: Double,
    public val shot: Int?,
) {
    private fun parts() = listOf(stage, part, shot)

    override fun equals(other: Any?): Boolean = other is Progress && parts() == other.parts()

    override fun hashCode(): Int = parts().hashCode()

    /** For example "measuring the patches, shot 2: 31 %". */
    override fun toString(): String = "${named(stage, shot)}: ${(100 * part).toInt()} %"
}

/** The stage and its shot's number, in words. */
internal fun named(stage: Stage, shot: Int?): String =
    if (shot == null) stage.words else "${stage.words}, shot ${shot + 1}"

/** Receives the progress of a calibration, on the thread that calibrates. */
public fun interface ProgressListener {
    /** Called at the begin of each step. */
    public fun report(progress: Progress)
}

/** What [SsfCalibrator.calibrationFlow] emits. */
public sealed class RunState {
    /** The calibration runs. */
    public class Running internal constructor(public val progress: Progress) : RunState() {
        override fun toString(): String = "$progress"
    }

    /** The calibration has ended; the last state of a flow. */
    public class Finished internal constructor(public val result: CalibrationResult) : RunState() {
        override fun toString(): String = "$result"
    }
}

/**
 * The steps of a run in their order, each with its work. A step's work counts as finished when a later one begins; a
 * step that was not planned adds nothing, and planned steps that are skipped count when a later one begins.
 */
internal class ProgressPlan private constructor(private val steps: List<Step>) {
    /**
     * @param work in milliseconds; only ratios matter.
     * @param runs of a model in it, where that is reported.
     */
    private class Step(val stage: Stage, val shot: Int?, val work: Double, val runs: Int = 1)

    private val whole = steps.sumOf { it.work }
    private var at = -1
    private var run = 0
    private var before = 0.0

    /** The next step of a stage begins; one that was not planned stands where the last one did. */
    fun begin(stage: Stage, shot: Int?): Progress {
        if (stage == Stage.DONE) return Progress(stage, 1.0, null)
        val next = (at + 1 until steps.size).firstOrNull { steps[it].stage == stage && steps[it].shot == shot }
        if (next != null) {
            for (i in maxOf(at, 0) until next) before += steps[i].work
            at = next
            run = 0
        }
        return Progress(stage, part(), shot)
    }

    /** Within the step that has begun, the next run of a model begins; the first one began with the step. */
    fun proceed(): Progress {
        val step = steps[at]
        run = min(run + 1, step.runs - 1)
        return Progress(step.stage, part(), step.shot)
    }

    private fun part(): Double = if (at < 0) 0.0 else (before + steps[at].work * run / steps[at].runs) / whole

    companion object {
        // Medians in ms, one to six shots of 12 megapixels, uncompressed DNGs, a desktop's JVM, 2026-11-23:
        // mvn -f android-bindings -pl core -am test -Dtest=ProgressTest -Dprogress.work
        private const val READ = 28.0
        private const val FIND = 29.0

        /** Of each frame: chart, white, dark. */
        private const val MEASURE = 105.0

        /** Of one fit, and of one lamp that is compared, each on one basis with one shot. */
        private const val SOLVE = 15.0
        private const val JUDGE = 6.0

        /** How much longer the latter two take for each further shot, relative to the first. */
        private const val PER_SHOT = 1.7

        /**
         * The steps of measuring and solving a capture.
         *
         * @param families number of bases that the signals choose from.
         */
        fun of(capture: Capture, options: CalibrationOptions, families: Int, prior: Boolean): ProgressPlan {
            val measuring = capture.shots.flatMapIndexed { j, shot ->
                val frames = 1 + listOfNotNull(shot.white, shot.dark).size
                val work = listOf(Stage.READING to READ, Stage.FINDING to FIND, Stage.MEASURING to MEASURE * frames)
                work.map { (stage, each) -> Step(stage, j, each) }
            }
            return ProgressPlan(measuring + solving(capture.shots.map { it.lamp }, options, families, prior))
        }

        /** The steps of solving measured shots. */
        fun of(lamps: List<Lamp>, options: CalibrationOptions, families: Int, prior: Boolean): ProgressPlan =
            ProgressPlan(solving(lamps, options, families, prior))

        private fun solving(lamps: List<Lamp>, options: CalibrationOptions, bases: Int, prior: Boolean): List<Step> {
            val k = lamps.size
            val unnamed = lamps.count { it.unnamed }
            // Every lamp of every uncertain light with every family, the family's test, and the lights' posteriors.
            val uncertain = lamps.filter { it.uncertain && (prior || it.unnamed) }
            val kinds = uncertain.take(AnyLight.MOST).fold(1) { all, lamp -> all * lamp.lamps.size }
            val runs = if (uncertain.isEmpty()) 1 else bases + LIGHTS
            val size = 1 + PER_SHOT * (k - 1)
            // All folds are solved in one call, and their bands in another.
            val folds = if (options.fit == null) 2 else 0
            val alone = if (k > 1 && prior) k else 0
            val named = k - unnamed
            val comparing = prior && named > 0 && k <= Light.MOST_SHOTS_COMPARED
            val compared = if (comparing) 1 + named * Light.RIVALS.size else 0
            val stacks = List(compared) { it }.chunked(Recover.stackOf(k))
            // The parts of the capture are solved with the basis and the kinds of light that the whole has found.
            return listOf(Step(Stage.SOLVING, null, SOLVE * bases * kinds * size, runs)) +
                List(folds) { Step(Stage.VALIDATING, null, SOLVE * size * Solve.FOLDS / folds) } +
                List(alone) { Step(Stage.VALIDATING, null, SOLVE) } +
                stacks.map { Step(Stage.JUDGING, null, JUDGE * bases * size * it.size) }
        }

        /** Runs of a model for an unnamed light after the evidence of each basis: two widths, the test, the light. */
        private const val LIGHTS = 4
    }
}
