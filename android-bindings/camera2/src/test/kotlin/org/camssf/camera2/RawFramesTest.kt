package org.camssf.camera2

import android.graphics.ImageFormat
import android.graphics.Rect
import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CameraMetadata
import android.hardware.camera2.CaptureResult
import android.hardware.camera2.params.BlackLevelPattern
import android.hardware.camera2.params.ColorSpaceTransform
import android.hardware.camera2.params.LensShadingMap
import android.media.Image
import android.os.Build
import android.util.Pair
import android.util.Range
import android.util.Rational
import android.util.Size
import org.camssf.CalibrationException
import org.camssf.InvalidArgument
import org.camssf.NotSensorRaw
import org.camssf.Rows
import org.camssf.UnsupportedRaw
import org.camssf.photo.Region
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.junit.Assert.assertArrayEquals
import org.junit.Assert.assertEquals
import org.junit.Assert.assertNull
import org.junit.Assert.assertThrows
import org.junit.Assert.assertTrue
import org.junit.Test
import org.junit.jupiter.api.Tag
import org.junit.runner.RunWith
import org.mockito.Mockito.mock
import org.mockito.Mockito.`when`
import org.robolectric.RobolectricTestRunner
import org.robolectric.annotation.Config
import org.robolectric.shadow.api.Shadow
import org.robolectric.shadows.ShadowBuild
import org.robolectric.shadows.ShadowCameraCharacteristics
import org.robolectric.shadows.ShadowCaptureResult
import org.robolectric.util.ReflectionHelpers
import java.nio.ByteBuffer
import java.nio.ByteOrder
import java.security.MessageDigest

/** A sensor of 8 × 6 samples, 6 × 4 of them active from (2, 2) on; the sample at (x, y) is 100 y + x. */
@Tag("R-CAMERA2")
@RunWith(RobolectricTestRunner::class)
@Config(sdk = [35])
class RawFramesTest {
    private val camera = camera()
    private val result = result()

    private fun assertClose(known: Rows, found: Rows, bound: Double) {
        assertEquals(known.shape, found.shape)
        assertArrayEquals(known.toDoubleArray(), found.toDoubleArray(), bound)
    }

    @Test
    fun `a frame of the whole sensor is cut to its active array`() {
        for (stride in listOf(16, 17, 24)) { // a row may be padded, even by an odd number of bytes
            val frame = read(image(8, 6, stride))
            assertEquals(6, frame.mosaic.width)
            assertEquals(4, frame.mosaic.height)
            for (y in 0 until 4) for (x in 0 until 6) assertEquals(100 * (y + 2) + x + 2, frame.mosaic[x, y])
        }
    }

    @Test
    fun `a frame of the active array alone is taken whole`() {
        val mosaic = read(image(6, 4, 12)).mosaic
        for (y in 0 until 4) for (x in 0 until 6) assertEquals(100 * y + x, mosaic[x, y])
    }

    @Test
    fun `the physical camera and its lens are on record`() {
        val own = result {
            it[CaptureResult.LENS_FOCAL_LENGTH] = 6.81f
            it[CaptureResult.LENS_APERTURE] = 1.85f
            it[CaptureResult.LOGICAL_MULTI_CAMERA_ACTIVE_PHYSICAL_ID] = "3"
        }
        val said = read(image(), result = own).mosaic.origin.camera
        assertEquals("3", said.id)
        assertEquals(6.81, said.focalLength!!, 1e-6)
        assertEquals(1.85, said.aperture!!, 1e-6)
        assertEquals(Region.ofSize(left = 2, top = 2, width = 6, height = 4), said.activeArea)
        assertEquals("", read(image()).mosaic.origin.camera.lens)
    }

    @Test
    fun `before API 29 no frame knows its physical camera`() {
        val own = result { it[CaptureResult.LOGICAL_MULTI_CAMERA_ACTIVE_PHYSICAL_ID] = "3" }
        val now = Build.VERSION.SDK_INT
        try {
            for ((version, id) in listOf(28 to "", 29 to "3", 35 to "3")) {
                ReflectionHelpers.setStaticField(Build.VERSION::class.java, "SDK_INT", version)
                assertEquals(id, read(image(), result = own).mosaic.origin.camera.id)
            }
        } finally {
            ReflectionHelpers.setStaticField(Build.VERSION::class.java, "SDK_INT", now)
        }
    }

