package org.camssf

import kotlinx.coroutines.Dispatchers
import kotlinx.coroutines.flow.Flow
import kotlinx.coroutines.flow.channelFlow
import kotlinx.coroutines.flow.conflate
import kotlinx.coroutines.runInterruptible
import kotlinx.coroutines.withContext
import org.camssf.documents.Provenance
import org.camssf.documents.Solution
import org.camssf.photo.Capture
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Measuring
import org.camssf.photo.PartialCapture
import org.camssf.photo.Shot
import org.camssf.recovery.Choice
import org.camssf.recovery.Engine
import org.camssf.recovery.OnnxEngine
import org.camssf.recovery.SHIPPED_BASES
import org.camssf.recovery.withOnnxRuntime
import org.camssf.spectra.Bundled
import org.camssf.spectra.ChartTable
import org.camssf.verdict.Reasons
import org.camssf.verdict.Status
import org.camssf.verdict.Verdict
import java.io.Closeable
import java.io.InterruptedIOException
import java.lang.ref.WeakReference
import java.net.SocketTimeoutException
import java.nio.channels.ClosedByInterruptException
import java.util.Collections
import java.util.concurrent.CancellationException
import java.util.logging.Level
import java.util.logging.Logger as Log

/** Receives log lines: each stage with its duration, and the outcome. Called on the thread that calibrates. */
public fun interface Logger {
    /** One line, without source location or time; files have the names that their sources give. */
    public fun log(line: String)
}

/**
 * Recovers a camera's spectral sensitivities from photos of a ColorChecker, on this device; no data leaves it.
 *
 * ```kotlin
 * suspend fun recover(photo: PhotoSource, corners: Corners) = SsfCalibrator.open().use { calibrator ->
 *     val shot = Shot(photo, Lamp.read("daylight"), corners)
 *     when (val result = calibrator.calibrate(Capture(shot, ChartTable.read("classic24")))) {
 *         is Recovered -> println("red at 600 nm: ${result.curve(Channel.RED).at(600.0)}")
 *         is Refused -> println("${result.error.message} ${result.error.advice}")
 *     }
 * }
 * ```
 *
 * Ownership: it holds its models in native memory and must be closed by the code that opened it. Open one and keep
 * it, or open one for each calibration. One that becomes garbage unclosed is released, with a warning in the log.
 *
 * Threads: any. The suspending functions may be called from the main thread, the blocking ones must not; calls from
 * several threads wait for each other at the model. A second `close` does nothing; other calls after it throw
 * [CalibratorClosed], an [IllegalStateException]. Results belong to the caller and stay valid after `close`.
 */
