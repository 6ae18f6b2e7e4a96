package org.camssf.camera2

import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CameraMetadata
import android.hardware.camera2.CaptureRequest
import android.hardware.camera2.CaptureResult

/**
 * Something that a camera, request or result lacks.
 *
 * @property key Camera2's name of the setting.
 * @property found what it holds, "not set" where nothing.
 * @property wanted what it should hold.
 * @property fatal true where the samples would not be the sensor's own: [RawFrames.read] refuses such a frame. Else the
 *   calibration runs, at a cost that [advice] names.
 * @property advice what to do.
 */
public class Shortfall(
    public val key: String,
    public val found: String,
    public val wanted: String,
    public val fatal: Boolean,
    public val advice: String,
) {
    /** One line. */
    override fun toString(): String = "$key is $found, wanted $wanted: $advice"
}

/**
 * What an app must ask Camera2 for, so that a RAW frame can be measured.
 *
 * | setting | wanted | why |
 * |---|---|---|
 * | noise reduction | off | every other mode may smooth the RAW samples themselves |
 * | test pattern | off | else there is no light in the samples |
 * | lens shading map | on, shading mode not off | how much darker the corners are, where no white frame tells it |
 * | exposure | by hand, the same for chart, white and dark frame | automatic exposure differs between them |
 * | flash | off, not fired | its spectrum would be part of the lamp's |
 *
 * Zoom, crop, white balance, tone curves, stabilisation and the post-RAW boost do not touch RAW.
 */
public object CaptureRequirements {
    /** Sets all of it, with the exposure in ns and the ISO sensitivity, as far as the camera offers it. */
    @JvmStatic
    public fun apply(builder: CaptureRequest.Builder, camera: CameraCharacteristics, exposureTime: Long, iso: Int) {
        if (hasQuietRaw(camera)) {
            builder.set(CaptureRequest.NOISE_REDUCTION_MODE, CameraMetadata.NOISE_REDUCTION_MODE_OFF)
        }
        if (hasShadingMap(camera)) {
            builder.set(CaptureRequest.SHADING_MODE, CameraMetadata.SHADING_MODE_FAST)
            builder.set(CaptureRequest.STATISTICS_LENS_SHADING_MAP_MODE, MAP_ON)
        }
        builder.set(CaptureRequest.FLASH_MODE, CameraMetadata.FLASH_MODE_OFF)
        builder.set(CaptureRequest.CONTROL_AE_MODE, CameraMetadata.CONTROL_AE_MODE_OFF)
        builder.set(CaptureRequest.SENSOR_EXPOSURE_TIME, exposureTime)
        builder.set(CaptureRequest.SENSOR_SENSITIVITY, iso)
    }

    /** What the camera itself cannot do; empty for a camera that serves fully. */
    @JvmStatic
    public fun check(camera: CameraCharacteristics): List<Shortfall> {
        val found = Findings()
        val abilities = camera.get(CameraCharacteristics.REQUEST_AVAILABLE_CAPABILITIES) ?: IntArray(0)
        val raw = CameraMetadata.REQUEST_AVAILABLE_CAPABILITIES_RAW in abilities
        found.unless(raw, "capability RAW", "missing", "offered", true, "Choose another camera of this phone.")
        val filters = camera.get(CameraCharacteristics.SENSOR_INFO_COLOR_FILTER_ARRANGEMENT)
        val bayer = "camssf reads RGGB, GRBG, GBRG and BGGR (0 to 3); choose another camera of this phone."
        found.unless(filters in 0..3, "sensor.info.colorFilterArrangement", filters, "0 to 3", true, bayer)
        val known = "The RAW samples may be smoothed; there is nothing to do but to know it."
        found.unless(hasQuietRaw(camera), "noise reduction OFF", "missing", "offered", false, known)
        return found.list
    }

