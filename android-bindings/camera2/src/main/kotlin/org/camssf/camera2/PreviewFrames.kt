package org.camssf.camera2

import android.graphics.ImageFormat
import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CaptureResult
import android.media.Image
import android.media.ImageReader
import org.camssf.InvalidArgument
import org.camssf.finder.Picture
import org.camssf.finder.Plane
import org.camssf.guide.CaptureGuide
import org.camssf.guide.Guidance
import org.camssf.photo.PreviewCrop
import org.camssf.photo.PreviewFit
import org.camssf.photo.PreviewMap
import org.camssf.photo.Region

/** Camera2's preview frames for [CaptureGuide], and the way from a preview to the RAW frame's mosaic. */
public object PreviewFrames {
    /**
     * A frame to be searched, read where it stands: keep the image open until [CaptureGuide.look] has returned, then close
     * it at once.
     *
     * @param image of format YUV_420_888, whatever its strides.
     * @throws InvalidArgument another format, planes that are too short, or a closed image.
     */
    @JvmStatic
    public fun picture(image: Image): Picture {
        val (format, planes) = try {
            image.format to image.planes
        } catch (closed: IllegalStateException) {
            throw InvalidArgument("The preview's image is closed.", "Look at it before closing it.", cause = closed)
        }
        if (format != ImageFormat.YUV_420_888 || planes.size != 3) {
            throw InvalidArgument(
                "The preview's image has format $format and ${planes.size} planes.",
                "Give images of ImageFormat.YUV_420_888.",
            )
        }
        val (y, u, v) = planes.map { Plane(it.buffer, it.rowStride, it.pixelStride) }
        return Picture.yuv(y, u, v, image.width, image.height)
    }

    /**
     * What a preview's `ImageReader` is given as its listener: takes the latest frame, lets the guide look, closes it, and
     * hands on what is to be said, on the reader's handler, which should not be the main thread's. Frames that come while
     * it looks are dropped.
     *
     * @param guide used by this listener alone.
     * @param said takes each frame's guidance; what it throws goes on to the handler, after the image has been closed.
     */
    @JvmStatic
    public fun listener(guide: CaptureGuide, said: (Guidance) -> Unit): ImageReader.OnImageAvailableListener =
        ImageReader.OnImageAvailableListener { reader ->
            val guidance = reader.acquireLatestImage()?.use { guide.look(picture(it), it.timestamp) }
            if (guidance != null) said(guidance)
        }

    /**
     * The lens' focal length in longer sides of the whole sensor, for [CaptureGuide]; its usual 0.75 where the camera does
     * not tell. A zoom multiplies it.
     */
    @JvmStatic
    public fun focal(camera: CameraCharacteristics): Double {
        val lens = camera.get(CameraCharacteristics.LENS_INFO_AVAILABLE_FOCAL_LENGTHS)?.firstOrNull()
        val sensor = camera.get(CameraCharacteristics.SENSOR_INFO_PHYSICAL_SIZE)
        val longer = sensor?.let { maxOf(it.width, it.height) } ?: 0f
        return if (lens != null && lens > 0 && longer > 0) (lens / longer).toDouble() else USUAL_FOCAL
    }

    /**
     * From a preview's frames to the mosaic: their corners ([org.camssf.finder.Sighting.corners]) become the RAW frame's
     * (`toMosaic`), which [RawFrames] reads.
     *
     * @param camera that takes both.
     * @param width of the frames, px.
     * @param height of the frames, px.
     * @param result of a preview frame, for its crop region; null where the app sets none.
     * @param zoom `CONTROL_ZOOM_RATIO`, where the app sets one.
     */
    @JvmStatic
    @JvmOverloads
    public fun map(
        camera: CameraCharacteristics,
        width: Int,
        height: Int,
        result: CaptureResult? = null,
        zoom: Double = 1.0,
    ): PreviewMap = PreviewMap.ofPicture(crop(camera, result, zoom).shapedAs(width, height), width, height)

    /**
     * From a view that shows the preview to the mosaic: taps (`toMosaic`), and corners drawn over the view (`fromMosaic`).
     *
     * @param camera that takes both.
     * @param stream width and height of the stream that the view shows, px, as the sensor lies.
     * @param view width and height of the view, px.
     * @param display by how many degrees the screen is turned: 0, 90, 180 or 270.
     * @param fit how the stream fills the view.
     * @param result of a preview frame, for its crop region; null where the app sets none.
     * @param zoom `CONTROL_ZOOM_RATIO`, where the app sets one.
     */
    @JvmStatic
    @JvmOverloads
    public fun view(
        camera: CameraCharacteristics,
        stream: Pair<Int, Int>,
        view: Pair<Int, Int>,
        display: Int,
        fit: PreviewFit = PreviewFit.FILL,
        result: CaptureResult? = null,
        zoom: Double = 1.0,
    ): PreviewMap {
        val front = camera.get(CameraCharacteristics.LENS_FACING) == CameraCharacteristics.LENS_FACING_FRONT
        val sensor = camera.get(CameraCharacteristics.SENSOR_ORIENTATION) ?: 0
        val turned = PreviewMap.rotationOf(sensor, display, front)
        val crop = crop(camera, result, zoom).shapedAs(stream.first, stream.second)
        return PreviewMap.ofView(crop, turned, front, view.first, view.second, fit)
    }

    /** What previews show, in samples of the pre-correction active array, which is the mosaic. */
    private fun crop(camera: CameraCharacteristics, result: CaptureResult?, zoom: Double): PreviewCrop {
        val mosaic = camera.get(CameraCharacteristics.SENSOR_INFO_PRE_CORRECTION_ACTIVE_ARRAY_SIZE)
        val active = camera.get(CameraCharacteristics.SENSOR_INFO_ACTIVE_ARRAY_SIZE) ?: mosaic
        if (active == null) {
            throw InvalidArgument("The camera does not tell its active array.", "Ask for the corners by hand.")
        }
        // Both arrays are told in pixels of the whole sensor; crop regions in the active array's own.
        val x = active.left - (mosaic ?: active).left
        val y = active.top - (mosaic ?: active).top
        val region = result?.get(CaptureResult.SCALER_CROP_REGION)
        val all = PreviewCrop.of(Region(x, y, x + active.width(), y + active.height())).zoomed(zoom)
        if (region == null) return all
        // Of a zoomed field of view the region is a part, in the active array's numbers.
        val (across, down) = all.width / active.width() to all.height / active.height()
        return PreviewCrop(
            all.left + region.left * across,
            all.top + region.top * down,
            all.left + region.right * across,
            all.top + region.bottom * down,
        )
    }

    private const val USUAL_FOCAL = 0.75
}
