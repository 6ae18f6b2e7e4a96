package org.camssf.camera2

import android.graphics.ImageFormat
import android.graphics.Rect
import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CameraCharacteristics.SENSOR_CALIBRATION_TRANSFORM1
import android.hardware.camera2.CameraCharacteristics.SENSOR_CALIBRATION_TRANSFORM2
import android.hardware.camera2.CameraCharacteristics.SENSOR_COLOR_TRANSFORM1
import android.hardware.camera2.CameraCharacteristics.SENSOR_COLOR_TRANSFORM2
import android.hardware.camera2.CaptureResult
import android.hardware.camera2.params.ColorSpaceTransform
import android.hardware.camera2.params.LensShadingMap
import android.hardware.camera2.params.RggbChannelVector
import android.media.Image
import android.os.Build
import org.camssf.InvalidArgument
import org.camssf.NotSensorRaw
import org.camssf.OutOfMemory
import org.camssf.Refusal
import org.camssf.UnsupportedRaw
import org.camssf.model.Sha256
import org.camssf.photo.ColourMatrix
import org.camssf.photo.GainMap
import org.camssf.photo.Mosaic
import org.camssf.photo.PhotoSource
import org.camssf.photo.PhysicalCamera
import org.camssf.photo.Region
import java.nio.ByteOrder

/** Uses what API 24 lacks, after a look at the version; animal-sniffer leaves it out. */
@Retention(AnnotationRetention.BINARY)
@Target(AnnotationTarget.FUNCTION)
internal annotation class NewerAndroid

/**
 * One RAW frame and how it was captured.
 *
 * @property mosaic the samples and the camera's metadata, as the DNG reader would give them.
 * @property noiseReduction the mode that ran (CameraMetadata.NOISE_REDUCTION_MODE_*); null if the result does not
 *   contain it.
 * @property lensShadingApplied true if the camera has already corrected the lens shading of the RAW samples; null if
 *   it does not report this. If true, [mosaic] has no gain maps, because they must not be applied again.
 * @property shortfalls settings that differ from the wanted ones; none of them is fatal.
 */
public class RawFrame internal constructor(
    public val mosaic: Mosaic,
    public val noiseReduction: Int?,
    public val lensShadingApplied: Boolean?,
    public val shortfalls: List<Shortfall>,
) {
    override fun toString(): String = "RawFrame($mosaic, $shortfalls)"
}

/**
 * One RAW frame whose samples stay in its image, outside the heap, until they are measured.
 *
 * @property photo for a `Shot`; it reads the image's buffer in parts. The image must stay open until the shot is
 *   measured; whoever acquired it closes it.
 * @property noiseReduction see [RawFrame].
 * @property lensShadingApplied see [RawFrame].
 * @property shortfalls settings that differ from the wanted ones; none of them is fatal.
 */
public class OpenRawFrame internal constructor(
    public val photo: PhotoSource,
    public val noiseReduction: Int?,
    public val lensShadingApplied: Boolean?,
    public val shortfalls: List<Shortfall>,
) {
    override fun toString(): String = "OpenRawFrame($shortfalls)"
}

/**
 * Converts Camera2's RAW_SENSOR frames to mosaics. Threads: any but the main one.
 *
 * ```kotlin
 * fun shot(image: Image, camera: CameraCharacteristics, result: TotalCaptureResult, corners: Corners): Shot {
 *     val frame = image.use { RawFrames.read(it, camera, result, "chart", ChartPose.region(corners)) }
 *     return Shot(PhotoSource.of(frame.mosaic), Lamp.read("daylight"), corners)
 * }
 * ```
 */
