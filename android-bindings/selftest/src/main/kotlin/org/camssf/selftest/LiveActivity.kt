package org.camssf.selftest

import android.Manifest
import android.app.Activity
import android.content.Intent
import android.content.pm.PackageManager
import android.graphics.ImageFormat
import android.graphics.SurfaceTexture
import android.hardware.camera2.CameraAccessException
import android.hardware.camera2.CameraCaptureSession
import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CameraDevice
import android.hardware.camera2.CameraManager
import android.media.ImageReader
import android.os.Bundle
import android.os.Handler
import android.os.HandlerThread
import android.util.Size
import android.view.Surface
import android.view.TextureView
import android.widget.FrameLayout
import org.camssf.camera2.PreviewFrames
import org.camssf.guide.CaptureGuide
import org.camssf.photo.PreviewFit

/**
 * Shows the back camera's preview with finder and guide.
 *
 * It keeps no picture. Its result for the calling activity is the text of [GuideLog].
 */
public class LiveActivity : Activity(), TextureView.SurfaceTextureListener {
    internal val log = GuideLog()
    private val thread = HandlerThread("guide").apply { start() }
    private val handler by lazy { Handler(thread.looper) }
    private lateinit var texture: TextureView
    private lateinit var advice: GuideView
    private var reader: ImageReader? = null
    private var camera: CameraDevice? = null

    override fun onCreate(state: Bundle?) {
        super.onCreate(state)
        texture = TextureView(this).apply { surfaceTextureListener = this@LiveActivity }
        advice = GuideView(this)
        setContentView(FrameLayout(this).apply { addView(texture).also { addView(advice) } })
        if (!allowed()) requestPermissions(arrayOf(Manifest.permission.CAMERA), CAMERA)
    }

    override fun onRequestPermissionsResult(request: Int, permissions: Array<String>, results: IntArray) {
        if (!allowed()) {
            finish()
        } else if (texture.isAvailable) {
            start()
        }
    }

    override fun onResume() {
        super.onResume()
        if (texture.isAvailable) start()
    }

    override fun onPause() {
        camera?.close()
        reader?.close()
        camera = null
        reader = null
        super.onPause()
    }

    override fun onDestroy() {
        thread.quitSafely()
        super.onDestroy()
    }

    override fun finish() {
        setResult(RESULT_OK, Intent().putExtra(LOG, log.toJson().toString()))
        super.finish()
    }

    override fun onSurfaceTextureAvailable(surface: SurfaceTexture, width: Int, height: Int): Unit = start()

    override fun onSurfaceTextureSizeChanged(surface: SurfaceTexture, width: Int, height: Int) {}

    override fun onSurfaceTextureDestroyed(surface: SurfaceTexture): Boolean = true

    override fun onSurfaceTextureUpdated(surface: SurfaceTexture) {}

    private fun allowed() = checkSelfPermission(Manifest.permission.CAMERA) == PackageManager.PERMISSION_GRANTED

    private fun start() {
        if (!allowed() || camera != null) return
        val manager = getSystemService(CAMERA_SERVICE) as CameraManager
        try {
            val id = manager.cameraIdList.firstOrNull {
                val facing = manager.getCameraCharacteristics(it).get(CameraCharacteristics.LENS_FACING)
                facing == CameraCharacteristics.LENS_FACING_BACK
            } ?: return finish()
            val characteristics = manager.getCameraCharacteristics(id)
            manager.openCamera(id, opened(characteristics), handler)
        } catch (_: CameraAccessException) {
            finish() // another app uses the camera, or a policy forbids it
        } catch (_: SecurityException) {
            finish()
        }
    }

    private fun opened(characteristics: CameraCharacteristics) = object : CameraDevice.StateCallback() {
        override fun onOpened(device: CameraDevice) {
            camera = device
            preview(device, characteristics)
        }

        override fun onDisconnected(device: CameraDevice) = device.close()

        override fun onError(device: CameraDevice, error: Int) = device.close()
    }

    @Suppress("DEPRECATION") // its replacement needs API 28
    private fun preview(device: CameraDevice, characteristics: CameraCharacteristics) {
        val surface = texture.surfaceTexture?.apply { setDefaultBufferSize(WIDTH, HEIGHT) } ?: return
        val guide = CaptureGuide(PreviewFrames.focal(characteristics))
        val frame = PreviewFrames.map(characteristics, Size(WIDTH, HEIGHT))
        val taking = ImageReader.newInstance(WIDTH, HEIGHT, ImageFormat.YUV_420_888, 3)
        reader = taking
        val looking = PreviewFrames.listener(guide) { said ->
            runOnUiThread {
                if (advice.width > 0) {
                    // A TextureView stretches its stream; the manifest fixes the screen to portrait.
                    val size = Size(advice.width, advice.height)
                    val frames = Size(WIDTH, HEIGHT)
                    val view = PreviewFrames.view(characteristics, frames, size, rotation(), PreviewFit.STRETCH)
                    advice.show(said, frame, view)
                }
            }
            log.add(said, System.nanoTime() - began)
        }
        taking.setOnImageAvailableListener({
            began = System.nanoTime()
            looking.onImageAvailable(it)
        }, handler)
        val seen = Surface(surface)
        device.createCaptureSession(listOf(seen, taking.surface), started(device, seen, taking.surface), handler)
    }

    private var began = 0L

    private abstract class SessionState : CameraCaptureSession.StateCallback()

    private fun started(device: CameraDevice, vararg targets: Surface) = object : SessionState() {
        override fun onConfigured(session: CameraCaptureSession) {
            val request = device.createCaptureRequest(CameraDevice.TEMPLATE_PREVIEW)
            targets.forEach { request.addTarget(it) }
            session.setRepeatingRequest(request.build(), null, handler)
        }

        override fun onConfigureFailed(session: CameraCaptureSession) = runOnUiThread { finish() }
    }

    @Suppress("DEPRECATION") // its replacement needs API 30
    private fun rotation() = 90 * windowManager.defaultDisplay.rotation

    internal companion object {
        /** Name of the result's extra that holds the log. */
        const val LOG = "log"
        private const val CAMERA = 1
        private const val WIDTH = 640
        private const val HEIGHT = 480
    }
}
