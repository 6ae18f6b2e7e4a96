package org.camssf

import kotlinx.coroutines.CoroutineDispatcher
import kotlinx.coroutines.Dispatchers
import kotlinx.coroutines.runInterruptible
import org.camssf.documents.Solution
import org.camssf.photo.Begun
import org.camssf.photo.Capture
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Measuring
import org.camssf.photo.Shot
import org.camssf.recovery.Choice
import org.camssf.recovery.Engine
import org.camssf.recovery.OnnxEngine
import org.camssf.recovery.SHIPPED_BASES
import org.camssf.spectra.ChartTable
import org.camssf.verdict.Reason
import org.camssf.verdict.Reasons
import org.camssf.verdict.Status
import org.camssf.verdict.Verdict
import java.io.Closeable
import java.io.InterruptedIOException
import java.net.SocketTimeoutException
import java.nio.channels.ClosedByInterruptException
import java.util.Collections
import java.util.concurrent.CancellationException

/** Takes a line of what is done, and how long it took: for an app's own log. Called on the thread that calibrates. */
public fun interface Logger {
    /** One line, without a place or a time; files are named as their sources name them. */
    public fun log(line: String)
}

/**
 * Recovers a camera's spectral sensitivity from photos of a ColorChecker, on this device; nothing leaves it.
 *
 * ```
 * val chart = ChartTable.read("classic24")
 * val shot = Shot(PhotoSource.of(mosaic), Lamp.read("D55"), corners)
 * SsfCalibrator.open().use { calibrator ->
 *     when (val found = calibrator.calibrate(Capture(shot, chart))) {
 *         is Calibrated -> draw(found.ssf.curve(0), found.ssf.band(0))
 *         is Refused -> tell(found.error.message, found.error.advice)
 *     }
 * }
 * ```
 *
 * Ownership: it holds its models in native memory; who opens it closes it. Open one and keep it, or open one for each
 * calibration. Threads: any; calls from several threads wait for each other at the model. A second `close` does
 * nothing; calls after it throw [CalibratorClosed], an [IllegalStateException]. Results belong to the caller and outlive
 * it.
 */