    /** What the request lacks of the table above, as far as the camera offers it; ask before `build()`. */
    @JvmStatic
    public fun check(request: CaptureRequest.Builder, camera: CameraCharacteristics): List<Shortfall> {
        val found = Findings()
        found.noise(request.get(CaptureRequest.NOISE_REDUCTION_MODE), camera)
        found.pattern(request.get(CaptureRequest.SENSOR_TEST_PATTERN_MODE))
        val map = request.get(CaptureRequest.STATISTICS_LENS_SHADING_MAP_MODE)
        found.shading(request.get(CaptureRequest.SHADING_MODE), map == MAP_ON, camera)
        found.exposure(request.get(CaptureRequest.CONTROL_AE_MODE))
        val flash = request.get(CaptureRequest.FLASH_MODE)
        val off = flash == null || flash == CameraMetadata.FLASH_MODE_OFF
        found.unless(off, "flash.mode", flash, "0 (OFF)", false, FLASH)
        return found.list
    }

    /** What came back otherwise than wanted, as far as the camera offers it. */
    @JvmStatic
    public fun check(result: CaptureResult, camera: CameraCharacteristics): List<Shortfall> {
        val found = Findings()
        found.noise(result.get(CaptureResult.NOISE_REDUCTION_MODE), camera)
        found.pattern(result.get(CaptureResult.SENSOR_TEST_PATTERN_MODE))
        val map = result.get(CaptureResult.STATISTICS_LENS_SHADING_CORRECTION_MAP)
        found.shading(result.get(CaptureResult.SHADING_MODE), map != null, camera)
        found.exposure(result.get(CaptureResult.CONTROL_AE_MODE))
        val flash = result.get(CaptureResult.FLASH_STATE)
        val fired = flash == CameraMetadata.FLASH_STATE_FIRED || flash == CameraMetadata.FLASH_STATE_PARTIAL
        found.unless(!fired, "flash.state", flash, "not fired", false, FLASH)
        return found.list
    }

    private fun hasQuietRaw(camera: CameraCharacteristics): Boolean {
        val modes = camera.get(CameraCharacteristics.NOISE_REDUCTION_AVAILABLE_NOISE_REDUCTION_MODES)
        return modes != null && CameraMetadata.NOISE_REDUCTION_MODE_OFF in modes
    }

    private fun hasShadingMap(camera: CameraCharacteristics): Boolean {
        val modes = camera.get(CameraCharacteristics.STATISTICS_INFO_AVAILABLE_LENS_SHADING_MAP_MODES)
        val shaded = camera.get(CameraCharacteristics.SENSOR_INFO_LENS_SHADING_APPLIED) == true
        return !shaded && modes != null && MAP_ON in modes
    }

    private const val MAP_ON = CameraMetadata.STATISTICS_LENS_SHADING_MAP_MODE_ON
    private const val FLASH = "Switch it off, or give the lamp's spectrum with the flash in it."

    private class Findings {
        val list = ArrayList<Shortfall>()

        fun unless(good: Boolean, key: String, value: Any?, wanted: String, fatal: Boolean, advice: String) {
            if (!good) list += Shortfall(key, (value ?: "not set").toString(), wanted, fatal, advice)
        }

        fun noise(mode: Int?, camera: CameraCharacteristics) {
            val off = mode == CameraMetadata.NOISE_REDUCTION_MODE_OFF
            val can = hasQuietRaw(camera)
            val advice = if (can) "Ask for OFF." else "The camera cannot do without; the samples may be smoothed."
            // A result without the mode says nothing against the samples.
            unless(off, "noiseReduction.mode", mode, "0 (OFF)", can && mode != null, advice)
        }

        fun pattern(mode: Int?) {
            val off = mode == null || mode == CameraMetadata.SENSOR_TEST_PATTERN_MODE_OFF
            unless(off, "sensor.testPatternMode", mode, "0 (OFF)", true, "Ask for OFF.")
        }

        fun shading(mode: Int?, present: Boolean, camera: CameraCharacteristics) {
            if (!hasShadingMap(camera)) return
            val advice = "Ask for it, or take a white frame: else the lens' vignetting stays in the patches."
            unless(present, "statistics.lensShadingMapMode", "missing", "1 (ON)", false, advice)
            val on = mode != CameraMetadata.SHADING_MODE_OFF
            unless(on, "shading.mode", mode, "1 (FAST)", false, "Ask for FAST: with OFF the map may be all ones.")
        }

        fun exposure(mode: Int?) {
            val advice = "Set exposure time and sensitivity by hand, the same for chart, white and dark frame."
            unless(mode == CameraMetadata.CONTROL_AE_MODE_OFF, "control.aeMode", mode, "0 (OFF)", false, advice)
        }
    }
}
