package org.camssf.camerax

import android.content.Context
import android.graphics.Rect
import android.hardware.camera2.CameraCaptureSession
import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CameraManager
import android.hardware.camera2.CameraMetadata
import android.hardware.camera2.CaptureRequest
import android.hardware.camera2.CaptureResult
import android.hardware.camera2.TotalCaptureResult
import android.util.Range
import android.util.SizeF
import androidx.camera.camera2.interop.Camera2CameraControl
import androidx.camera.camera2.interop.Camera2CameraInfo
import androidx.camera.camera2.interop.Camera2Interop
import androidx.camera.camera2.interop.CaptureRequestOptions
import androidx.camera.core.CameraControl
import androidx.camera.core.CameraInfo
import androidx.camera.core.ImageAnalysis
import androidx.camera.core.ImageCapture
import androidx.camera.core.ImageCaptureCapabilities
import androidx.camera.core.ImageCaptureException
import androidx.camera.core.ImageProxy
import androidx.camera.core.ZoomState
import androidx.lifecycle.LiveData
import com.google.common.util.concurrent.ListenableFuture
import kotlinx.coroutines.flow.first
import kotlinx.coroutines.runBlocking
import org.camssf.Channel
import org.camssf.InvalidArgument
import org.camssf.NotSensorRaw
import org.camssf.Recovered
import org.camssf.SsfCalibrator
import org.camssf.UnreadableRaw
import org.camssf.UnsupportedRaw
import org.camssf.guide.Guidance
import org.camssf.photo.Capture
import org.camssf.photo.Corners
import org.camssf.photo.Point
import org.camssf.photo.Shot
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.Assert.assertEquals
import org.junit.Assert.assertSame
import org.junit.Assert.assertThrows
import org.junit.Assert.assertTrue
import org.junit.Rule
import org.junit.Test
import org.junit.rules.TemporaryFolder
import org.junit.runner.RunWith
import org.mockito.ArgumentCaptor
import org.mockito.ArgumentMatchers.any
import org.mockito.Mockito.RETURNS_SELF
import org.mockito.Mockito.mock
import org.mockito.Mockito.mockConstruction
import org.mockito.Mockito.mockStatic
import org.mockito.Mockito.never
import org.mockito.Mockito.verify
import org.mockito.Mockito.`when`
import org.mockito.Mockito.withSettings
import org.robolectric.RobolectricTestRunner
import org.robolectric.annotation.Config
import java.io.File
import java.util.concurrent.ExecutionException
import java.util.concurrent.Executor
import kotlin.math.abs

/** On stubs of CameraX's signatures and Mockito: what is called of CameraX and what is made of what it gives. */
@RunWith(RobolectricTestRunner::class)
@Config(sdk = [35])
class ChartCameraTest {
    @get:Rule
    val folder = TemporaryFolder()

    /** The sensor of golden/dng/chart-turned-0.dng, whose preview has 640 × 480 pixels. */
    private val values = hashMapOf<CameraCharacteristics.Key<*>, Any?>(
        CameraCharacteristics.SENSOR_INFO_PRE_CORRECTION_ACTIVE_ARRAY_SIZE to Rect(0, 0, 180, 135),
        CameraCharacteristics.NOISE_REDUCTION_AVAILABLE_NOISE_REDUCTION_MODES to intArrayOf(0, 1),
        CameraCharacteristics.STATISTICS_INFO_AVAILABLE_LENS_SHADING_MAP_MODES to intArrayOf(0, 1),
        CameraCharacteristics.LENS_INFO_AVAILABLE_FOCAL_LENGTHS to floatArrayOf(2f),
        CameraCharacteristics.SENSOR_INFO_PHYSICAL_SIZE to SizeF(6f, 4.5f),
    )
    private val info = mock(CameraInfo::class.java)
    private val chart = Corners.of(22.44, 17.44, 156.56, 22.44, 162.56, 116.56, 16.44, 109.56)
    private val photo = File(System.getProperty("camssf.root"), "golden/dng/chart-turned-0.dng")