public object RawFrames {
    /**
     * Copies a frame out of its image.
     *
     * Close the image immediately afterwards, because the camera has only a few; this function neither keeps nor
     * closes it. It may be called on any thread and takes the time of a copy.
     *
     * The mosaic equals the content of the platform's own DNG of this frame, except for the black level (the DNG's is
     * cut to 1/100), the white level (the DNG has the static one) and bad pixels (not read here).
     *
     * With a logical multi-camera, let one physical camera write the image
     * (`OutputConfiguration.setPhysicalCameraId`) and pass that camera's characteristics and result
     * (`TotalCaptureResult.getPhysicalCameraResults`). Otherwise the frame may come from another lens than they
     * describe. If the result names the physical camera (Android 10), a capture with frames of two physical cameras
     * is refused (`unit_differs`).
     *
     * @param image of format RAW_SENSOR, with the size of the pixel array or of the pre-correction active array.
     * @param camera characteristics of the camera that took it.
     * @param result of the same capture.
     * @param name for messages and results.
     * @param region part of the active area to copy, clipped to that area; a calibration needs only
     *   `ChartPose.region(corners)`.
     * @throws InvalidArgument the image has another format, is from another capture or is closed; or the region is
     *   outside the photo.
     * @throws OutOfMemory the part does not fit into the heap: copy a smaller one, or use [open].
     * @throws UnsupportedRaw camssf does not support the colour filter or the size, or the camera does not report a
     *   needed value.
     * @throws NotSensorRaw a test pattern changed the samples, or noise reduction ran although the camera offers OFF.
     *   If it does not offer OFF, the frame is accepted and [RawFrame.shortfalls] lists it.
     */
    @JvmStatic
    @JvmOverloads
    public fun read(
        image: Image,
        camera: CameraCharacteristics,
        result: CaptureResult,
        name: String,
        region: Region? = null,
    ): RawFrame {
        val shortfalls = check(image, camera, result, name)
        val frame = Frame(image, camera, result, name)
        val mode = result.get(CaptureResult.NOISE_REDUCTION_MODE)
        return RawFrame(frame.mosaic(region, ""), mode, frame.shaded, shortfalls)
    }

    /**
     * Opens a frame that is measured in its image's own buffer.
     *
     * [read] needs 2 bytes of heap per sample; this function needs heap only for the rows in use. Close the image
     * after the shot has been measured.
     *
     * @throws InvalidArgument as for [read], and if the image is closed before the shot is measured.
     * @throws UnsupportedRaw as for [read].
     * @throws NotSensorRaw as for [read].
     */
    @JvmStatic
    public fun open(
        image: Image,
        camera: CameraCharacteristics,
        result: CaptureResult,
        name: String,
    ): OpenRawFrame {
        val shortfalls = check(image, camera, result, name)
        val frame = Frame(image, camera, result, name)
        val sha256 by lazy { frame.sha256() }
        val photo = PhotoSource { region ->
            sameCapture(image, result, name) // also checks that the image is still open
            frame.mosaic(region, sha256)
        }
        return OpenRawFrame(photo, result.get(CaptureResult.NOISE_REDUCTION_MODE), frame.shaded, shortfalls)
    }

    private fun check(
        image: Image,
        camera: CameraCharacteristics,
        result: CaptureResult,
        name: String,
    ): List<Shortfall> {
        sameCapture(image, result, name)
        val shortfalls = CaptureRequirements.check(result, camera)
        shortfalls.firstOrNull { it.fatal }?.let {
            throw Refusal.of(
                "not_sensor_raw.frame_setting", "file" to name, "setting" to it.key, "state" to it.found,
                "advice" to it.advice,
            )
        }
        return shortfalls
    }

    private val ORIENTATIONS = mapOf(0 to 1, 90 to 6, 180 to 3, 270 to 8)