    @Test
    fun `a region is copied alone`() {
        for (image in listOf(image(8, 6, 17), image(6, 4, 12))) {
            val whole = read(image).mosaic
            val region = Region.ofSize(left = 2, top = 1, width = 7, height = 2)
            val part = RawFrames.read(image, camera, result, "frame", region).mosaic
            assertEquals(Region.ofSize(left = 2, top = 1, width = 4, height = 2), part.region)
            assertEquals(8, part.samples.size)
            for (y in 1 until 3) for (x in 2 until 6) assertEquals(whole[x, y], part[x, y])
            assertEquals(listOf(whole.width, whole.height), listOf(part.width, part.height))
        }
        assertCode<InvalidArgument>("lies outside frame") {
            RawFrames.read(image(), camera, result, "frame", Region.ofSize(left = 6, top = 0, width = 3, height = 3))
        }
    }

    @Test
    fun `an open frame is read where it lies, until its image is closed`() {
        val image = image(8, 6, 17)
        val whole = read(image).mosaic
        val frame = RawFrames.open(image, camera, result, "frame")
        assertEquals(listOf(0, false), listOf(frame.noiseReduction, frame.lensShadingApplied))
        val part = frame.photo.read(Region.ofSize(left = 1, top = 1, width = 4, height = 3))
        for (y in 1 until 4) for (x in 1 until 5) assertEquals(whole[x, y], part[x, y])
        assertEquals(whole.corrections.gainMaps.size, part.corrections.gainMaps.size)
        // as a result names a frame without a file: the hash of all its samples
        val bytes = ByteBuffer.allocate(48).order(ByteOrder.LITTLE_ENDIAN)
        whole.samples.forEach { bytes.putShort(it) }
        val digest = MessageDigest.getInstance("SHA-256").digest(bytes.array())
        assertEquals(digest.joinToString("") { "%02x".format(it) }, part.origin.sha256)
        `when`(image.format).thenThrow(IllegalStateException("Image is already closed"))
        assertCode<InvalidArgument>("closed") { frame.photo.read(null) }
    }

    @Test
    fun `samples above 32767 stay positive`() {
        assertEquals(65535, read(image(6, 4, 12) { _, _ -> 65535 }).mosaic[5, 3])
    }

    @Test
    fun `a last row without padding is enough`() {
        val image = image(6, 4, 20, last = 12)
        assertEquals(305, read(image).mosaic[5, 3])
        assertCode<InvalidArgument>("too short") { read(image(6, 4, 20, last = 11)) }
    }

    @Test
    fun `the frame's own levels go before the camera's`() {
        val own = read(image())
        assertArrayEquals(doubleArrayOf(64.25, 63.5, 64.75, 65.0), own.mosaic.sensor.black.toDoubleArray(), 0.0)
        assertEquals(1010.0, own.mosaic.sensor.white, 0.0)
        val bare = result {
            it.remove(CaptureResult.SENSOR_DYNAMIC_BLACK_LEVEL)
            it.remove(CaptureResult.SENSOR_DYNAMIC_WHITE_LEVEL)
        }
        val static = read(image(), result = bare)
        assertArrayEquals(doubleArrayOf(60.0, 61.0, 62.0, 63.0), static.mosaic.sensor.black.toDoubleArray(), 0.0)
        assertEquals(1023.0, static.mosaic.sensor.white, 0.0)
    }

    @Test
    fun `filters, exposure, colours and noise are the camera's`() {
        val mosaic = read(image()).mosaic
        assertEquals("frame", mosaic.name)
        assertEquals("GRBG", mosaic.sensor.cfa)
        assertEquals(0.01, mosaic.origin.exposure!!, 1e-15)
        assertEquals(200.0, mosaic.origin.iso!!, 0.0)
        assertEquals(6, mosaic.origin.orientation)
        assertArrayEquals(doubleArrayOf(0.433, 1.0, 1.105), mosaic.colours.asShotNeutral!!.toDoubleArray(), 0.0)
        assertArrayEquals(
            DoubleArray(9) {
                MATRIX[it] / 10_000.0
            },
            mosaic.colours.colorMatrix1!!.toDoubleArray(), 1e-15,
        )
        assertNull(mosaic.colours.colorMatrix2)
        // GRBG: R is position 1, the noisier green position 3, B position 2.
        val noise = mosaic.sensor.noiseProfile!!.toDoubleArray()
        assertArrayEquals(doubleArrayOf(2e-4, 2e-6, 4e-4, 4e-6, 3e-4, 3e-6), noise, 1e-18)
    }