    private fun camera(zoom: Float = 1f): ChartCamera {
        val characteristics = mock(CameraCharacteristics::class.java) { call ->
            if (call.method.name == "get") values[call.arguments[0]] else null
        }
        val manager = mock(CameraManager::class.java)
        `when`(manager.getCameraCharacteristics("2")).thenReturn(characteristics)
        val context = mock(Context::class.java)
        `when`(context.getSystemService(Context.CAMERA_SERVICE)).thenReturn(manager)
        val state = mock(ZoomState::class.java)
        `when`(state.zoomRatio).thenReturn(zoom)
        @Suppress("UNCHECKED_CAST")
        val live = mock(LiveData::class.java) as LiveData<ZoomState>
        `when`(live.value).thenReturn(state)
        `when`(info.zoomState).thenReturn(live)
        val own = mock(Camera2CameraInfo::class.java)
        `when`(own.cameraId).thenReturn("2")
        return mockStatic(Camera2CameraInfo::class.java).use { static ->
            static.`when`<Camera2CameraInfo> { Camera2CameraInfo.from(info) }.thenReturn(own)
            ChartCamera(context, info)
        }
    }

    /** An analysis that hands these frames to its analyzer, on the analyzer's executor. */
    private fun analysis(vararg frames: ImageProxy): ImageAnalysis {
        val analysis = mock(ImageAnalysis::class.java)
        `when`(analysis.setAnalyzer(any(), any())).thenAnswer { call ->
            val (executor, analyzer) = call.getArgument<Executor>(0) to call.getArgument<ImageAnalysis.Analyzer>(1)
            for (frame in frames) executor.execute { analyzer.analyze(frame) }
        }
        return analysis
    }

    private fun seen(zoom: Double = 1.0): Corners {
        val scale = 640 / 180.0
        fun place(point: Point) = Point(
            320 + zoom * scale * (point.x + 0.5 - 90) - 0.5,
            240 + zoom * scale * (point.y + 0.5 - 67.5) - 0.5,
        )
        return Corners(place(chart.topLeft), place(chart.topRight), place(chart.bottomRight), place(chart.bottomLeft))
    }

    @Test
    fun `from a bound camera to curves`(): Unit = runBlocking {
        val camera = camera()
        val painted = Painted(seen())
        val frames = Array(40) { painted.image(33_333_333L * it) }
        val analysis = analysis(Painted(null).image(-33_333_333L), *frames)
        val guidance = ArrayList<Guidance>()
        val corners = camera.awaitChart(analysis) { guidance += it }
        assertTrue("$guidance", (guidance.last() as Guidance.Measured).ready)
        verify(analysis).clearAnalyzer()
        verify(frames[0]).close()
        for ((wanted, found) in listOf(chart.topLeft to corners.topLeft, chart.bottomRight to corners.bottomRight)) {
            assertTrue("$corners", abs(wanted.x - found.x) < 3 && abs(wanted.y - found.y) < 3)
        }
        val file = File(folder.root, "chart.dng")
        val source = camera.takeDng(capture { photo.copyTo(file) }, file)
        val shot = Shot(source, Lamp.read("D55"), corners)
        val found = SsfCalibrator.open().use { it.calibrate(Capture(shot, ChartTable.read("classic24"))) }
        assertTrue("$found", found is Recovered && found.curve(Channel.RED).at(600.0) > 0.1)
    }

    @Test
    fun `zoom is undone`(): Unit = runBlocking {
        val painted = Painted(seen(zoom = 1.1))
        val analysis = analysis(*Array(40) { painted.image(33_333_333L * it) })
        val corners = camera(zoom = 1.1f).awaitChart(analysis)
        assertTrue("$corners", abs(corners.topLeft.x - chart.topLeft.x) < 3)
    }

    @Test
    fun `guidance is a flow, and other frames end it`(): Unit = runBlocking {
        val empty = Painted(null).image(5)
        val analysis = analysis(empty)
        assertTrue(camera().guidance(analysis).first() is Guidance.Searching)
        verify(analysis).clearAnalyzer()
        val rgba = mock(ImageProxy::class.java)
        `when`(rgba.planes).thenReturn(arrayOf())
        val failed = runCatching { camera().guidance(analysis(rgba)).first() }
        assertTrue("$failed", failed.exceptionOrNull() is InvalidArgument)
        verify(rgba).close()
        val rotated = analysis(empty)
        `when`(rotated.isOutputImageRotationEnabled).thenReturn(true)
        assertTrue(runCatching { camera().guidance(rotated).first() }.exceptionOrNull() is InvalidArgument)
        verify(rotated, never()).setAnalyzer(any(), any())
    }

