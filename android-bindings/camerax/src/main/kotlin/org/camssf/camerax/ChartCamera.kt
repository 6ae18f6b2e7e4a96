package org.camssf.camerax

import android.content.Context
import android.hardware.camera2.CameraAccessException
import android.hardware.camera2.CameraCaptureSession
import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CameraManager
import android.hardware.camera2.CameraMetadata
import android.hardware.camera2.CaptureRequest
import android.hardware.camera2.TotalCaptureResult
import android.util.Size
import androidx.camera.camera2.interop.Camera2CameraControl
import androidx.camera.camera2.interop.Camera2CameraInfo
import androidx.camera.camera2.interop.Camera2Interop
import androidx.camera.camera2.interop.CaptureRequestOptions
import androidx.camera.core.CameraControl
import androidx.camera.core.CameraInfo
import androidx.camera.core.ImageAnalysis
import androidx.camera.core.ImageCapture
import androidx.camera.core.ImageCaptureException
import androidx.camera.core.ImageProxy
import com.google.common.util.concurrent.ListenableFuture
import kotlinx.coroutines.channels.awaitClose
import kotlinx.coroutines.flow.Flow
import kotlinx.coroutines.flow.callbackFlow
import kotlinx.coroutines.flow.conflate
import kotlinx.coroutines.flow.first
import kotlinx.coroutines.flow.map
import kotlinx.coroutines.suspendCancellableCoroutine
import org.camssf.InvalidArgument
import org.camssf.NotSensorRaw
import org.camssf.Refusal
import org.camssf.UnreadableRaw
import org.camssf.UnsupportedRaw
import org.camssf.camera2.CaptureRequirements
import org.camssf.camera2.PreviewFrames
import org.camssf.camera2.Shortfall
import org.camssf.finder.Picture
import org.camssf.finder.Plane
import org.camssf.guide.CaptureGuide
import org.camssf.guide.Guidance
import org.camssf.guide.GuidanceListener
import org.camssf.photo.Corners
import org.camssf.photo.PhotoSource
import org.camssf.photo.PreviewMap
import java.io.File
import java.util.concurrent.ExecutionException
import java.util.concurrent.Executors
import kotlin.coroutines.resume
import kotlin.coroutines.resumeWithException

/**
 * A camera of CameraX that photographs a chart: [imageCapture] is to be bound, with an [ImageAnalysis] of the app;
 * [awaitChart] guides the user by the analysis' frames, and [takeDng] takes the RAW photo.
 *
 * The chart alone can be photographed so, with automatic exposure. White and dark frames need the chart's exposure, and
 * regions of several photos are compared best with one: [lock] it.
 *
 * ```kotlin
 * suspend fun photograph(camera: ChartCamera, analysis: ImageAnalysis, capture: ImageCapture, file: File): Shot {
 *     val corners = camera.awaitChart(analysis) { println(it.words) }
 *     return Shot(camera.takeDng(capture, file), Lamp.read("daylight"), corners)
 * }
 * ```
 *
 * Ownership: it holds nothing that must be closed; binding and unbinding are the app's. Threads: any, also the main one.
 *
 * @param context any context of the app; it is not kept.
 * @param camera from `CameraProvider.getCameraInfo`, or of the bound camera. A camera of several lenses
 *   (`isLogicalMultiCameraSupported`) may change the lens between two photos: bind one of its physical cameras.
 * @throws CameraAccessException the camera service does not answer.
 */
