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
import org.camssf.UnsupportedRaw
import org.camssf.photo.GainMap
import org.camssf.photo.Mosaic
import org.camssf.photo.Neutral
import org.camssf.photo.Region
import java.nio.ByteOrder

/**
 * One RAW frame and how it came about.
 *
 * @property mosaic the samples and what the camera says about them, as the DNG reader would give them.
 * @property noiseReduction the mode that ran (CameraMetadata.NOISE_REDUCTION_MODE_*), null where the result is silent.
 * @property lensShadingApplied whether the sensor's driver brightened the corners of the RAW samples already; null where
 *   the camera is silent. Where true, [mosaic] has no gain maps, since they must not be applied again.
 * @property shortfalls what was not as wanted, nothing of it fatal.
 */
public class RawFrame internal constructor(
    public val mosaic: Mosaic,
    public val noiseReduction: Int?,
    public val lensShadingApplied: Boolean?,
    public val shortfalls: List<Shortfall>,
)

/** Camera2's RAW_SENSOR frames → mosaics. */
public object RawFrames {
    /**
     * Copies a frame out of its image. Close the image at once afterwards: the camera has few of them, and this neither
     * keeps nor closes it. Any thread; takes the time of a copy.
     *
     * The mosaic equals what the platform's own DNG of this frame holds, but for its black level (the DNG's is cut to
     * 1/100), white level (the DNG's is the static one) and bad pixels (not read here).
     *
     * Of a logical multi-camera, let one physical camera write the image (`OutputConfiguration.setPhysicalCameraId`) and
     * hand over that camera's characteristics and result (`TotalCaptureResult.getPhysicalCameraResults`): otherwise the
     * frame may come from another lens than they describe, which cannot be seen here.
     *
     * @param image of format RAW_SENSOR, as big as the pixel array or as the pre-correction active array.
     * @param camera that took it.
     * @param result of the same capture.
     * @param name for messages and results.
     * @throws InvalidArgument an image of another format or capture, or a closed one.
     * @throws UnsupportedRaw a colour filter or size that camssf does not read.
     * @throws NotSensorRaw a test pattern changed the samples, or noise reduction that the camera could have left out;
     *   where it offers no OFF, the frame is taken and [RawFrame.shortfalls] names it.
     */
    @JvmStatic
    public fun read(image: Image, camera: CameraCharacteristics, result: CaptureResult, name: String): RawFrame {
        sameCapture(image, result, name)
        val shortfalls = CaptureRequirements.check(result, camera)
        shortfalls.firstOrNull { it.fatal }?.let {
            throw NotSensorRaw("$name: ${it.key} is ${it.found}: the samples are not the sensor's own.", it.advice)
        }
        val cfa = filters(camera, name)
        val area = area(image, camera, name)
        val dynamicBlack = result.get(CaptureResult.SENSOR_DYNAMIC_BLACK_LEVEL)
        val dynamicWhite = result.get(CaptureResult.SENSOR_DYNAMIC_WHITE_LEVEL)
        val shaded = camera.get(CameraCharacteristics.SENSOR_INFO_LENS_SHADING_APPLIED)
        val map = result.get(CaptureResult.STATISTICS_LENS_SHADING_CORRECTION_MAP).takeIf { shaded != true }
        val neutral = result.get(CaptureResult.SENSOR_NEUTRAL_COLOR_POINT)
        val origin = Mosaic.Origin(
            name = name,
            make = Build.MANUFACTURER ?: "",
            model = Build.MODEL ?: "",
            exposure = result.get(CaptureResult.SENSOR_EXPOSURE_TIME)?.let { it / 1e9 },
            iso = result.get(CaptureResult.SENSOR_SENSITIVITY)?.toDouble(),
            orientation = ORIENTATIONS[camera.get(CameraCharacteristics.SENSOR_ORIENTATION)] ?: 1,
        )
        val sensor = Mosaic.Sensor(
            cfa = cfa,
            black = dynamicBlack?.let { level -> DoubleArray(4) { level[it].toDouble() } } ?: black(camera, name),
            white = (dynamicWhite ?: need(camera, CameraCharacteristics.SENSOR_INFO_WHITE_LEVEL, name)).toDouble(),
            noiseProfile = noise(result, cfa),
        )
        val colours = Mosaic.Colours(
            colorMatrix1 = matrix(camera.get(SENSOR_COLOR_TRANSFORM1)),
            colorMatrix2 = matrix(camera.get(SENSOR_COLOR_TRANSFORM2)),
            asShotNeutral = neutral?.let { white -> DoubleArray(3) { white[it].toDouble() } },
            neutrals = neutrals(camera),
        )
        val mosaic = Mosaic(
            origin,
            area.width,
            area.height,
            Region(0, 0, area.width, area.height),
            samples(image, area, name),
            sensor,
            Mosaic.Corrections(map?.let { gainMaps(it, cfa, area) } ?: emptyList()),
            colours,
        )
        return RawFrame(mosaic, result.get(CaptureResult.NOISE_REDUCTION_MODE), shaded, shortfalls)
    }