    /** By it the calibrator believes in phones or cameras before it looks. */
    @Test
    fun `the maker is the phone's own`() {
        ShadowBuild.setManufacturer("Google")
        assertEquals("Google", read(image()).mosaic.origin.make)
    }

    @Test
    fun `the shading map becomes a gain map a filter position`() {
        val maps = read(image()).mosaic.corrections.gainMaps
        // GRBG in the order R, green of the even row, green of the odd row, B.
        assertEquals(listOf(1 to 0, 0 to 0, 1 to 1, 0 to 1), maps.map { it.area.left to it.area.top })
        maps.forEachIndexed { channel, map ->
            assertEquals(listOf(2, 3), listOf(map.pointsV, map.pointsH))
            assertEquals(listOf(2, 2), listOf(map.rowPitch, map.columnPitch))
            assertEquals(listOf(6, 4), listOf(map.area.right, map.area.bottom))
            assertEquals(1.0, map.spacingV, 0.0)
            assertEquals(0.5, map.spacingH, 0.0)
            assertArrayEquals(DoubleArray(6) { 1.0 + it + channel / 10.0 }, map.gains.toDoubleArray(), 1e-6)
        }
    }

    @Test
    fun `a map that is in the samples already is not handed on`() {
        val shaded = camera { it[CameraCharacteristics.SENSOR_INFO_LENS_SHADING_APPLIED] = true }
        val frame = read(image(), shaded)
        assertTrue(frame.mosaic.corrections.gainMaps.isEmpty())
        assertEquals(true, frame.lensShadingApplied)
    }

    @Test
    fun `what is no RAW frame of this capture is refused`() {
        assertCode<InvalidArgument>("format 37") { read(image(format = ImageFormat.RAW10)) }
        assertCode<InvalidArgument>("different captures") { read(image(time = 5)) }
        assertCode<UnsupportedRaw>("10 × 6") { read(image(10, 6, 20)) }
        assertCode<UnsupportedRaw>("one plane") { read(image(6, 4, 12, pixel = 4)) }
        val closed = image()
        `when`(closed.format).thenThrow(IllegalStateException("Image is already closed"))
        assertCode<InvalidArgument>("closed") { read(closed) }
    }

    @Test
    fun `a sensor that is not Bayer or begins at an odd place is refused`() {
        val mono = camera { it[CameraCharacteristics.SENSOR_INFO_COLOR_FILTER_ARRANGEMENT] = 5 }
        assertCode<UnsupportedRaw>("arrangement 5") { read(image(), mono) }
        val odd = camera { it[CameraCharacteristics.SENSOR_INFO_PRE_CORRECTION_ACTIVE_ARRAY_SIZE] = Rect(1, 2, 7, 6) }
        assertCode<UnsupportedRaw>("odd place") { read(image(), odd) }
        read(image(6, 4, 12), odd) // its own corner is certain
    }

    @Test
    fun `samples that were changed are refused`() {
        for (mode in listOf(CameraMetadata.NOISE_REDUCTION_MODE_MINIMAL, CameraMetadata.NOISE_REDUCTION_MODE_FAST)) {
            val smoothed = result { it[CaptureResult.NOISE_REDUCTION_MODE] = mode }
            assertCode<NotSensorRaw>("noiseReduction.mode is $mode") { read(image(), result = smoothed) }
            val modes = CameraCharacteristics.NOISE_REDUCTION_AVAILABLE_NOISE_REDUCTION_MODES
            val unable = camera { it[modes] = intArrayOf(1) }
            val frame = read(image(), unable, smoothed) // no OFF on this camera: taken, and on record
            assertEquals(mode, frame.noiseReduction)
            assertEquals(listOf("noiseReduction.mode"), frame.shortfalls.map { it.key })
        }
        val bars = result { it[CaptureResult.SENSOR_TEST_PATTERN_MODE] = 2 }
        assertCode<NotSensorRaw>("testPattern") { read(image(), result = bars) }
    }

    @Test
    fun `a camera that keeps a level to itself is refused by name`() {
        val silent = camera { it.remove(CameraCharacteristics.SENSOR_BLACK_LEVEL_PATTERN) }
        read(image(), silent) // the frame's own level is enough
        val bare = result { it.remove(CaptureResult.SENSOR_DYNAMIC_BLACK_LEVEL) }
        assertCode<UnsupportedRaw>("blackLevelPattern") { read(image(), silent, bare) }
    }

