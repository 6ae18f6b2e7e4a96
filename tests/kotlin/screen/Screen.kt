package example

import android.content.ContentResolver
import android.content.Context
import android.graphics.Bitmap
import android.graphics.Color
import android.hardware.camera2.CameraCaptureSession
import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CameraDevice
import android.hardware.camera2.TotalCaptureResult
import android.media.Image
import android.media.ImageReader
import android.net.Uri
import android.os.Handler
import android.widget.ImageView
import androidx.camera.core.Camera
import androidx.camera.core.CameraSelector
import androidx.camera.core.ImageAnalysis
import androidx.camera.core.ImageCapture
import androidx.camera.core.Preview
import androidx.camera.lifecycle.ProcessCameraProvider
import androidx.lifecycle.LifecycleOwner
import java.io.File
@imports@

class Screen(private val contentResolver: ContentResolver, private val filesDir: File) {
    private val cacheDir = filesDir
    val shown = ArrayList<String>()

    private fun show(vararg what: Any?) {
        shown += what.joinToString(" ")
    }

    private fun log(words: String) = show(words)

    suspend fun chosen(
        uri: Uri, x1: Double, y1: Double, x2: Double, y2: Double, x3: Double, y3: Double, x4: Double, y4: Double,
    ) {
@first@
    }

    fun bound(context: Context, owner: LifecycleOwner, provider: ProcessCameraProvider, preview: Preview) {
@binding@
    }

    suspend fun photographed(camera: ChartCamera, analysis: ImageAnalysis, capture: ImageCapture) {
@camerax@
    }

    fun photographed(
        characteristics: CameraCharacteristics, device: CameraDevice, reader: ImageReader,
        session: CameraCaptureSession, callback: CameraCaptureSession.CaptureCallback, handler: Handler,
        image: Image, result: TotalCaptureResult,
        corners: Corners,
    ) {
@camera@
    }

    fun repeated(
        characteristics: CameraCharacteristics, device: CameraDevice, reader: ImageReader,
        session: CameraCaptureSession, callback: CameraCaptureSession.CaptureCallback, handler: Handler,
    ) {
@lock@
    }

    suspend fun locked(camera: ChartCamera, bound: Camera, capture: ImageCapture) {
@lock_camerax@
    }

    fun live(
        first: Mosaic, frame: Mosaic, whiteArea: Region, stripArea: Region, previewArea: Region, view: ImageView,
        x: Int, y: Int,
    ) {
@white@
@live@
@picture@
@preview@
    }

@language@
}