public class ChartCamera @Throws(CameraAccessException::class) constructor(
    context: Context,
    private val camera: CameraInfo,
) {
    /** Camera2's description of the camera, for [PreviewFrames.view]. */
    public val characteristics: CameraCharacteristics =
        (context.getSystemService(Context.CAMERA_SERVICE) as CameraManager)
            .getCameraCharacteristics(Camera2CameraInfo.from(camera).cameraId)

    /** Camera2's result of the latest photo; CameraX does not hand it out. */
    @Volatile
    private var result: TotalCaptureResult? = null

    /** Settings of the latest photo that differ from the wanted ones; none of them is fatal. */
    @Volatile
    public var shortfalls: List<Shortfall> = emptyList()
        private set

    override fun toString(): String = "ChartCamera($shortfalls)"

    /**
     * Creates the use case of RAW photos: without flash, and with the settings of [CaptureRequirements] that the camera
     * offers.
     *
     * @param builder with the app's own settings, if any.
     * @throws UnsupportedRaw CameraX offers no RAW photos of this camera.
     */
    @JvmOverloads
    public fun imageCapture(builder: ImageCapture.Builder = ImageCapture.Builder()): ImageCapture {
        val formats = ImageCapture.getImageCaptureCapabilities(camera).supportedOutputFormats
        if (ImageCapture.OUTPUT_FORMAT_RAW !in formats) {
            throw Refusal.of("unsupported_raw.no_raw_camera")
        }
        val camera2 = Camera2Interop.Extender(builder).setSessionCaptureCallback(StillResult())
        CaptureRequirements.settings(characteristics).forEach { camera2.setCaptureRequestOption(it.key, it.value) }
        return builder.setOutputFormat(ImageCapture.OUTPUT_FORMAT_RAW)
            .setCaptureMode(ImageCapture.CAPTURE_MODE_MAXIMIZE_QUALITY)
            .setFlashMode(ImageCapture.FLASH_MODE_OFF)
            .build()
    }

    /**
     * The guidance of an analysis' frames, as long as the flow is collected: it sets the analyzer, and clears it at the
     * end. Frames are searched on a thread of its own. A collector that is slower than the camera receives the latest
     * guidance only.
     *
     * @param analysis bound with this camera, in CameraX's default format (YUV_420_888) and without rotated output.
     */
    public fun guidance(analysis: ImageAnalysis): Flow<Guidance> = frames(analysis).map { it.guidance }.conflate()

    /**
     * Guides the user until the guide says "now", and returns the chart's corners in the RAW photo, in pixels of its
     * active area. Take the photo at once: a calibration corrects the corners by half a patch, not more.
     *
     * @param analysis as for [guidance].
     * @param listener receives each frame's guidance in the caller's coroutine, the last one too.
     */
    public suspend fun awaitChart(
        analysis: ImageAnalysis,
        listener: GuidanceListener = GuidanceListener { },
    ): Corners = frames(analysis).conflate().first {
        listener.guide(it.guidance)
        it.ready
    }.corners()

    /**
     * Takes a photo and writes it as a DNG, which CameraX does by the platform's own writer. If the coroutine is
     * cancelled, the file may still be written.
     *
     * @param capture from [imageCapture], bound.
     * @param file is overwritten; the app deletes it after the calibration.
     * @return the photo, for a `Shot`.
     * @throws UnreadableRaw CameraX took no photo, or could not write it; the cause says why.
     * @throws NotSensorRaw a test pattern or noise reduction changed the samples, although the camera can do without.
     */
    public suspend fun takeDng(capture: ImageCapture, file: File): PhotoSource {
        result = null
        suspendCancellableCoroutine { waiting ->
            val saved = object : ImageCapture.OnImageSavedCallback {
                override fun onImageSaved(results: ImageCapture.OutputFileResults) = waiting.resume(Unit)

                override fun onError(exception: ImageCaptureException) {
                    waiting.resumeWithException(
                        Refusal.of(
                            "unreadable_raw.no_capture", "detail" to exception.message.orEmpty(), cause = exception,
                        ),
                    )
                }
            }
            capture.takePicture(ImageCapture.OutputFileOptions.Builder(file).build(), Runnable::run, saved)
        }
        val found = result?.let { CaptureRequirements.check(it, characteristics) } ?: listOf(UNCHECKED)
        found.firstOrNull { it.fatal }?.let {
            throw Refusal.of(
                "not_sensor_raw.setting", "setting" to it.key, "state" to it.found, "advice" to it.advice,
            )
        }
        shortfalls = found
        return PhotoSource.of(file)
    }

    /**
     * Locks exposure time, ISO and white balance of all frames and photos, as far as the camera offers it
     * ([CaptureRequirements.locks]). Returns when frames have these settings; other options of the app's
     * [Camera2CameraControl] are replaced. If CameraX gives up, since the camera was closed or other options were set,
     * its own exception is thrown.
     *
     * @param control of the bound camera.
     * @param exposureTime ns.
     * @param iso sensitivity.
     * @return what the camera cannot lock; if one of it is fatal, nothing was locked.
     */
    public suspend fun lock(control: CameraControl, exposureTime: Long, iso: Int): List<Shortfall> {
        val unlocked = CaptureRequirements.checkLocks(characteristics, exposureTime, iso)
        if (unlocked.any { it.fatal }) return unlocked
        val options = CaptureRequestOptions.Builder()
        for ((key, value) in CaptureRequirements.locks(characteristics, exposureTime, iso)) {
            @Suppress("UNCHECKED_CAST") // each value has its key's type
            options.setCaptureRequestOption(key as CaptureRequest.Key<Any>, value)
        }
        finished(Camera2CameraControl.from(control).setCaptureRequestOptions(options.build()))
        return unlocked
    }

    /**
     * Makes exposure and white balance automatic again; other options of the app's [Camera2CameraControl] are cleared,
     * too. Exceptions as of [lock].
     *
     * @param control of the bound camera.
     */
    public suspend fun unlock(control: CameraControl) {
        finished(Camera2CameraControl.from(control).clearCaptureRequestOptions())
    }

    private suspend fun finished(future: ListenableFuture<Void>) = suspendCancellableCoroutine { waiting ->
        val listener = Runnable {
            try {
                future.get()
                waiting.resume(Unit)
            } catch (error: ExecutionException) {
                waiting.resumeWithException(error.cause ?: error)
            }
        }
        future.addListener(listener, Runnable::run)
    }

    /** Keeps the result of each photo; the callback is called for the preview's frames, too. */
    private inner class StillResult : CameraCaptureSession.CaptureCallback() {
        override fun onCaptureCompleted(
            session: CameraCaptureSession,
            request: CaptureRequest,
            total: TotalCaptureResult,
        ) {
            val intent = request.get(CaptureRequest.CONTROL_CAPTURE_INTENT)
            if (intent == CameraMetadata.CONTROL_CAPTURE_INTENT_STILL_CAPTURE) result = total
        }
    }

    private companion object {
        val UNCHECKED = Shortfall(
            "TotalCaptureResult",
            "missing",
            "the photo's",
            fatal = false,
            "Nothing shows whether noise reduction, a test pattern or the flash changed the samples. Bind the use " +
                "case of imageCapture() and take the photo again; if it stays so, photograph with Camera2 (RawFrames).",
        )
    }

    /** A frame's guidance, and the map from the frame to the mosaic. */
    private class Frame(val guidance: Guidance, private val map: PreviewMap) {
        val ready: Boolean get() = guidance is Guidance.Measured && guidance.ready

        fun corners(): Corners = map.toMosaic((guidance as Guidance.Measured).measures.candidate.corners)
    }

    private fun frames(analysis: ImageAnalysis): Flow<Frame> = callbackFlow {
        if (analysis.isOutputImageRotationEnabled) {
            throw InvalidArgument(
                "The analysis rotates its frames.",
                "Leave setOutputImageRotationEnabled out: the guide needs the sensor's orientation.",
            )
        }
        val guide = CaptureGuide(PreviewFrames.focal(characteristics) * zoom())
        val worker = Executors.newSingleThreadExecutor()
        analysis.setAnalyzer(worker) { image ->
            try {
                trySend(image.use { frame(it, guide) })
            } catch (error: InvalidArgument) {
                close(error)
            }
        }
        awaitClose {
            analysis.clearAnalyzer()
            worker.shutdown()
        }
    }

    private fun frame(image: ImageProxy, guide: CaptureGuide): Frame {
        val planes = image.planes.map { Plane(it.buffer, it.rowStride, it.pixelStride) }
        if (planes.size != 3) {
            throw InvalidArgument(
                "The analysis' frames have ${planes.size} planes.",
                "Leave setOutputImageFormat out: the guide needs YUV_420_888.",
            )
        }
        val picture = Picture.yuv(planes[0], planes[1], planes[2], image.width, image.height)
        val size = Size(image.width, image.height)
        return Frame(
            guide.look(picture, image.imageInfo.timestamp),
            PreviewFrames.map(characteristics, size, zoom = zoom()),
        )
    }

    private fun zoom(): Double = camera.zoomState.value?.zoomRatio?.toDouble() ?: 1.0
}