    /** Metadata of a frame, and access to its samples. */
    private class Frame(
        image: Image,
        camera: CameraCharacteristics,
        result: CaptureResult,
        private val name: String,
    ) {
        private val cfa = filters(camera, name)
        private val area = area(image, camera, name)
        private val samples = Samples(image, area, name)
        val shaded: Boolean? = camera.get(CameraCharacteristics.SENSOR_INFO_LENS_SHADING_APPLIED)
        private val maps = result.get(CaptureResult.STATISTICS_LENS_SHADING_CORRECTION_MAP).takeIf { shaded != true }
            ?.let { gainMaps(it, cfa, area) } ?: emptyList()
        private val sensor = sensor(camera, result, cfa, name)
        private val colours = colours(camera, result)
        private val exposure = result.get(CaptureResult.SENSOR_EXPOSURE_TIME)?.let { it / 1e9 }
        private val iso = result.get(CaptureResult.SENSOR_SENSITIVITY)?.toDouble()
        private val physical = physical(camera, result)
        private val orientation = ORIENTATIONS[camera.get(CameraCharacteristics.SENSOR_ORIENTATION)] ?: 1

        fun mosaic(region: Region?, sha256: String): Mosaic {
            val part = if (region ==
                null
            ) {
                Region.ofSize(left = 0, top = 0, width = area.width, height = area.height)
            } else {
                part(region)
            }
            val origin = Mosaic.Origin(
                name = name,
                make = Build.MANUFACTURER ?: "",
                model = Build.MODEL ?: "",
                exposure = exposure,
                iso = iso,
                orientation = orientation,
                sha256 = sha256,
                camera = physical,
            )
            val corrections = Mosaic.Corrections(maps)
            return Mosaic(origin, area.width, area.height, part, samples.copy(part), sensor, corrections, colours)
        }

        private fun part(region: Region): Region {
            val part = region.within(area.width, area.height)
            if (part.width < 1 || part.height < 1) {
                throw InvalidArgument(
                    "$region lies outside $name, a photo of ${area.width} × ${area.height} px.",
                    "Give corners in pixels of the RAW photo: points on a preview must be scaled to it, and turned " +
                        "back where the preview is turned.",
                )
            }
            return part
        }

        /**
         * SHA-256 of all samples of the active area, row by row, low byte first; the same as for a completely copied
         * frame.
         */
        fun sha256(): String {
            val hash = Sha256()
            val row = ShortArray(area.width)
            for (y in 0 until area.height) {
                if (Thread.interrupted()) throw InterruptedException("The calibration was interrupted.")
                samples.copy(Region.ofSize(left = 0, top = y, width = area.width, height = 1), row)
                hash.add(row, 0, row.size)
            }
            return hash.hex()
        }
    }

    private fun physical(camera: CameraCharacteristics, result: CaptureResult): PhysicalCamera {
        val active = camera.get(CameraCharacteristics.SENSOR_INFO_PRE_CORRECTION_ACTIVE_ARRAY_SIZE)
        return PhysicalCamera(
            id = cameraId(result),
            focalLength = result.get(CaptureResult.LENS_FOCAL_LENGTH)?.toDouble()?.takeIf { it > 0 },
            aperture = result.get(CaptureResult.LENS_APERTURE)?.toDouble()?.takeIf { it > 0 },
            activeArea = active?.let { Region.ofSize(it.left, it.top, it.width(), it.height()) },
        )
    }

    /** Id of the camera that took the frame, of a logical camera the physical one; "" before API 29. */
    @NewerAndroid
    private fun cameraId(result: CaptureResult): String {
        if (Build.VERSION.SDK_INT < Build.VERSION_CODES.Q) return ""
        val physical = result.get(CaptureResult.LOGICAL_MULTI_CAMERA_ACTIVE_PHYSICAL_ID)
        return physical ?: if (Build.VERSION.SDK_INT < Build.VERSION_CODES.S) "" else result.cameraId.orEmpty()
    }

    private fun sensor(
        camera: CameraCharacteristics,
        result: CaptureResult,
        cfa: String,
        name: String,
    ): Mosaic.Sensor {
        val dynamicBlack = result.get(CaptureResult.SENSOR_DYNAMIC_BLACK_LEVEL)
        val dynamicWhite = result.get(CaptureResult.SENSOR_DYNAMIC_WHITE_LEVEL)
        return Mosaic.Sensor(
            cfa = cfa,
            black = dynamicBlack?.let { level -> DoubleArray(4) { level[it].toDouble() } } ?: black(camera, name),
            white = (dynamicWhite ?: need(camera, CameraCharacteristics.SENSOR_INFO_WHITE_LEVEL, name)).toDouble(),
            noiseProfile = noise(result, cfa),
        )
    }

