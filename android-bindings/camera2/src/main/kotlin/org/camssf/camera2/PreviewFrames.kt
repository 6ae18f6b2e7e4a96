package org.camssf.camera2

import android.graphics.ImageFormat
import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CaptureResult
import android.media.Image
import android.media.ImageReader
import android.os.Handler
import android.util.Size
import kotlinx.coroutines.channels.awaitClose
import kotlinx.coroutines.flow.Flow
import kotlinx.coroutines.flow.callbackFlow
import kotlinx.coroutines.flow.conflate
import org.camssf.InvalidArgument
import org.camssf.finder.Picture
import org.camssf.finder.Plane
import org.camssf.guide.CaptureGuide
import org.camssf.guide.Guidance
import org.camssf.guide.GuidanceListener
import org.camssf.photo.PreviewCrop
import org.camssf.photo.PreviewFit
import org.camssf.photo.PreviewMap
import org.camssf.photo.Region

/**
 * Converts Camera2's preview frames for [CaptureGuide], and maps coordinates of a preview to the RAW frame's mosaic.
 */
public object PreviewFrames {
    /**
     * A picture of a preview frame, which is read from the image's own buffers.
     *
     * Keep the image open until [CaptureGuide.look] has returned, then close it immediately.
     *
     * @param image of format YUV_420_888, with any strides.
     * @throws InvalidArgument the image has another format, its planes are too short, or it is closed.
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
     * The listener for a preview's `ImageReader`: it takes the latest frame, passes it to the guide, closes it, and
     * passes on the guidance.
     *
     * It runs on the reader's handler, which should not be the main thread's. Frames that arrive meanwhile are
     * dropped.
     *
     * @param guide used by this listener only.
     * @param receiver receives each frame's guidance; its exceptions reach the handler, after the image has been closed.
     */
    @JvmStatic
    public fun listener(guide: CaptureGuide, receiver: GuidanceListener): ImageReader.OnImageAvailableListener =
        ImageReader.OnImageAvailableListener { reader ->
            val guidance = reader.acquireLatestImage()?.use { guide.look(picture(it), it.timestamp) }
            if (guidance != null) receiver.guide(guidance)
        }

    /**
     * The guidance of a preview's frames, as long as the flow is collected: it sets the reader's listener, and
     * removes it at the end. A collector that is slower than the camera receives the latest guidance only.
     *
     * @param reader the preview's, in `ImageFormat.YUV_420_888`; the flow neither owns nor closes it.
     * @param guide used by this flow only.
     * @param handler of a worker thread, on which the frames are searched.
     */
    @JvmStatic
    public fun guidance(reader: ImageReader, guide: CaptureGuide, handler: Handler): Flow<Guidance> = callbackFlow {
        val looking = listener(guide) { trySend(it) }
        reader.setOnImageAvailableListener(
            { source ->
                try {
                    looking.onImageAvailable(source)
                } catch (error: InvalidArgument) {
                    close(error)
                }
            },
            handler,
        )
        awaitClose { reader.setOnImageAvailableListener(null, null) }
    }.conflate()

    /**
     * Focal length of the lens / longer side of the whole sensor, for [CaptureGuide]; 0.75 if the camera does not
     * report it. With zoom, multiply it by the zoom ratio.
     */
    @JvmStatic
    public fun focal(camera: CameraCharacteristics): Double {
        val lens = camera.get(CameraCharacteristics.LENS_INFO_AVAILABLE_FOCAL_LENGTHS)?.firstOrNull()
        val sensor = camera.get(CameraCharacteristics.SENSOR_INFO_PHYSICAL_SIZE)
        val longer = sensor?.let { maxOf(it.width, it.height) } ?: 0f
        return if (lens != null && lens > 0 && longer > 0) (lens / longer).toDouble() else USUAL_FOCAL
    }

    /**
     * The map from preview frames to the mosaic that [RawFrames] reads: `toMosaic` converts corners found in a frame
     * ([org.camssf.finder.Candidate.corners]).
     *
     * @param camera the camera of both.
     * @param frame size of the frames, px.
     * @param result of a preview frame, for its crop region; null if the app sets none.
     * @param zoom `CONTROL_ZOOM_RATIO`, if the app sets one.
     */
    @JvmStatic
    @JvmOverloads
    public fun map(
        camera: CameraCharacteristics,
        frame: Size,
        result: CaptureResult? = null,
        zoom: Double = 1.0,
    ): PreviewMap {
        val crop = crop(camera, result, zoom).shapedAs(frame.width, frame.height)
        return PreviewMap.ofPicture(crop, frame.width, frame.height)
    }

    /**
     * The map from a view that shows the preview to the mosaic: `toMosaic` converts taps, `fromMosaic` corners to be
     * drawn over the view.
     *
     * @param camera the camera of both.
     * @param stream size of the stream that the view shows, px, in the sensor's orientation.
     * @param view size of the view, px.
     * @param display rotation of the screen: 0, 90, 180 or 270 degrees.
     * @param fit how the stream fills the view.
     * @param result of a preview frame, for its crop region; null if the app sets none.
     * @param zoom `CONTROL_ZOOM_RATIO`, if the app sets one.
     */
    @JvmStatic
    @JvmOverloads
    public fun view(
        camera: CameraCharacteristics,
        stream: Size,
        view: Size,
        display: Int,
        fit: PreviewFit = PreviewFit.FILL,
        result: CaptureResult? = null,
        zoom: Double = 1.0,
    ): PreviewMap {
        val front = camera.get(CameraCharacteristics.LENS_FACING) == CameraCharacteristics.LENS_FACING_FRONT
        val sensor = camera.get(CameraCharacteristics.SENSOR_ORIENTATION) ?: 0
        val turned = PreviewMap.rotationOf(sensor, display, front)
        val crop = crop(camera, result, zoom).shapedAs(stream.width, stream.height)
        return PreviewMap.ofView(crop, turned, front, view.width, view.height, fit)
    }

    /** The area that previews show, in samples of the pre-correction active array, which is the mosaic. */
    private fun crop(camera: CameraCharacteristics, result: CaptureResult?, zoom: Double): PreviewCrop {
        val mosaic = camera.get(CameraCharacteristics.SENSOR_INFO_PRE_CORRECTION_ACTIVE_ARRAY_SIZE)
        val active = camera.get(CameraCharacteristics.SENSOR_INFO_ACTIVE_ARRAY_SIZE) ?: mosaic
        if (active == null) {
            throw InvalidArgument("The camera does not tell its active array.", "Ask for the corners by hand.")
        }
        // Both arrays are in pixels of the whole sensor; crop regions are in pixels of the active array.
        val x = active.left - (mosaic ?: active).left
        val y = active.top - (mosaic ?: active).top
        val region = result?.get(CaptureResult.SCALER_CROP_REGION)
        val whole = Region.ofSize(left = x, top = y, width = active.width(), height = active.height())
        val all = PreviewCrop.of(whole).zoomed(zoom)
        if (region == null) return all
        // With zoom, the region is a part of the zoomed field of view, in coordinates of the active array.
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