    private fun capture(take: (ImageCapture.OnImageSavedCallback) -> Unit): ImageCapture {
        val capture = mock(ImageCapture::class.java)
        `when`(capture.takePicture(any(), any(), any())).thenAnswer { call ->
            val callback = call.getArgument<ImageCapture.OnImageSavedCallback>(2)
            take(callback)
            call.getArgument<Executor>(1).execute {
                callback.onImageSaved(mock(ImageCapture.OutputFileResults::class.java))
            }
        }
        return capture
    }

    /** The use case, and the callback by which Camera2's results come. */
    private fun bound(camera: ChartCamera, formats: Set<Int> = setOf(0, 2)): CameraCaptureSession.CaptureCallback {
        val capabilities = mock(ImageCaptureCapabilities::class.java)
        `when`(capabilities.supportedOutputFormats).thenReturn(formats)
        val builder = mock(ImageCapture.Builder::class.java, RETURNS_SELF)
        val built = mock(ImageCapture::class.java)
        `when`(builder.build()).thenReturn(built)
        return mockStatic(ImageCapture::class.java).use { static ->
            static.`when`<ImageCaptureCapabilities> { ImageCapture.getImageCaptureCapabilities(info) }
                .thenReturn(capabilities)
            val settings = withSettings().defaultAnswer(RETURNS_SELF)
            mockConstruction(Camera2Interop.Extender::class.java, settings).use { extenders ->
                assertSame(built, camera.imageCapture(builder))
                val camera2 = extenders.constructed().single()
                verify(builder).setOutputFormat(ImageCapture.OUTPUT_FORMAT_RAW)
                verify(builder).setFlashMode(ImageCapture.FLASH_MODE_OFF)
                verify(camera2).setCaptureRequestOption(CaptureRequest.NOISE_REDUCTION_MODE, 0)
                verify(camera2).setCaptureRequestOption(CaptureRequest.STATISTICS_LENS_SHADING_MAP_MODE, 1)
                val callback = ArgumentCaptor.forClass(CameraCaptureSession.CaptureCallback::class.java)
                verify(camera2).setSessionCaptureCallback(callback.capture())
                callback.value
            }
        }
    }

    private fun completed(callback: CameraCaptureSession.CaptureCallback, intent: Int, noise: Int) {
        val request = mock(CaptureRequest::class.java)
        `when`(request.get(CaptureRequest.CONTROL_CAPTURE_INTENT)).thenReturn(intent)
        val result = mock(TotalCaptureResult::class.java)
        `when`(result.get(CaptureResult.NOISE_REDUCTION_MODE)).thenReturn(noise)
        callback.onCaptureCompleted(mock(CameraCaptureSession::class.java), request, result)
    }

    @Test
    fun `the use case is of RAW photos without noise reduction`() {
        val camera = camera()
        bound(camera)
        assertThrows(UnsupportedRaw::class.java) { bound(camera, formats = setOf(0)) }
    }

    @Test
    fun `a photo whose samples were changed is refused, and other shortfalls are listed`(): Unit = runBlocking {
        val camera = camera()
        val callback = bound(camera)
        val (still, preview) =
            CameraMetadata.CONTROL_CAPTURE_INTENT_STILL_CAPTURE to CameraMetadata.CONTROL_CAPTURE_INTENT_PREVIEW
        val file = File(folder.root, "chart.dng")
        val smoothed = capture { completed(callback, still, noise = 1) }
        assertTrue(runCatching { camera.takeDng(smoothed, file) }.exceptionOrNull() is NotSensorRaw)
        val good = capture {
            completed(callback, still, noise = 0)
            completed(callback, preview, noise = 1)
        }
        camera.takeDng(good, file)
        assertTrue("$camera", camera.shortfalls.any { it.key == "control.aeMode" })
        assertTrue("$camera", camera.shortfalls.none { it.fatal })
        camera.takeDng(capture { }, file) // CameraX gave no result: nothing is known of the settings
        val silent = camera.shortfalls.single()
        assertEquals("TotalCaptureResult is missing", "$silent".substringBefore(','))
        assertTrue("$silent", !silent.fatal && "noise reduction" in silent.advice)
    }