public class SsfCalibrator private constructor(
    /**
     * The basis of the curves: "phones", "cameras", "ryyb", "gaussian", or "auto", which the signals choose from.
     */
    public val basis: String,
    private val engines: List<Engine>,
    private val logger: Logger?,
    private val guard: RunGuard,
) : Closeable {
    override fun toString(): String = "SsfCalibrator($basis)"

    private val watch = Abandoned.Watch(this, release(guard, logger, Throwable("It was opened here.")))

    /** When the last call ended; writing it keeps the calibrator from being garbage while a call runs. */
    @Volatile
    private var ended = 0L

    private fun <T> running(work: () -> T): T = try {
        guard.through(work)
    } finally {
        ended = System.nanoTime()
    }

    /** SHA-256 of each basis's model file, lower-case hex; those that "auto" chooses from have one file. */
    public val modelHashes: Map<String, String> =
        Collections.unmodifiableMap(engines.associate { it.basis to it.sha256 })

    /** SHA-256 of each basis, as its model states it; the engine has checked that it is the one that is given. */
    private val basisHashes = engines.associate { it.basis to it.metadata["basis_sha256 ${it.basis}"] }

    /** As the other `calibrateBlocking`, without options. */
    @Throws(InterruptedException::class)
    public fun calibrateBlocking(capture: Capture): CalibrationResult =
        calibrateBlocking(capture, CalibrationOptions.DEFAULT)

    /**
     * Recovers the camera's curves from RAW photos: reads each shot's frames in turn, moves the corners to the
     * printed borders, measures the patches and solves (some ten model runs for one shot).
     *
     * Threads: any but the main one; it blocks.
     *
     * @throws InvalidArgument the call itself is wrong; every other reason for no answer is returned as a [Refused].
     * @throws InterruptedException the thread was interrupted; all resources of the run are released.
     * @throws CalibratorClosed see [close].
     */
    @Throws(InterruptedException::class)
    public fun calibrateBlocking(capture: Capture, options: CalibrationOptions): CalibrationResult = running {
        run(capture, options, reporter(ProgressPlan.of(capture, options, engines.size, prior), options.progress))
    }

    /** As the other `calibrate`, without options. */
    public suspend fun calibrate(capture: Capture): CalibrationResult = calibrate(capture, CalibrationOptions.DEFAULT)

    /**
     * Runs [calibrateBlocking] on a thread of the options' dispatcher.
     *
     * Threads: any, also the main one. Cancelling the coroutine's job interrupts the working thread; the run then ends
     * after the current row of samples or the current model run.
     *
     * @throws InvalidArgument as [calibrateBlocking].
     * @throws CalibratorClosed see [close].
     */
    public suspend fun calibrate(capture: Capture, options: CalibrationOptions): CalibrationResult =
        on(options) { calibrateBlocking(capture, options) }

    private suspend fun <T> on(options: CalibrationOptions, work: () -> T): T {
        guard.check()
        return runInterruptible(options.dispatcher) { work() }
    }

    /** As the other `calibrationFlow`, without options. */
    public fun calibrationFlow(capture: Capture): Flow<RunState> =
        calibrationFlow(capture, CalibrationOptions.DEFAULT)

    /**
     * Progress and outcome of [calibrate], which runs each time that the flow is collected. A collector that is
     * slower than the calibration receives the latest state only; the outcome is never lost.
     *
     * Threads: any, also the main one; the states arrive on the collector's dispatcher.
     */
    public fun calibrationFlow(capture: Capture, options: CalibrationOptions): Flow<RunState> = channelFlow {
        val own = options.toBuilder().progress {
            options.progress?.report(it)
            trySend(RunState.Running(it))
        }
        send(RunState.Finished(calibrate(capture, own.build())))
    }.conflate()

    /**
     * Runs [measureBlocking] on [Dispatchers.Default]. Threads: any, also the main one; cancelling ends it.
     *
     * @throws CalibrationException the shot cannot be measured, or the call is wrong.
     */
    public suspend fun measure(shot: Shot, chart: ChartTable): MeasuredShot =
        on(CalibrationOptions.DEFAULT) { measureBlocking(shot, chart) }

    /**
     * Measures one shot, so that its frames can be released at once; [solve] takes several measured shots later.
     *
     * Threads: any but the main one; it blocks.
     *
     * @throws CalibrationException the shot cannot be measured, or the call is wrong.
     * @throws InterruptedException the thread was interrupted; all resources of the run are released.
     */
    @Throws(InterruptedException::class)
    public fun measureBlocking(shot: Shot, chart: ChartTable): MeasuredShot = running {
        interruptible { Measuring(Capture(shot, chart), reporter()).run().shots[0] }
    }

    /** As the other `solve`, without options and with no card before the white frames but a perfect diffuser. */
    public suspend fun solve(shots: List<MeasuredShot>, chart: ChartTable): CalibrationResult =
        solve(shots, chart, null, CalibrationOptions.DEFAULT)

    /**
     * Runs [solveBlocking] on a thread of the options' dispatcher. Threads: any, also the main one; cancelling ends it.
     *
     * @throws InvalidArgument the call itself is wrong.
     */
    public suspend fun solve(
        shots: List<MeasuredShot>,
        chart: ChartTable,
        whiteReflectance: Double?,
        options: CalibrationOptions,
    ): CalibrationResult = on(options) { solveBlocking(shots, chart, whiteReflectance, options) }

    /** As the other `solveBlocking`, without options and with no card but a perfect diffuser. */
    @Throws(InterruptedException::class)
    public fun solveBlocking(shots: List<MeasuredShot>, chart: ChartTable): CalibrationResult =
        solveBlocking(shots, chart, null, CalibrationOptions.DEFAULT)

    /**
     * Computes curves, scores and verdict from measured shots.
     *
     * Threads: any but the main one; it blocks.
     *
     * @param shots of one chart with one camera, from [measure] or [MeasuredCapture.fromJson].
     * @param whiteReflectance of the target in the white frames, 90 % is 0.9; null for a perfect diffuser.
     * @throws InvalidArgument the call itself is wrong.
     * @throws InterruptedException the thread was interrupted.
     */
    @Throws(InterruptedException::class)
    public fun solveBlocking(
        shots: List<MeasuredShot>,
        chart: ChartTable,
        whiteReflectance: Double?,
        options: CalibrationOptions,
    ): CalibrationResult = running {
        val partial = PartialCapture(chart, shots.map { it.lamp }, shots.frozen())
        val plan = ProgressPlan.of(partial.lamps, options, engines.size, prior)
        refusing({ partial }) {
            finish(Measuring.joined(shots, chart, whiteReflectance), options, reporter(plan, options.progress))
        }
    }

    private fun run(capture: Capture, options: CalibrationOptions, reporter: ProgressReporter): CalibrationResult {
        val measuring = Measuring(capture, reporter)
        return refusing(measuring::partial) { finish(measuring.run(), options, reporter) }
    }

    private fun finish(
        capture: MeasuredCapture,
        options: CalibrationOptions,
        reporter: ProgressReporter,
    ): CalibrationResult {
        val previous = options.previous
        val result = if (previous == null) {
            completed(Solve(engines, capture, options, reporter).run())
        } else {
            SolveWithPrevious(engines, capture, options, reporter, previous, ::completed).run()
        }
        reporter.begin(Stage.DONE)
        return result
    }

    private fun completed(solution: Solution): CalibrationResult {
        if (solution.verdict.outcome == Status.REFUSED) {
            return refused(Reasons.refusal(solution.verdict), solution.verdict, PartialCapture(solution.capture))
        }
        return recovered(solution, modelHashes.getValue(solution.ssf.basis), basisHashes[solution.ssf.basis])
    }

    private fun refusing(partial: () -> PartialCapture, work: () -> CalibrationResult): CalibrationResult =
        outcome(partial, work).also { result ->
            logger?.log("${result.verdict.outcome.word}${result.verdict.reasons.joinToString("") { ", ${it.code}" }}")
        }

    private fun outcome(partial: () -> PartialCapture, work: () -> CalibrationResult): CalibrationResult {
        try {
            return interruptible(work)
        } catch (error: Refusal) {
            return refused(error, Verdict(Status.REFUSED, listOf(error.reason)), partial())
        }
    }

    /**
     * Ends running calls, each with [CalibratorClosed], waits until they have ended (after the current row of samples
     * or model run), and releases the models.
     *
     * Threads: any, but a call may run for a second before it ends, so not the main one while one runs. A listener of
     * progress or a [Logger] may call it; it then returns without waiting, and its own run ends at the next step
     * and releases the models. They must not wait for a thread that is in this call.
     */
    override fun close() {
        watch.cancel()
        guard.close()
    }

    /** Reports to `progress` and the logger, and ends the run if it was interrupted or closed. */
    private fun reporter(
        plan: ProgressPlan? = null,
        progress: ProgressListener? = null,
    ): ProgressReporter = object : ProgressReporter {
        private var before: Pair<Stage, Int?>? = null
        private var since = 0L

        override fun begin(stage: Stage, shot: Int?) {
            check()
            if (logger != null && before != stage to shot) {
                val now = System.nanoTime()
                before?.let { (stage, shot) -> logger.log("${named(stage, shot)}: ${(now - since) / 1_000_000} ms") }
                before = stage to shot
                since = now
            }
            plan?.begin(stage, shot)?.let { progress?.report(it) }
        }

        override fun proceed() {
            check()
            plan?.proceed()?.let { progress?.report(it) }
        }

        override fun check() {
            checkInterrupt()
            guard.check()
        }
    }

    /** Whether the basis has a prior: the paper's has none, and is compared with nothing. */
    private val prior get() = basis != OnnxEngine.PAPER

    /** How to open a calibrator; what is not set keeps its default. Of one thread. */
    public class Builder {
        private var basis = Choice.AUTO
        private var logger: Logger? = null

        /** One of [BASES]; "auto" if it is not set. One basis alone takes less time. */
        public fun basis(name: String): Builder = apply { basis = name }

        /** Receives the stages and the outcome of each run. */
        public fun logger(logger: Logger?): Builder = apply { this.logger = logger }

        /**
         * Loads the models of the basis and of the verdict, checks hash, grid and vocabulary, and loads the tables of
         * charts and lamps.
         *
         * Threads: any, also the main one: it loads on [Dispatchers.Default].
         *
         * @throws InvalidArgument there is no such basis, or the app contains another model than this version's.
         * @throws RuntimeUnfit ONNX Runtime is missing, or of a version that reports its use.
         */
        public suspend fun open(): SsfCalibrator {
            var calibrator: SsfCalibrator? = null
            try {
                return withContext(Dispatchers.Default) { openBlocking().also { calibrator = it } }
            } catch (error: CancellationException) { // also if it was opened by then
                calibrator?.close()
                throw error
            }
        }

        /** As [open], for Java and for worker threads: it blocks for some tenths of a second. */
        public fun openBlocking(): SsfCalibrator = opened(basis, logger)

        override fun toString(): String = "SsfCalibrator.Builder($basis)"
    }

    public companion object {
        /**
         * Names of bases: "auto"; "phones" and "cameras", learned from measured curves; "ryyb", phones
         * with yellow in green's place; "gaussian", the paper's basis, of the artefact camssf-model-gaussian.
         */
        @JvmField
        public val BASES: List<String> = (listOf(Choice.AUTO) + SHIPPED_BASES).frozen()

        /**
         * Opens one with the basis "auto" and without a logger; [Builder] sets others.
         *
         * Threads: any, also the main one: models and tables load on [Dispatchers.Default].
         *
         * @throws InvalidArgument the app contains another model than this version's.
         * @throws RuntimeUnfit ONNX Runtime is missing, or of a version that reports its use.
         */
        @JvmStatic
        public suspend fun open(): SsfCalibrator = Builder().open()

        /** As [open], for Java and for worker threads: it blocks for some tenths of a second. */
        @JvmStatic
        public fun openBlocking(): SsfCalibrator = Builder().openBlocking()

        private fun opened(basis: String, logger: Logger?): SsfCalibrator = withOnnxRuntime {
            // So that the first chart and lamp by name do not parse them on the main thread.
            Bundled.load()
            val engines = load(if (basis == Choice.AUTO) Choice.FAMILIES else listOf(basis))
            SsfCalibrator(basis, engines, logger, RunGuard { engines.forEach { it.close() } })
        }

        /**
         * What is done when a calibrator has become garbage; without a reference to it, also none by way of the logger,
         * which may belong to who holds the calibrator.
         */
        private fun release(guard: RunGuard, logger: Logger?, opened: Throwable): () -> Unit {
            val weak = WeakReference(logger)
            return {
                val words = "An SsfCalibrator was not closed. Close it, for example by use { }, where you opened it."
                guard.close()
                weak.get()?.log(words) ?: Log.getLogger("org.camssf").log(Level.WARNING, words, opened)
            }
        }

        private fun recovered(solution: Solution, model: String, basis: String?): Recovered {
            val measured = PartialCapture(solution.capture)
            val provenance = Provenance(Camssf.VERSION, "onnx", model, basis, measured.files)
            return Recovered(
                solution.capture, solution.answer(), solution.verdict, solution.assumptions, provenance,
            )
        }

        private fun refused(error: Refusal, verdict: Verdict, measured: PartialCapture): Refused =
            Refused(error, verdict, Provenance(Camssf.VERSION, null, null, null, measured.files), measured)

        private fun load(bases: List<String>): List<Engine> {
            val engines = ArrayList<Engine>()
            try {
                bases.mapTo(engines) { OnnxEngine.load(it) }
            } catch (error: Throwable) {
                engines.forEach { it.close() }
                throw error
            }
            return engines
        }

        /**
         * Runs `work`. If an interrupt ended a read, this throws InterruptedException whatever the read threw, and
         * clears the flag. OutOfMemoryError becomes [OutOfMemory].
         */
        private fun <T> interruptible(work: () -> T): T = try {
            work()
        } catch (error: OutOfMemoryError) {
            val most = Runtime.getRuntime().maxMemory() shr 20
            throw Refusal.of("out_of_memory.calibration", "most" to most, value = most.toDouble(), cause = error)
        } catch (error: Exception) {
            if (error is InterruptedException || error is CancellationException || !interrupt(error)) throw error
            Thread.interrupted()
            throw InterruptedException("The calibration was interrupted.").apply { initCause(error) }
        }

        private fun interrupt(error: Throwable): Boolean = generateSequence(error) { it.cause }.take(DEEPEST).any {
            it is ClosedByInterruptException || it is InterruptedException ||
                (it is InterruptedIOException && it !is SocketTimeoutException)
        }

        /** Largest number of causes to check: a chain of causes may be circular. */
        private const val DEEPEST = 16
    }
}