    private fun colours(camera: CameraCharacteristics, result: CaptureResult): Mosaic.Colours {
        val neutral = result.get(CaptureResult.SENSOR_NEUTRAL_COLOR_POINT)
        return Mosaic.Colours(
            colorMatrix1 = matrix(camera.get(SENSOR_COLOR_TRANSFORM1)),
            colorMatrix2 = matrix(camera.get(SENSOR_COLOR_TRANSFORM2)),
            asShotNeutral = neutral?.let { white -> DoubleArray(3) { white[it].toDouble() } },
            colourMatrices = colourMatrices(camera),
        )
    }

    private fun sameCapture(image: Image, result: CaptureResult, name: String) {
        val (format, time) = runCatching { image.format to image.timestamp }.getOrElse {
            throw InvalidArgument("$name: the image is closed.", "Read it before closing it.", cause = it)
        }
        if (format != ImageFormat.RAW_SENSOR) {
            throw InvalidArgument("$name has format $format.", "Give an image of ImageFormat.RAW_SENSOR.")
        }
        if (time != result.get(CaptureResult.SENSOR_TIMESTAMP)) {
            throw InvalidArgument("$name: image and result are of different captures.", "Match their time stamps.")
        }
    }

    private fun filters(camera: CameraCharacteristics, name: String): String {
        val order = need(camera, CameraCharacteristics.SENSOR_INFO_COLOR_FILTER_ARRANGEMENT, name)
        val advice = "camssf reads Bayer sensors only; choose another camera."
        return Mosaic.CFA_ORDERS.getOrNull(order) ?: throw Refusal.of(
            "unsupported_raw.filter_arrangement", "file" to name, "arrangement" to order,
        )
    }

    /** The active area of the image, in the image's own pixels. */
    private fun area(image: Image, camera: CameraCharacteristics, name: String): Region {
        val active = need(camera, CameraCharacteristics.SENSOR_INFO_PRE_CORRECTION_ACTIVE_ARRAY_SIZE, name)
        val whole = need(camera, CameraCharacteristics.SENSOR_INFO_PIXEL_ARRAY_SIZE, name)
        val (w, h) = image.width to image.height
        if (w == active.width() &&
            h == active.height()
        ) {
            return Region.ofSize(left = 0, top = 0, width = w, height = h)
        }
        if (w != whole.width || h != whole.height || !Rect(0, 0, w, h).contains(active)) {
            throw Refusal.of(
                "unsupported_raw.frame_size", "file" to name, "width" to w, "height" to h, "sensor" to whole,
            )
        }
        if (active.left % 2 != 0 || active.top % 2 != 0) {
            // The filter arrangement is documented as the one at the sensor's corner, but DNG has it at the active
            // area's corner: at an odd place the two differ by a column or row.
            throw Refusal.of("unsupported_raw.odd_area", "file" to name)
        }
        return Region.ofSize(active.left, active.top, active.width(), active.height())
    }

    /** The samples of an image's active area, read from its own buffer. */
    private class Samples(private val image: Image, private val area: Region, private val name: String) {
        private val stride: Int

        init {
            val plane = image.planes.singleOrNull()
            if (plane == null || plane.pixelStride != 2 || plane.rowStride < 2 * image.width) {
                throw Refusal.of("unsupported_raw.no_plane", "file" to name)
            }
            stride = plane.rowStride
            if (stride.toLong() * (image.height - 1) + 2L * image.width > plane.buffer.capacity()) {
                throw InvalidArgument("$name: the image's buffer is too short.", "Take the photo again.")
            }
        }

        fun copy(part: Region): ShortArray = try {
            ShortArray(part.width * part.height).also { copy(part, it) }
        } catch (error: OutOfMemoryError) {
            throw Refusal.of(
                "out_of_memory.frame", "file" to name, "width" to part.width, "height" to part.height, cause = error,
            )
        }

