package org.camssf.camera2

import android.graphics.ImageFormat
import android.graphics.Rect
import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CaptureResult
import android.media.Image
import android.media.ImageReader
import android.os.Handler
import android.os.Looper
import android.util.Size
import android.util.SizeF
import kotlinx.coroutines.Dispatchers
import kotlinx.coroutines.async
import kotlinx.coroutines.flow.first
import kotlinx.coroutines.runBlocking
import org.camssf.InvalidArgument
import org.camssf.finder.ChartFinder
import org.camssf.guide.Advice
import org.camssf.guide.CaptureGuide
import org.camssf.guide.Guidance
import org.camssf.photo.Point
import org.camssf.photo.PreviewFit
import org.junit.Assert.assertEquals
import org.junit.Assert.assertThrows
import org.junit.Assert.assertTrue
import org.junit.Test
import org.junit.runner.RunWith
import org.mockito.ArgumentCaptor
import org.mockito.ArgumentMatchers.eq
import org.mockito.Mockito.mock
import org.mockito.Mockito.never
import org.mockito.Mockito.verify
import org.mockito.Mockito.`when`
import org.robolectric.RobolectricTestRunner
import org.robolectric.annotation.Config
import java.nio.ByteBuffer

/** A sensor of 4100 × 3090 samples, 4080 × 3072 in the mosaic, 4000 × 3000 straightened, lying in a phone. */
@RunWith(RobolectricTestRunner::class)
@Config(sdk = [35])
class PreviewFramesTest {
    private fun sensor(facing: Int = CameraCharacteristics.LENS_FACING_BACK) = camera {
        it[CameraCharacteristics.SENSOR_INFO_PRE_CORRECTION_ACTIVE_ARRAY_SIZE] = Rect(10, 8, 4090, 3080)
        it[CameraCharacteristics.SENSOR_INFO_ACTIVE_ARRAY_SIZE] = Rect(50, 44, 4050, 3044)
        it[CameraCharacteristics.LENS_FACING] = facing
        it[CameraCharacteristics.LENS_INFO_AVAILABLE_FOCAL_LENGTHS] = floatArrayOf(4.5f)
        it[CameraCharacteristics.SENSOR_INFO_PHYSICAL_SIZE] = SizeF(6f, 4.5f)
    }

    private fun near(x: Double, y: Double, found: Point) {
        assertEquals(x, found.x, 1e-9)
        assertEquals(y, found.y, 1e-9)
    }

    @Test
    fun `a frame of 640 by 480 lies in the mosaic where the straightened array does`() {
        val map = PreviewFrames.map(sensor(), Size(640, 480))
        near(40 + 3.125 - 0.5, 36 + 3.125 - 0.5, map.toMosaic(Point(0.0, 0.0))) // 6.25 samples a pixel
        near(4040 - 3.125 - 0.5, 3036 - 3.125 - 0.5, map.toMosaic(Point(639.0, 479.0)))
        // 16 : 9 lacks top and bottom.
        val wide = PreviewFrames.map(sensor(), Size(1280, 720))
        near(40 + 1.5625 - 0.5, 36 + 375 + 1.5625 - 0.5, wide.toMosaic(Point(0.0, 0.0)))
    }

    @Test
    fun `a crop region and a zoom show less`() {
        val cropped = result { it[CaptureResult.SCALER_CROP_REGION] = Rect(1000, 750, 3000, 2250) }
        val map = PreviewFrames.map(sensor(), Size(640, 480), cropped)
        near(1040 + 1.5625 - 0.5, 786 + 1.5625 - 0.5, map.toMosaic(Point(0.0, 0.0)))
        val whole = result { it[CaptureResult.SCALER_CROP_REGION] = Rect(0, 0, 4000, 3000) }
        val zoomed = PreviewFrames.map(sensor(), Size(640, 480), whole, 2.0)
        near(1040 + 1.5625 - 0.5, 786 + 1.5625 - 0.5, zoomed.toMosaic(Point(0.0, 0.0)))
        val plain = PreviewFrames.map(sensor(), Size(640, 480), null, 2.0)
        near(1040 + 1.5625 - 0.5, 786 + 1.5625 - 0.5, plain.toMosaic(Point(0.0, 0.0)))
    }

    /** Upright phone: the sensor's left is the view's top, its top the view's right; a front camera is a mirror. */
    @Test
    fun `taps on a view`() {
        val view = PreviewFrames.view(sensor(), Size(1600, 1200), Size(1200, 1600), 0)
        near(39.5, 35.5, view.toMosaic(Point(1200.0, 0.0)))
        near(4039.5, 3035.5, view.toMosaic(Point(0.0, 1600.0)))
        val front = PreviewFrames.view(
            sensor(CameraCharacteristics.LENS_FACING_FRONT), Size(1600, 1200), Size(1200, 1600), 0, PreviewFit.INSIDE,
        )
        near(39.5, 35.5, front.toMosaic(Point(0.0, 0.0)))
        val turned = PreviewFrames.view(sensor(), Size(1600, 1200), Size(1600, 1200), 90)
        near(39.5, 35.5, turned.toMosaic(Point(0.0, 0.0)))
    }