public class SsfCalibrator private constructor(
    /** The basis of the curves: "auto", phones or cameras as the signals say; "phones", "cameras", or "gaussian". */
    public val basis: String,
    private val engines: List<Engine>,
    private val logger: Logger?,
) : Closeable {
    private val gate = Gate { engines.forEach { it.close() } }

    /** SHA-256 of the model files by their bases, lower-case hex: of "auto" two. */
    public val modelHashes: Map<String, String> =
        Collections.unmodifiableMap(engines.associate { it.basis to it.sha256 })

    /**
     * From RAW photos to the camera's curves: reads each shot's frames in turn, moves the corners to the printed borders,
     * measures the patches and solves (a few dozen runs of a model for one shot). Blocks: not for the main thread.
     *
     * @param progress called on this thread.
     * @throws InvalidArgument the call itself is wrong; every other reason why there is no answer is a [Refused].
     * @throws InterruptedException if the thread is interrupted; nothing is left behind.
     * @throws CalibratorClosed see [close].
     */
    @JvmOverloads
    @Throws(InterruptedException::class)
    public fun calibrate(
        capture: Capture,
        settings: Settings = Settings(),
        progress: Progress? = null,
    ): Calibration = gate.through { run(capture, settings, tell(progress)) }

    /**
     * [calibrate] on a thread of `dispatcher`, as it reads files and may wait at the model. Cancelling its job
     * interrupts that thread and ends the run within the row of samples, or the run of the model, that is in work.
     * `progress` is called there, not on the caller's dispatcher.
     *
     * @throws CalibratorClosed see [close].
     */
    public suspend fun calibrateSuspending(
        capture: Capture,
        settings: Settings = Settings(),
        dispatcher: CoroutineDispatcher = Dispatchers.IO,
        progress: Progress? = null,
    ): Calibration {
        gate.check()
        return runInterruptible(dispatcher) { calibrate(capture, settings, progress) }
    }

    /**
     * Measures one shot, so that its frames can be let go at once; [solve] takes several of them later.
     *
     * @throws CalibrationException the shot carries no answer, or the call is wrong.
     * @throws InterruptedException if the thread is interrupted; nothing is left behind.
     */
    @Throws(InterruptedException::class)
    public fun measure(shot: Shot, chart: ChartTable): MeasuredShot = gate.through {
        interruptible { Measuring(Capture(shot, chart), tell(null)).run().shots[0] }
    }

    /**
     * From measured shots to curves, scores and verdict.
     *
     * @param shots of one chart with one camera, as [measure] gave them.
     * @param whiteReflectance of the white frames' card; null for a perfect diffuser.
     * @throws InvalidArgument the call itself is wrong.
     * @throws InterruptedException if the thread is interrupted.
     */
    @JvmOverloads
    @Throws(InterruptedException::class)
    public fun solve(
        shots: List<MeasuredShot>,
        chart: ChartTable,
        whiteReflectance: Double? = null,
        settings: Settings = Settings(),
        progress: Progress? = null,
    ): Calibration = gate.through {
        val begun = Begun(chart, shots.map { it.lamp }, shots.frozen())
        refusing({ begun }) {
            finish(Measuring.joined(shots, chart, whiteReflectance), settings, tell(progress))
        }
    }

    private fun run(capture: Capture, settings: Settings, tell: Tell): Calibration {
        val measuring = Measuring(capture, tell)
        return refusing(measuring::begun) { finish(measuring.run(), settings, tell) }
    }

    private fun finish(capture: MeasuredCapture, settings: Settings, tell: Tell): Solution {
        val solution = Solve(engines, capture, settings, tell).run()
        tell("done", 1.0)
        return solution
    }

    private fun refusing(begun: () -> Begun, work: () -> Solution): Calibration =
        outcome(begun, work).also { found ->
            logger?.log("${found.verdict.outcome.word}${found.verdict.reasons.joinToString("") { ", ${it.code}" }}")
        }

    private fun outcome(begun: () -> Begun, work: () -> Solution): Calibration {
        try {
            val solution = interruptible(work)
            if (solution.verdict.outcome == Status.REFUSED) {
                return Refused(Reasons.refusal(solution.verdict), solution.verdict, begun())
            }
            return Calibrated(solution, modelHashes.getValue(solution.ssf.basis))
        } catch (error: InvalidArgument) {
            throw error
        } catch (error: CalibrationException) {
            val reason = Reason(error.code, error.message, error.advice, error.value, error.threshold)
            return Refused(error, Verdict(Status.REFUSED, listOf(reason)), begun())
        }
    }

    /**
     * Ends runs that are in work, each with [CalibratorClosed], waits until they have ended (a row of samples, or a run
     * of the model), and releases the models.
     *
     * A `progress` or a [Logger] may call it: then its own run ends at the next step, and releases the models itself. They
     * must not wait for a thread that is in this call.
     */
    override fun close(): Unit = gate.close()

    /** Tells `progress` and the logger, and looks whether anybody still waits. */
    private fun tell(progress: Progress?): Tell = object : Tell {
        private var before: String? = null
        private var since = 0L

        override fun invoke(stage: String, part: Double) {
            check()
            if (logger != null) {
                val now = System.nanoTime()
                before?.let { logger.log("$it: ${(now - since) / 1_000_000} ms") }
                before = stage
                since = now
            }
            progress?.report(stage, part)
        }

        override fun check() {
            checkInterrupt()
            gate.check()
        }
    }

    public companion object {
        /**
         * Bases that [open] knows: "auto", "phones" and "cameras" learned from measured ones, "gaussian" the paper's.
         */
        @JvmField
        public val BASES: List<String> = (listOf(Choice.AUTO) + SHIPPED_BASES).frozen()

        /**
         * Loads the shipped model of a basis, for "auto" those of phones and cameras, and checks hash, grid and
         * vocabulary.
         *
         * @param logger told what each run does, and refusals; null for none.
         * @throws InvalidArgument there is no such basis, the app carries another model than this version's, or ONNX
         *   Runtime is missing.
         */
        @JvmStatic
        @JvmOverloads
        public fun open(basis: String = "auto", logger: Logger? = null): SsfCalibrator = try {
            SsfCalibrator(basis, load(if (basis == Choice.AUTO) Choice.FAMILIES else listOf(basis)), logger)
        } catch (error: LinkageError) {
            throw InvalidArgument(
                "ONNX Runtime is missing or cannot load its native library (${error.message}).",
                "Add com.microsoft.onnxruntime:onnxruntime-android of version 1.28.0, with the native library " +
                    "of the device's ABI; on a desktop onnxruntime of the same version.",
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

        /** An interrupt that ended a read comes out as one, whatever the read made of it; the flag is cleared. */
        private fun <T> interruptible(work: () -> T): T = try {
            work()
        } catch (error: OutOfMemoryError) {
            val most = Runtime.getRuntime().maxMemory() shr 20
            val message = "The calibration needs more than the $most MB that this process may use."
            throw OutOfMemory(message, OutOfMemory.ADVICE, most.toDouble(), null, error)
        } catch (error: Exception) {
            if (error is InterruptedException || error is CancellationException || !interrupt(error)) throw error
            Thread.interrupted()
            throw InterruptedException("The calibration was interrupted.").apply { initCause(error) }
        }

        private fun interrupt(error: Throwable): Boolean = generateSequence(error) { it.cause }.take(DEEPEST).any {
            it is ClosedByInterruptException || it is InterruptedException ||
                (it is InterruptedIOException && it !is SocketTimeoutException)
        }

        /** Causes that are looked at: a chain may run in a circle. */
        private const val DEEPEST = 16
    }
}