    /** What CameraX answers when options were set: nothing, or that it gave up. */
    private fun answer(failure: Exception? = null): ListenableFuture<Void> {
        @Suppress("UNCHECKED_CAST")
        val future = mock(ListenableFuture::class.java) as ListenableFuture<Void>
        `when`(future.get()).thenAnswer { failure?.let { throw ExecutionException(it) } }
        `when`(future.addListener(any(), any())).thenAnswer { call ->
            call.getArgument<Executor>(1).execute(call.getArgument(0))
        }
        return future
    }

    /** What a call with a bound camera's control returned, and what CameraX was told: options by Camera2's names. */
    private data class Told<T>(val returned: T, val options: Map<String, Any>, val interop: Camera2CameraControl)

    private fun <T> told(future: ListenableFuture<Void>, call: suspend (CameraControl) -> T): Told<T> {
        val control = mock(CameraControl::class.java)
        val interop = mock(Camera2CameraControl::class.java)
        `when`(interop.setCaptureRequestOptions(any())).thenReturn(future)
        `when`(interop.clearCaptureRequestOptions()).thenReturn(future)
        val options = HashMap<String, Any>()
        val settings = withSettings().defaultAnswer { set ->
            if (set.method.name == "build") return@defaultAnswer mock(CaptureRequestOptions::class.java)
            options[set.getArgument<CaptureRequest.Key<*>>(0).name.substringAfter("android.")] = set.arguments[1]
            set.mock
        }
        mockStatic(Camera2CameraControl::class.java).use { static ->
            static.`when`<Camera2CameraControl> { Camera2CameraControl.from(control) }.thenReturn(interop)
            mockConstruction(CaptureRequestOptions.Builder::class.java, settings).use {
                return Told(runBlocking { call(control) }, options, interop)
            }
        }
    }

    @Test
    fun `exposure and white balance are locked and unlocked, and what cannot be is said`() {
        values[CameraCharacteristics.CONTROL_AE_LOCK_AVAILABLE] = true
        val camera = camera()
        val (automatic, kept, _) = told(answer()) { camera.lock(it, 10_000_000L, 100) }
        assertEquals(listOf("capability MANUAL_SENSOR", "control.awbLockAvailable"), automatic.map { it.key })
        assertEquals(mapOf("control.aeLock" to true), kept)
        values[CameraCharacteristics.CONTROL_AWB_LOCK_AVAILABLE] = true
        values[CameraCharacteristics.REQUEST_AVAILABLE_CAPABILITIES] = intArrayOf(1)
        values[CameraCharacteristics.SENSOR_INFO_EXPOSURE_TIME_RANGE] = Range(100_000L, 1_000_000_000L)
        val (all, set, locking) = told(answer()) { camera.lock(it, 10_000_000L, 100) }
        assertEquals(emptyList<Any>(), all)
        assertEquals(listOf<Any?>(10_000_000L, 100), listOf(set["sensor.exposureTime"], set["sensor.sensitivity"]))
        assertEquals(listOf<Any?>(0, true), listOf(set["control.aeMode"], set["control.awbLock"]))
        verify(locking).setCaptureRequestOptions(any())
        val (beyond, none, untouched) = told(answer()) { camera.lock(it, 99_999L, 100) }
        assertTrue("$beyond", beyond.single().fatal && none.isEmpty())
        verify(untouched, never()).setCaptureRequestOptions(any())
        val (_, _, unlocking) = told(answer()) { camera.unlock(it) }
        verify(unlocking).clearCaptureRequestOptions()
        val cause = IllegalStateException("Camera is closed")
        val failed = runCatching { told(answer(cause)) { camera.lock(it, 10_000_000L, 100) } }
        assertSame(cause, failed.exceptionOrNull())
    }

    @Test
    fun `no photo is an error with CameraX's own as its cause`(): Unit = runBlocking {
        val cause = ImageCaptureException(3, "Camera is closed", null)
        val capture = mock(ImageCapture::class.java)
        `when`(capture.takePicture(any(), any(), any())).thenAnswer {
            it.getArgument<ImageCapture.OnImageSavedCallback>(2).onError(cause)
        }
        val error = runCatching { camera().takeDng(capture, File(folder.root, "chart.dng")) }.exceptionOrNull()
        assertTrue("$error", error is UnreadableRaw && error.cause === cause)
    }
}
