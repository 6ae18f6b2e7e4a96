package org.camssf

import kotlinx.coroutines.CoroutineDispatcher
import kotlinx.coroutines.Dispatchers
import kotlinx.coroutines.flow.Flow
import kotlinx.coroutines.flow.channelFlow
import kotlinx.coroutines.flow.conflate
import kotlinx.coroutines.runInterruptible
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
import org.camssf.recovery.OnnxLibrary
import org.camssf.recovery.SHIPPED_BASES
import org.camssf.spectra.ChartTable
import org.camssf.verdict.Reasons
import org.camssf.verdict.Status
import org.camssf.verdict.Verdict
import java.io.Closeable
import java.io.InterruptedIOException
import java.net.SocketTimeoutException
import java.nio.channels.ClosedByInterruptException
import java.util.Collections
import java.util.concurrent.CancellationException

/** Receives log lines: each stage with its duration, and the outcome. Called on the thread that calibrates. */
public fun interface Logger {
    /** One line, without source location or time; files have the names that their sources give. */
    public fun log(line: String)
}

/**
 * Recovers a camera's spectral sensitivities from photos of a ColorChecker, on this device; no data leaves it.
 *
 * ```
 * val chart = ChartTable.read("classic24")
 * val shot = Shot(PhotoSource.of(mosaic), Lamp.read("D55"), corners)
 * SsfCalibrator.open().use { calibrator ->
 *     when (val found = calibrator.calibrate(Capture(shot, chart))) {
 *         is Calibrated -> draw(found.ssf.curve(Channel.RED), found.ssf.band(Channel.RED))
 *         is Refused -> tell(found.error.message, found.error.advice)
 *     }
 * }
 * ```
 *
 * Ownership: it holds its models in native memory and must be closed by the code that opened it. Open one and keep
 * it, or open one for each calibration. Threads: any; calls from several threads wait for each other at the model. A
 * second `close` does nothing; other calls after it throw [CalibratorClosed], an [IllegalStateException]. Results
 * belong to the caller and stay valid after `close`.
 */