    private val ORIENTATIONS = mapOf(0 to 1, 90 to 6, 180 to 3, 270 to 8)

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
        return Mosaic.CFA_ORDERS.getOrNull(order) ?: throw UnsupportedRaw("$name: filter arrangement $order.", advice)
    }

    /** The active part of the image, in its own pixels. */
    private fun area(image: Image, camera: CameraCharacteristics, name: String): Region {
        val active = need(camera, CameraCharacteristics.SENSOR_INFO_PRE_CORRECTION_ACTIVE_ARRAY_SIZE, name)
        val whole = need(camera, CameraCharacteristics.SENSOR_INFO_PIXEL_ARRAY_SIZE, name)
        val (w, h) = image.width to image.height
        if (w == active.width() && h == active.height()) return Region(0, 0, w, h)
        if (w != whole.width || h != whole.height || !Rect(0, 0, w, h).contains(active)) {
            throw UnsupportedRaw("$name has $w × $h samples, the sensor $whole.", "Ask for its ordinary pixel mode.")
        }
        if (active.left % 2 != 0 || active.top % 2 != 0) {
            // Documented as the sensor's corner, written into DNG as the active area's: they differ by a column or row.
            throw UnsupportedRaw("$name: the active array begins at an odd place.", "Choose another camera.")
        }
        return Region(active.left, active.top, active.right, active.bottom)
    }

    private fun samples(image: Image, area: Region, name: String): ShortArray {
        val plane = image.planes.singleOrNull()
        if (plane == null || plane.pixelStride != 2 || plane.rowStride < 2 * image.width) {
            throw UnsupportedRaw("$name is not one plane of 16-bit samples.", "Ask for ImageFormat.RAW_SENSOR.")
        }
        val bytes = plane.buffer.duplicate()
        val stride = plane.rowStride.toLong()
        if (stride * (image.height - 1) + 2L * image.width > bytes.capacity()) {
            throw InvalidArgument("$name: the image's buffer is too short.", "Take the photo again.")
        }
        val found = ShortArray(area.width * area.height)
        bytes.limit(bytes.capacity())
        for (row in 0 until area.height) { // which may begin at an odd byte
            bytes.position((stride * (area.top + row) + 2L * area.left).toInt())
            bytes.slice().order(ByteOrder.nativeOrder()).asShortBuffer().get(found, row * area.width, area.width)
        }
        return found
    }

    private fun black(camera: CameraCharacteristics, name: String): DoubleArray {
        val pattern = need(camera, CameraCharacteristics.SENSOR_BLACK_LEVEL_PATTERN, name)
        return DoubleArray(4) { pattern.getOffsetForIndex(it and 1, it shr 1).toDouble() }
    }

    /** Four maps, one a position of the colour filters, as the platform's DNG writer makes them. */
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
            val covered = Region(place and 1, place shr 1, area.width, area.height)
            GainMap(list = 2, covered, plane = 0, planes = 1, rowPitch = 2, columnPitch = 2, net)
        }
    }

    private fun matrix(transform: ColorSpaceTransform?): DoubleArray? =
        transform?.let { each -> DoubleArray(9) { each.getElement(it % 3, it / 3).toDouble() } }

    private fun neutrals(camera: CameraCharacteristics): List<Neutral> {
        fun neutral(light: Int?, transform: ColorSpaceTransform?, own: ColorSpaceTransform?): Neutral? =
            matrix(transform)?.let { Neutral.of(light ?: 0, it, matrix(own)) }
        val first = camera.get(CameraCharacteristics.SENSOR_REFERENCE_ILLUMINANT1)
        val second = camera.get(CameraCharacteristics.SENSOR_REFERENCE_ILLUMINANT2)?.toInt()
        return listOfNotNull(
            neutral(first, camera.get(SENSOR_COLOR_TRANSFORM1), camera.get(SENSOR_CALIBRATION_TRANSFORM1)),
            neutral(second, camera.get(SENSOR_COLOR_TRANSFORM2), camera.get(SENSOR_CALIBRATION_TRANSFORM2)),
        )
    }

    /** One pair a colour; of the two greens the noisier one, as in the platform's DNG. */
    private fun noise(result: CaptureResult, cfa: String): DoubleArray? {
        val profile = result.get(CaptureResult.SENSOR_NOISE_PROFILE)?.takeIf { it.size == 4 } ?: return null
        val green = cfa.indices.filter { cfa[it] == 'G' }.maxByOrNull { profile[it].first }!!
        val pairs = listOf(cfa.indexOf('R'), green, cfa.indexOf('B')).map { profile[it] }
        return pairs.flatMap { listOf(it.first, it.second) }.toDoubleArray()
    }

    private fun <T : Any> need(camera: CameraCharacteristics, key: CameraCharacteristics.Key<T>, name: String): T =
        camera.get(key) ?: throw UnsupportedRaw("$name: the camera does not tell ${key.name}.", "Photograph to DNG.")
}
