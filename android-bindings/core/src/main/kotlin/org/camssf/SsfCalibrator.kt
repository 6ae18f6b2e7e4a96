package org.camssf

import kotlinx.coroutines.Dispatchers
import kotlinx.coroutines.ensureActive
import kotlinx.coroutines.withContext
import org.camssf.curves.Choice
import org.camssf.curves.Engine
import org.camssf.curves.OnnxEngine
import org.camssf.curves.SHIPPED_BASES
import org.camssf.documents.Solution
import org.camssf.evidence.Reason
import org.camssf.evidence.Reasons
import org.camssf.evidence.Status
import org.camssf.evidence.Verdict
import org.camssf.photo.Begun
import org.camssf.photo.Capture
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Measuring
import org.camssf.photo.Shot
import org.camssf.spectra.ChartTable
import java.io.Closeable
import java.io.InterruptedIOException
import java.net.SocketTimeoutException
import java.nio.channels.ClosedByInterruptException
import java.util.Collections
import java.util.concurrent.CancellationException

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
 * nothing; calls after it throw [IllegalStateException]. Results belong to the caller and outlive it.
 */
public class SsfCalibrator private constructor(
    /** The basis of the curves: "auto", phones or cameras as the signals say; "phones", "cameras", or "gaussian". */
    public val basis: String,
    private val engines: List<Engine>,
) : Closeable {
    @Volatile
    private var closed = false

    /** SHA-256 of the model files by their bases, lower-case hex: of "auto" two. */
    public val modelHashes: Map<String, String> =
        Collections.unmodifiableMap(engines.associate { it.basis to it.sha256 })

    /** SHA-256 of the model file, of "auto" that of phones. */
    @Deprecated("There may be two models. Goes with the next release.", ReplaceWith("modelHashes"))
    public val modelSha256: String get() = engines[0].sha256

    /**
     * From RAW photos to the camera's curves: reads each shot's frames in turn, moves the corners to the printed borders,
     * measures the patches and solves (a few dozen runs of a model for one shot). Blocks: not for the main thread.
     *
     * @param progress called on this thread.
     * @throws InvalidArgument the call itself is wrong; every other reason why there is no answer is a [Refused].
     * @throws InterruptedException if the thread is interrupted; nothing is left behind.
     */
    @JvmOverloads
    @Throws(InterruptedException::class)
    public fun calibrate(
        capture: Capture,
        settings: Settings = Settings(),
        progress: Progress? = null,
    ): Calibration {
        checkOpen()
        return run(capture, settings, blocking(progress))
    }

    /**
     * [calibrate] on [Dispatchers.IO], as it reads files and may wait at the model; cancelling its job ends it at the
     * next step. `progress` is called there, not on the caller's dispatcher.
     */
    public suspend fun calibrateSuspending(
        capture: Capture,
        settings: Settings = Settings(),
        progress: Progress? = null,
    ): Calibration {
        checkOpen()
        return withContext(Dispatchers.IO) {
            run(capture, settings) { stage, part ->
                ensureActive()
                progress?.report(stage, part)
            }
        }
    }

    /**
     * Measures one shot, so that its frames can be let go at once; [solve] takes several of them later.
     *
     * @throws CalibrationException the shot carries no answer, or the call is wrong.
     * @throws InterruptedException if the thread is interrupted; nothing is left behind.
     */
    @Throws(InterruptedException::class)
    public fun measure(shot: Shot, chart: ChartTable): MeasuredShot {
        checkOpen()
        return interruptible { Measuring(Capture(shot, chart), blocking(null)).run().shots[0] }
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
    ): Calibration {
        checkOpen()
        val begun = Begun(chart, shots.map { it.lamp }, shots.frozen())
        return refusing({ begun }) {
            val capture = Measuring.joined(shots, chart, whiteReflectance)
            finish(capture, settings, blocking(progress))
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

    private fun refusing(begun: () -> Begun, work: () -> Solution): Calibration {
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

    private fun checkOpen() = check(!closed) { "This SsfCalibrator was closed. Open another." }

    /** Releases the models; waits for a run that is in work. */
    override fun close() {
        closed = true
        engines.forEach { it.close() }
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
         * @throws InvalidArgument there is no such basis, the app carries another model than this version's, or ONNX
         *   Runtime is missing.
         */
        @JvmStatic
        @JvmOverloads
        public fun open(basis: String = "auto"): SsfCalibrator = try {
            SsfCalibrator(basis, load(if (basis == Choice.AUTO) Choice.FAMILIES else listOf(basis)))
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

        private fun blocking(progress: Progress?): Tell = { stage, part ->
            if (Thread.interrupted()) throw InterruptedException("The calibration was interrupted.")
            progress?.report(stage, part)
        }

        /** An interrupt that ended a read comes out as one, whatever the read made of it; the flag is cleared. */
        private fun <T> interruptible(work: () -> T): T = try {
            work()
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