    @Test
    fun `what a camera does not tell`() {
        assertEquals(0.75, PreviewFrames.focal(sensor()), 1e-6)
        assertEquals(0.75, PreviewFrames.focal(camera()), 0.0)
        val shorter = camera {
            it[CameraCharacteristics.LENS_INFO_AVAILABLE_FOCAL_LENGTHS] = floatArrayOf(3f)
            it[CameraCharacteristics.SENSOR_INFO_PHYSICAL_SIZE] = SizeF(4.5f, 6f)
        }
        assertEquals(0.5, PreviewFrames.focal(shorter), 1e-6)
        val plain = PreviewFrames.map(camera(), Size(60, 40)) // 6 × 4 samples, and no other array
        near(-0.45, -0.45, plain.toMosaic(Point(0.0, 0.0)))
        val silent = camera { it.remove(CameraCharacteristics.SENSOR_INFO_PRE_CORRECTION_ACTIVE_ARRAY_SIZE) }
        assertThrows(InvalidArgument::class.java) { PreviewFrames.map(silent, Size(640, 480)) }
    }

    /** Planes of padded rows and interleaved colours, as most phones give them; read in place and closed. */
    @Test
    fun `the reader's listener looks, closes and hands on`() {
        val image = image()
        val reader = mock(ImageReader::class.java)
        `when`(reader.acquireLatestImage()).thenReturn(image, null, image)
        val said = ArrayList<Guidance>()
        val listener = PreviewFrames.listener(CaptureGuide()) { said += it }
        listener.onImageAvailable(reader)
        listener.onImageAvailable(reader) // no image: nothing to say
        assertEquals(listOf(Advice.NO_CHART), said.map { it.advice })
        verify(image).close()
        val failing = PreviewFrames.listener(CaptureGuide()) { throw IllegalStateException("the app's") }
        assertThrows(IllegalStateException::class.java) { failing.onImageAvailable(reader) }
        verify(image, org.mockito.Mockito.times(2)).close()
    }

    @Test
    fun `guidance is a flow that ends with its collector`() = runBlocking {
        val reader = mock(ImageReader::class.java)
        val image = image()
        `when`(reader.acquireLatestImage()).thenReturn(image)
        val handler = Handler(Looper.getMainLooper())
        val listener = ArgumentCaptor.forClass(ImageReader.OnImageAvailableListener::class.java)
        val first = async(Dispatchers.Unconfined) { PreviewFrames.guidance(reader, CaptureGuide(), handler).first() }
        verify(reader).setOnImageAvailableListener(listener.capture(), eq(handler))
        listener.value.onImageAvailable(reader)
        assertTrue(first.await() is Guidance.Searching)
        verify(reader).setOnImageAvailableListener(null, null)
        val raw = image(ImageFormat.RAW_SENSOR)
        `when`(reader.acquireLatestImage()).thenReturn(raw)
        val failing = async(Dispatchers.Unconfined) {
            runCatching { PreviewFrames.guidance(reader, CaptureGuide(), handler).first() }
        }
        verify(reader, org.mockito.Mockito.times(2)).setOnImageAvailableListener(listener.capture(), eq(handler))
        listener.value.onImageAvailable(reader)
        assertTrue(failing.await().exceptionOrNull() is InvalidArgument)
        verify(raw).close()
    }

    @Test
    fun `the picture is the image's planes`() {
        val found = ChartFinder().find(PreviewFrames.picture(image()))
        assertTrue(found.candidates.isEmpty())
    }

    @Test
    fun `other images are refused`() {
        val raw = image(ImageFormat.RAW_SENSOR)
        assertThrows(InvalidArgument::class.java) { PreviewFrames.picture(raw) }
        val short = image(last = 100)
        assertThrows(InvalidArgument::class.java) { PreviewFrames.picture(short) }
        val closed = mock(Image::class.java)
        `when`(closed.format).thenThrow(IllegalStateException("Image is already closed"))
        assertThrows(InvalidArgument::class.java) { PreviewFrames.picture(closed) }
        verify(raw, never()).close()
    }

    private fun image(format: Int = ImageFormat.YUV_420_888, last: Int = 64): Image {
        val (width, height) = 64 to 48
        fun plane(rows: Int, stride: Int, pixel: Int, last: Int): Image.Plane {
            val plane = mock(Image.Plane::class.java)
            `when`(plane.buffer).thenReturn(ByteBuffer.allocateDirect(stride * (rows - 1) + last))
            `when`(plane.rowStride).thenReturn(stride)
            `when`(plane.pixelStride).thenReturn(pixel)
            return plane
        }
        val planes = arrayOf(plane(height, 80, 1, last), plane(24, 80, 2, 63), plane(24, 80, 2, 63))
        if (last != 64) planes[0] = plane(2, 80, 1, 64)
        val image = mock(Image::class.java)
        `when`(image.format).thenReturn(format)
        `when`(image.planes).thenReturn(planes)
        `when`(image.width).thenReturn(width)
        `when`(image.height).thenReturn(height)
        `when`(image.timestamp).thenReturn(5L)
        return image
    }
}