    @Test
    fun `the DNG of the same frame gives the same mosaic`() {
        val frame = read(image()).mosaic
        val bytes = androidDng(8, 6) { x, y -> 100 * y + x }
        val file = DngReader.read(DngSource.of(bytes, "frame"))
        assertArrayEquals(file.samples, frame.samples)
        assertEquals(listOf(file.width, file.height), listOf(frame.width, frame.height))
        assertEquals(file.sensor.cfa, frame.sensor.cfa)
        assertEquals(listOf(file.origin.orientation, file.region), listOf(frame.origin.orientation, frame.region))
        assertEquals(listOf(file.origin.exposure, file.origin.iso), listOf(frame.origin.exposure, frame.origin.iso))
        assertClose(file.sensor.black, frame.sensor.black, 0.005) // written in 1/100
        assertClose(file.colours.colorMatrix1!!, frame.colours.colorMatrix1!!, 1e-15)
        assertEquals(file.colours.asShotNeutral, frame.colours.asShotNeutral)
        assertClose(file.sensor.noiseProfile!!, frame.sensor.noiseProfile!!, 1e-18)
        assertEquals(listOf("D65"), frame.colours.colourMatrices.map { it.light })
        assertEquals(listOf("D65"), file.colours.colourMatrices.map { it.light })
        val (known, found) = listOf(file, frame).map { it.colours.colourMatrices[0].values.toDoubleArray() }
        assertArrayEquals(known, found, 1e-15)
        assertEquals(4, file.corrections.gainMaps.size)
        for ((ours, theirs) in frame.corrections.gainMaps zip file.corrections.gainMaps) {
            assertEquals(theirs.gains, ours.gains)
            assertEquals(theirs.area, ours.area)
            assertEquals(listOf(theirs.rowPitch, theirs.pointsV), listOf(ours.rowPitch, ours.pointsV))
            assertEquals(listOf(theirs.spacingV, theirs.spacingH), listOf(ours.spacingV, ours.spacingH))
        }
    }

    private fun read(
        image: Image,
        camera: CameraCharacteristics = this.camera,
        result: CaptureResult = this.result,
    ) = RawFrames.read(image, camera, result, "frame")

    private inline fun <reified T : CalibrationException> assertCode(words: String, crossinline run: () -> Unit) {
        val error = assertThrows(T::class.java) { run() }
        assertTrue(error.toString(), words in error.message)
        assertTrue(error.advice.isNotEmpty())
    }

    private fun image(
        width: Int = 8,
        height: Int = 6,
        stride: Int = 2 * width,
        last: Int = stride,
        format: Int = ImageFormat.RAW_SENSOR,
        time: Long = 77L,
        pixel: Int = 2,
        sample: (Int, Int) -> Int = { x, y -> 100 * y + x },
    ): Image {
        val bytes = ByteBuffer.allocateDirect(stride * (height - 1) + last).order(ByteOrder.nativeOrder())
        for (i in 0 until bytes.capacity()) bytes.put(i, -1)
        for (y in 0 until height) {
            for (x in 0 until width) {
                val at = stride * y + 2 * x
                if (at + 1 < bytes.capacity()) bytes.putShort(at, sample(x, y).toShort())
            }
        }
        val plane = mock(Image.Plane::class.java)
        `when`(plane.buffer).thenReturn(bytes)
        `when`(plane.rowStride).thenReturn(stride)
        `when`(plane.pixelStride).thenReturn(pixel)
        val image = mock(Image::class.java)
        `when`(image.format).thenReturn(format)
        `when`(image.timestamp).thenReturn(time)
        `when`(image.width).thenReturn(width)
        `when`(image.height).thenReturn(height)
        `when`(image.planes).thenReturn(arrayOf(plane))
        return image
    }
}

/** Camera2's keys and values; Robolectric's framework objects hold them. */
internal class Values<K : Any> : HashMap<K, Any>()