public class SsfCalibrator private constructor(
    /**
     * The basis of the curves: "phones", "cameras", "ryyb", "gaussian", or "auto", which the signals choose from.
     */
    public val basis: String,
    private val engines: List<Engine>,
    private val logger: Logger?,
) : Closeable {
    override fun toString(): String = "SsfCalibrator($basis)"

    private val guard = RunGuard { engines.forEach { it.close() } }

    /** SHA-256 of each model file by its basis, lower-case hex; "auto" has three. */
    public val modelHashes: Map<String, String> =
        Collections.unmodifiableMap(engines.associate { it.basis to it.sha256 })

    /** SHA-256 of each basis, as its model states it; the engine has checked that it is the one that is given. */
    private val basisHashes = engines.associate { it.basis to it.metadata["basis_sha256 ${it.basis}"] }

    /**
     * Recovers the camera's curves from RAW photos: reads each shot's frames in turn, moves the corners to the
     * printed borders, measures the patches and solves (a few dozen model runs for one shot). Blocks: do not call it
     * on the main thread.
     *
     * @param progress called on this thread.
     * @throws InvalidArgument the call itself is wrong; every other reason for no answer is returned as a [Refused].
     * @throws InterruptedException the thread was interrupted; all resources of the run are released.
     * @throws CalibratorClosed see [close].
     */
    @JvmOverloads
    @Throws(InterruptedException::class)
    public fun calibrateBlocking(
        capture: Capture,
        settings: Settings = Settings(),
        progress: ProgressListener? = null,
    ): Calibration = guard.through {
        run(capture, settings, reporter(ProgressPlan.of(capture, settings, engines.size, prior), progress))
    }

    /**
     * Runs [calibrateBlocking] on a thread of `dispatcher`, so it may be called from the main thread. Cancelling the
     * coroutine's job interrupts that thread; the run then ends after the current row of samples or the current model
     * run. `progress` is called on that thread, not on the caller's dispatcher.
     *
     * @throws CalibratorClosed see [close].
     */
    public suspend fun calibrate(
        capture: Capture,
        settings: Settings = Settings(),
        dispatcher: CoroutineDispatcher = Dispatchers.IO,
        progress: ProgressListener? = null,
    ): Calibration {
        guard.check()
        return runInterruptible(dispatcher) { calibrateBlocking(capture, settings, progress) }
    }

    /**
     * Progress and outcome of [calibrate], which runs each time that the flow is collected. A collector that is
     * slower than the calibration receives the latest state only; the outcome is never lost.
     */
    public fun calibrationFlow(
        capture: Capture,
        settings: Settings = Settings(),
        dispatcher: CoroutineDispatcher = Dispatchers.IO,
    ): Flow<CalibrationState> = channelFlow {
        val found = calibrate(capture, settings, dispatcher) { trySend(CalibrationState.Running(it)) }
        send(CalibrationState.Finished(found))
    }.conflate()

    /**
     * Measures one shot, so that its frames can be released at once; [solve] takes several measured shots later.
     *
     * @throws CalibrationException the shot cannot be measured, or the call is wrong.
     * @throws InterruptedException the thread was interrupted; all resources of the run are released.
     */
    @Throws(InterruptedException::class)
    public fun measure(shot: Shot, chart: ChartTable): MeasuredShot = guard.through {
        interruptible { Measuring(Capture(shot, chart), reporter()).run().shots[0] }
    }

    /**
     * Computes curves, scores and verdict from measured shots.
     *
     * @param shots of one chart with one camera, from [measure] or [MeasuredCapture.fromJson].
     * @param whiteReflectance of the target in the white frames, 90 % is 0.9; null for a perfect diffuser.
     * @throws InvalidArgument the call itself is wrong.
     * @throws InterruptedException the thread was interrupted.
     */
    @JvmOverloads
    @Throws(InterruptedException::class)
    public fun solve(
        shots: List<MeasuredShot>,
        chart: ChartTable,
        whiteReflectance: Double? = null,
        settings: Settings = Settings(),
        progress: ProgressListener? = null,
    ): Calibration = guard.through {
        val partial = PartialCapture(chart, shots.map { it.lamp }, shots.frozen())
        val plan = ProgressPlan.of(partial.lamps, settings, engines.size, prior)
        refusing({ partial }) {
            finish(Measuring.joined(shots, chart, whiteReflectance), settings, reporter(plan, progress))
        }
    }

    private fun run(capture: Capture, settings: Settings, reporter: ProgressReporter): Calibration {
        val measuring = Measuring(capture, reporter)
        return refusing(measuring::partial) { finish(measuring.run(), settings, reporter) }
    }

    private fun finish(capture: MeasuredCapture, settings: Settings, reporter: ProgressReporter): Solution {
        val previous = settings.previous
        val solution = if (previous == null) {
            Solve(engines, capture, settings, reporter).run()
        } else {
            SolveWithPrevious(engines, capture, settings, reporter, previous).run()
        }
        reporter.begin(Stage.DONE)
        return solution
    }

    private fun refusing(partial: () -> PartialCapture, work: () -> Solution): Calibration =
        outcome(partial, work).also { found ->
            logger?.log("${found.verdict.outcome.word}${found.verdict.reasons.joinToString("") { ", ${it.code}" }}")
        }

    private fun outcome(partial: () -> PartialCapture, work: () -> Solution): Calibration {
        try {
            val solution = interruptible(work)
            if (solution.verdict.outcome == Status.REFUSED) {
                return Refused(Reasons.refusal(solution.verdict), solution.verdict, PartialCapture(solution.capture))
            }
            val basis = solution.ssf.basis
            return Calibrated(solution, modelHashes.getValue(basis), basisHashes[basis])
        } catch (error: Refusal) {
            return Refused(error, Verdict(Status.REFUSED, listOf(error.reason)), partial())
        }
    }

    /**
     * Ends running calls, each with [CalibratorClosed], waits until they have ended (after the current row of samples
     * or model run), and releases the models.
     *
     * A `progress` or a [Logger] may call it; it then returns without waiting, and its own run ends at the next step
     * and releases the models. They must not wait for a thread that is in this call.
     */
    override fun close(): Unit = guard.close()

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

    public companion object {
        /**
         * Names that [open] accepts: "auto"; "phones" and "cameras", learned from measured curves; "ryyb", phones
         * with yellow in green's place; "gaussian", the paper's basis.
         */
        @JvmField
        public val BASES: List<String> = (listOf(Choice.AUTO) + SHIPPED_BASES).frozen()

        /**
         * Loads the shipped model of a basis, for "auto" all but the paper's, and checks hash, grid and vocabulary.
         *
         * @param logger receives the stages and the outcome of each run; null for none.
         * @throws InvalidArgument there is no such basis, or the app contains another model than this version's.
         * @throws RuntimeUnfit ONNX Runtime is missing, or of a version that reports its use.
         */
        @JvmStatic
        @JvmOverloads
        public fun open(basis: String = "auto", logger: Logger? = null): SsfCalibrator = try {
            SsfCalibrator(basis, load(if (basis == Choice.AUTO) Choice.FAMILIES else listOf(basis)), logger)
        } catch (error: LinkageError) {
            throw RuntimeUnfit(
                "ONNX Runtime is missing or cannot load its native library (${error.message}).",
                "Add com.microsoft.onnxruntime:onnxruntime-android of version ${OnnxLibrary.VERSION}, with the " +
                    "native library of the device's ABI; on a desktop onnxruntime of the same version.",
                cause = error,
            )
        }

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