        fun copy(part: Region, into: ShortArray) {
            val bytes = image.planes[0].buffer.duplicate()
            bytes.limit(bytes.capacity())
            for (row in 0 until part.height) { // a row may begin at an odd byte
                bytes.position((stride.toLong() * (area.top + part.top + row) + 2L * (area.left + part.left)).toInt())
                bytes.slice().order(ByteOrder.nativeOrder()).asShortBuffer().get(into, row * part.width, part.width)
            }
        }
    }

    private fun black(camera: CameraCharacteristics, name: String): DoubleArray {
        val pattern = need(camera, CameraCharacteristics.SENSOR_BLACK_LEVEL_PATTERN, name)
        return DoubleArray(4) { pattern.getOffsetForIndex(it and 1, it shr 1).toDouble() }
    }

    /** Four maps, one for each position of the colour filters, as the platform's DNG writer makes them. */
    private fun gainMaps(map: LensShadingMap, cfa: String, area: Region): List<GainMap> {
        val greens = cfa.indices.filter { cfa[it] == 'G' }
        val places = mapOf(
            RggbChannelVector.RED to cfa.indexOf('R'),
            RggbChannelVector.GREEN_EVEN to greens[0],
            RggbChannelVector.GREEN_ODD to greens[1],
            RggbChannelVector.BLUE to cfa.indexOf('B'),
        )
        val (rows, columns) = map.rowCount to map.columnCount
        return places.map { (channel, place) ->
            val net = GainMap.Net(
                pointsV = rows, pointsH = columns,
                spacingV = 1.0 / maxOf(1, rows - 1), spacingH = 1.0 / maxOf(1, columns - 1),
                originV = 0.0, originH = 0.0, mapPlanes = 1,
                gains = FloatArray(rows * columns) { map.getGainFactor(channel, it % columns, it / columns) },
            )
            val (x, y) = (place and 1) to (place shr 1)
            val covered = Region.ofSize(x, y, area.width - x, area.height - y)
            GainMap(list = 2, covered, plane = 0, planes = 1, rowPitch = 2, columnPitch = 2, net)
        }
    }

    private fun matrix(transform: ColorSpaceTransform?): DoubleArray? =
        transform?.let { each -> DoubleArray(9) { each.getElement(it % 3, it / 3).toDouble() } }

    private fun colourMatrices(camera: CameraCharacteristics): List<ColourMatrix> {
        fun of(light: Int?, transform: ColorSpaceTransform?, own: ColorSpaceTransform?): ColourMatrix? =
            matrix(transform)?.let { ColourMatrix.of(light ?: 0, it, matrix(own)) }
        val first = camera.get(CameraCharacteristics.SENSOR_REFERENCE_ILLUMINANT1)
        val second = camera.get(CameraCharacteristics.SENSOR_REFERENCE_ILLUMINANT2)?.toInt()
        return listOfNotNull(
            of(first, camera.get(SENSOR_COLOR_TRANSFORM1), camera.get(SENSOR_CALIBRATION_TRANSFORM1)),
            of(second, camera.get(SENSOR_COLOR_TRANSFORM2), camera.get(SENSOR_CALIBRATION_TRANSFORM2)),
        )
    }

    /**
     * One pair of noise parameters for each colour; for green, that of the noisier green, as in the platform's DNG.
     */
    private fun noise(result: CaptureResult, cfa: String): DoubleArray? {
        val profile = result.get(CaptureResult.SENSOR_NOISE_PROFILE)?.takeIf { it.size == 4 } ?: return null
        val green = cfa.indices.filter { cfa[it] == 'G' }.maxByOrNull { profile[it].first }!!
        val pairs = listOf(cfa.indexOf('R'), green, cfa.indexOf('B')).map { profile[it] }
        return pairs.flatMap { listOf(it.first, it.second) }.toDoubleArray()
    }

    private fun <T : Any> need(camera: CameraCharacteristics, key: CameraCharacteristics.Key<T>, name: String): T =
        camera.get(key) ?: throw Refusal.of("unsupported_raw.silent_camera", "file" to name, "setting" to key.name)
}