internal fun camera(change: (Values<CameraCharacteristics.Key<*>>) -> Unit = {}): CameraCharacteristics {
    val values = Values<CameraCharacteristics.Key<*>>()
    values[CameraCharacteristics.SENSOR_INFO_COLOR_FILTER_ARRANGEMENT] = 1
    values[CameraCharacteristics.SENSOR_INFO_PIXEL_ARRAY_SIZE] = Size(8, 6)
    values[CameraCharacteristics.SENSOR_INFO_PRE_CORRECTION_ACTIVE_ARRAY_SIZE] = Rect(2, 2, 8, 6)
    values[CameraCharacteristics.SENSOR_INFO_WHITE_LEVEL] = 1023
    values[CameraCharacteristics.SENSOR_BLACK_LEVEL_PATTERN] = BlackLevelPattern(intArrayOf(60, 61, 62, 63))
    values[CameraCharacteristics.SENSOR_INFO_LENS_SHADING_APPLIED] = false
    values[CameraCharacteristics.SENSOR_ORIENTATION] = 90
    values[CameraCharacteristics.SENSOR_COLOR_TRANSFORM1] =
        ColorSpaceTransform(Array(9) { Rational(MATRIX[it], 10_000) })
    values[CameraCharacteristics.SENSOR_CALIBRATION_TRANSFORM1] =
        ColorSpaceTransform(Array(9) { Rational(if (it % 4 == 0) 10 + it else 0, 10) })
    values[CameraCharacteristics.SENSOR_REFERENCE_ILLUMINANT1] = 21
    values[CameraCharacteristics.SENSOR_REFERENCE_ILLUMINANT2] = 17.toByte()
    values[CameraCharacteristics.NOISE_REDUCTION_AVAILABLE_NOISE_REDUCTION_MODES] = intArrayOf(0, 1, 2)
    values[CameraCharacteristics.STATISTICS_INFO_AVAILABLE_LENS_SHADING_MAP_MODES] = intArrayOf(0, 1)
    values[CameraCharacteristics.REQUEST_AVAILABLE_CAPABILITIES] = intArrayOf(0, 1, 3)
    values[CameraCharacteristics.SENSOR_INFO_EXPOSURE_TIME_RANGE] = Range(100_000L, 1_000_000_000L)
    values[CameraCharacteristics.SENSOR_INFO_SENSITIVITY_RANGE] = Range(50, 3200)
    values[CameraCharacteristics.LENS_INFO_MINIMUM_FOCUS_DISTANCE] = 10f
    change(values)
    val camera = ShadowCameraCharacteristics.newCameraCharacteristics()
    val shadow = Shadow.extract<ShadowCameraCharacteristics>(camera)
    @Suppress("UNCHECKED_CAST")
    for ((key, value) in values) shadow.set(key as CameraCharacteristics.Key<Any>, value)
    return camera
}

internal fun result(change: (Values<CaptureResult.Key<*>>) -> Unit = {}): CaptureResult {
    val values = Values<CaptureResult.Key<*>>()
    values[CaptureResult.SENSOR_TIMESTAMP] = 77L
    values[CaptureResult.SENSOR_DYNAMIC_BLACK_LEVEL] = floatArrayOf(64.25f, 63.5f, 64.75f, 65f)
    values[CaptureResult.SENSOR_DYNAMIC_WHITE_LEVEL] = 1010
    values[CaptureResult.SENSOR_EXPOSURE_TIME] = 10_000_000L
    values[CaptureResult.SENSOR_SENSITIVITY] = 200
    values[CaptureResult.SENSOR_NEUTRAL_COLOR_POINT] =
        arrayOf(Rational(433, 1000), Rational(1, 1), Rational(1105, 1000))
    values[CaptureResult.SENSOR_NOISE_PROFILE] = Array(4) { Pair(1e-4 * (it + 1), 1e-6 * (it + 1)) }
    values[CaptureResult.STATISTICS_LENS_SHADING_CORRECTION_MAP] =
        LensShadingMap(FloatArray(24) { 1f + it / 4 + (it % 4) / 10f }, 2, 3)
    values[CaptureResult.NOISE_REDUCTION_MODE] = CameraMetadata.NOISE_REDUCTION_MODE_OFF
    values[CaptureResult.SHADING_MODE] = CameraMetadata.SHADING_MODE_FAST
    values[CaptureResult.CONTROL_AE_MODE] = CameraMetadata.CONTROL_AE_MODE_OFF
    values[CaptureResult.FLASH_STATE] = CameraMetadata.FLASH_STATE_READY
    change(values)
    val result = ShadowCaptureResult.newCaptureResult()
    val shadow = Shadow.extract<ShadowCaptureResult>(result)
    @Suppress("UNCHECKED_CAST")
    for ((key, value) in values) shadow.set(key as CaptureResult.Key<Any>, value)
    return result
}
