package org.camssf.camera2

import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CameraMetadata
import android.hardware.camera2.CaptureRequest
import android.hardware.camera2.CaptureResult
import android.util.Range

/**
 * A requirement that a camera, request or result does not meet.
 *
 * @property key Camera2's name of the setting.
 * @property found its value; "not set" if it has none.
 * @property wanted the value that it should have.
 * @property fatal true if the frame would not be what was requested: for example samples other than the sensor's own,
 *   which [RawFrames.read] refuses, or an exposure that the camera cannot set. Otherwise the calibration runs, with
 *   the disadvantage that [advice] names.
 * @property advice what to do.
 */
public class Shortfall(
    public val key: String,
    public val found: String,
    public val wanted: String,
    public val fatal: Boolean,
    public val advice: String,
) {
    private fun parts() = listOf(key, found, wanted, fatal, advice)

    override fun equals(other: Any?): Boolean = other is Shortfall && parts() == other.parts()

    override fun hashCode(): Int = parts().hashCode()

    /** The shortfall as one line. */
    override fun toString(): String = "$key is $found, wanted $wanted: $advice"
}

/**
 * The settings that an app must request from Camera2, so that a RAW frame can be measured.
 *
 * | setting | wanted | why |
 * |---|---|---|
 * | noise reduction | off | every other mode may smooth the RAW samples themselves |
 * | test pattern | off | a test pattern replaces the light in the samples |
 * | lens shading map | on, shading mode not off | it gives the vignetting if there is no white frame |
 * | exposure | set manually, the same for chart, white and dark frame | automatic exposure differs between them |
 * | flash | off, not fired | its spectrum would be part of the lamp's |
 * | focus | on the chart, locked | set by the app: [apply] does not change it |
 *
 * Begin with `TEMPLATE_STILL_CAPTURE`, focus on the chart and lock (`CONTROL_AF_TRIGGER`, until the state is
 * `FOCUSED_LOCKED`), and take all frames with the same focus mode. `TEMPLATE_MANUAL` switches the autofocus off and
 * needs the capability MANUAL_SENSOR.
 *
 * Zoom, crop, white balance, tone curves, stabilisation and the post-RAW boost do not affect RAW samples.
 */
public object CaptureRequirements {
    /**
     * Sets all of these except the focus, as far as the camera offers them; [check] then lists what is missing.
     *
     * @param builder from `TEMPLATE_STILL_CAPTURE` or another template.
     * @param camera the camera of the request; without MANUAL_SENSOR the exposure stays automatic.
     * @param exposureTime ns.
     * @param iso sensitivity.
     */
    @JvmStatic
    public fun apply(builder: CaptureRequest.Builder, camera: CameraCharacteristics, exposureTime: Long, iso: Int) {
        for ((key, value) in settings(camera)) builder.set(key, value)
        builder.set(CaptureRequest.FLASH_MODE, CameraMetadata.FLASH_MODE_OFF)
        if (isManual(camera)) set(builder, manual(exposureTime, iso))
    }

    /**
     * Sets [locks] in a request of live frames, whose exposure and white balance should stay the same. The next request
     * without them is unlocked.
     *
     * @param builder of the repeating request.
     * @param exposureTime ns.
     * @param iso sensitivity.
     */
    @JvmStatic
    public fun lock(builder: CaptureRequest.Builder, camera: CameraCharacteristics, exposureTime: Long, iso: Int) {
        set(builder, locks(camera, exposureTime, iso))
    }

    /**
     * The settings that keep exposure time, ISO and white balance the same in successive frames, as far as the camera
     * offers them, for an API that takes keys with values; [checkLocks] lists what it does not offer. Without
     * MANUAL_SENSOR the automatic exposure is kept as it is. The focus is the app's.
     *
     * @param exposureTime ns.
     * @param iso sensitivity.
     * @return values of the keys' own types.
     */
    @JvmStatic
    public fun locks(camera: CameraCharacteristics, exposureTime: Long, iso: Int): Map<CaptureRequest.Key<*>, Any> {
        val found = LinkedHashMap<CaptureRequest.Key<*>, Any>()
        if (isManual(camera)) {
            found += manual(exposureTime, iso)
        } else if (camera.get(CameraCharacteristics.CONTROL_AE_LOCK_AVAILABLE) == true) {
            found[CaptureRequest.CONTROL_AE_LOCK] = true
        }
        if (camera.get(CameraCharacteristics.CONTROL_AWB_LOCK_AVAILABLE) == true) {
            found[CaptureRequest.CONTROL_AWB_LOCK] = true
        }
        return found
    }

    /** What [locks] cannot keep the same with this camera; fatal is an exposure that it does not offer. */
    @JvmStatic
    public fun checkLocks(camera: CameraCharacteristics, exposureTime: Long, iso: Int): List<Shortfall> {
        val found = Findings()
        if (isManual(camera)) {
            found.offered(camera, exposureTime, iso)
        } else {
            val locked = camera.get(CameraCharacteristics.CONTROL_AE_LOCK_AVAILABLE)
            val kept = "The automatic exposure is kept as it is: let it settle on the scene before it is locked."
            val scaled =
                "The exposure stays automatic: keep the white in each frame, or colours are scaled by what " +
                    "the frames state of it."
            val advice = if (locked == true) kept else scaled
            found.unless(false, "capability MANUAL_SENSOR", "missing", "offered", false, advice)
            found.unless(locked == true, "control.aeLockAvailable", locked, "true", false, scaled)
        }
        val white = camera.get(CameraCharacteristics.CONTROL_AWB_LOCK_AVAILABLE)
        val preview = "The preview's colours may change from frame to frame; RAW samples do not depend on it."
        found.unless(white == true, "control.awbLockAvailable", white, "true", false, preview)
        return found.list
    }

    private fun manual(exposureTime: Long, iso: Int): Map<CaptureRequest.Key<*>, Any> = mapOf(
        // A scene mode would override the values below.
        CaptureRequest.CONTROL_MODE to CameraMetadata.CONTROL_MODE_AUTO,
        CaptureRequest.CONTROL_AE_MODE to CameraMetadata.CONTROL_AE_MODE_OFF,
        CaptureRequest.SENSOR_EXPOSURE_TIME to exposureTime,
        CaptureRequest.SENSOR_SENSITIVITY to iso,
    )

    @Suppress("UNCHECKED_CAST") // each value has its key's type
    private fun set(builder: CaptureRequest.Builder, settings: Map<CaptureRequest.Key<*>, Any>) {
        for ((key, value) in settings) builder.set(key as CaptureRequest.Key<Any>, value)
    }

    /**
     * The settings of noise reduction and lens shading, as far as the camera offers them, for an API that takes keys
     * with values, such as CameraX's interop.
     */
    @JvmStatic
    public fun settings(camera: CameraCharacteristics): Map<CaptureRequest.Key<Int>, Int> {
        val found = LinkedHashMap<CaptureRequest.Key<Int>, Int>()
        if (hasQuietRaw(camera)) {
            found[CaptureRequest.NOISE_REDUCTION_MODE] = CameraMetadata.NOISE_REDUCTION_MODE_OFF
        }
        if (hasShadingMap(camera)) {
            found[CaptureRequest.SHADING_MODE] = CameraMetadata.SHADING_MODE_FAST
            found[CaptureRequest.STATISTICS_LENS_SHADING_MAP_MODE] = MAP_ON
        }
        return found
    }

    /**
     * What the camera itself does not offer; empty if it offers everything.
     *
     * @param manualExposure true if chart, white and dark frame need the same exposure; false for a chart alone.
     */
    @JvmStatic
    @JvmOverloads
    public fun check(camera: CameraCharacteristics, manualExposure: Boolean = true): List<Shortfall> {
        val found = Findings()
        val raw = can(camera, CameraMetadata.REQUEST_AVAILABLE_CAPABILITIES_RAW)
        found.unless(raw, "capability RAW", "missing", "offered", true, "Choose another camera of this phone.")
        if (manualExposure) found.manual(camera)
        val filters = camera.get(CameraCharacteristics.SENSOR_INFO_COLOR_FILTER_ARRANGEMENT)
        val bayer = "camssf reads RGGB, GRBG, GBRG and BGGR (0 to 3); choose another camera of this phone."
        found.unless(filters in 0..3, "sensor.info.colorFilterArrangement", filters, "0 to 3", true, bayer)
        val known = "The RAW samples may be smoothed; there is nothing to do but to know it."
        found.unless(hasQuietRaw(camera), "noise reduction OFF", "missing", "offered", false, known)
        return found.list
    }

    /** What the request lacks of the table above, as far as the camera offers it; call this before `build()`. */
    @JvmStatic
    public fun check(request: CaptureRequest.Builder, camera: CameraCharacteristics): List<Shortfall> {
        val found = Findings()
        found.noise(request.get(CaptureRequest.NOISE_REDUCTION_MODE), camera)
        found.pattern(request.get(CaptureRequest.SENSOR_TEST_PATTERN_MODE))
        val map = request.get(CaptureRequest.STATISTICS_LENS_SHADING_MAP_MODE)
        found.shading(request.get(CaptureRequest.SHADING_MODE), map == MAP_ON, camera)
        found.exposure(request, camera)
        found.focus(request, camera)
        val flash = request.get(CaptureRequest.FLASH_MODE)
        val off = flash == null || flash == CameraMetadata.FLASH_MODE_OFF
        found.unless(off, "flash.mode", flash, "0 (OFF)", false, FLASH)
        return found.list
    }

    /** What differs in the result from the table above, as far as the camera offers it. */
    @JvmStatic
    public fun check(result: CaptureResult, camera: CameraCharacteristics): List<Shortfall> {
        val found = Findings()
        found.noise(result.get(CaptureResult.NOISE_REDUCTION_MODE), camera)
        found.pattern(result.get(CaptureResult.SENSOR_TEST_PATTERN_MODE))
        val map = result.get(CaptureResult.STATISTICS_LENS_SHADING_CORRECTION_MAP)
        found.shading(result.get(CaptureResult.SHADING_MODE), map != null, camera)
        found.exposure(result.get(CaptureResult.CONTROL_AE_MODE))
        val lens = result.get(CaptureResult.LENS_STATE)
        val moving = "Focus on the chart, lock, and take it again: the patches may be blurred."
        found.unless(lens != CameraMetadata.LENS_STATE_MOVING, "lens.state", lens, "0 (STATIONARY)", false, moving)
        val flash = result.get(CaptureResult.FLASH_STATE)
        val fired = flash == CameraMetadata.FLASH_STATE_FIRED || flash == CameraMetadata.FLASH_STATE_PARTIAL
        found.unless(!fired, "flash.state", flash, "not fired", false, FLASH)
        return found.list
    }

    private fun can(camera: CameraCharacteristics, ability: Int): Boolean =
        camera.get(CameraCharacteristics.REQUEST_AVAILABLE_CAPABILITIES)?.let { ability in it } == true

    private fun isManual(camera: CameraCharacteristics): Boolean =
        can(camera, CameraMetadata.REQUEST_AVAILABLE_CAPABILITIES_MANUAL_SENSOR)

    private fun hasQuietRaw(camera: CameraCharacteristics): Boolean {
        val modes = camera.get(CameraCharacteristics.NOISE_REDUCTION_AVAILABLE_NOISE_REDUCTION_MODES)
        return modes != null && CameraMetadata.NOISE_REDUCTION_MODE_OFF in modes
    }

    private fun hasShadingMap(camera: CameraCharacteristics): Boolean {
        val modes = camera.get(CameraCharacteristics.STATISTICS_INFO_AVAILABLE_LENS_SHADING_MAP_MODES)
        val shaded = camera.get(CameraCharacteristics.SENSOR_INFO_LENS_SHADING_APPLIED) == true
        return !shaded && modes != null && MAP_ON in modes
    }

    private const val AF_OFF = CameraMetadata.CONTROL_AF_MODE_OFF
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
            // Without the mode in a result, nothing shows that the samples were changed.
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

        fun manual(camera: CameraCharacteristics) {
            val advice = "Choose another camera of this phone, or take the chart alone with automatic exposure."
            unless(isManual(camera), "capability MANUAL_SENSOR", "missing", "offered", true, advice)
        }

        fun exposure(request: CaptureRequest.Builder, camera: CameraCharacteristics) {
            val mode = request.get(CaptureRequest.CONTROL_AE_MODE)
            exposure(mode)
            if (mode != CameraMetadata.CONTROL_AE_MODE_OFF) return
            manual(camera)
            val time = request.get(CaptureRequest.SENSOR_EXPOSURE_TIME)
            offered(camera, time, request.get(CaptureRequest.SENSOR_SENSITIVITY))
        }

        fun offered(camera: CameraCharacteristics, exposureTime: Long?, iso: Int?) {
            val times = camera.get(CameraCharacteristics.SENSOR_INFO_EXPOSURE_TIME_RANGE)
            within(times, "sensor.exposureTime", exposureTime)
            val sensitivities = camera.get(CameraCharacteristics.SENSOR_INFO_SENSITIVITY_RANGE)
            within(sensitivities, "sensor.sensitivity", iso)
        }

        private fun <T : Comparable<T>> within(offered: Range<T>?, key: String, value: T?) {
            val good = value != null && offered?.contains(value) != false
            val wanted = offered?.let { "${it.lower} to ${it.upper}" } ?: "set by hand"
            unless(good, key, value, wanted, true, "Ask for what the camera offers, and change the light instead.")
        }

        fun focus(request: CaptureRequest.Builder, camera: CameraCharacteristics) {
            val nearest = camera.get(CameraCharacteristics.LENS_INFO_MINIMUM_FOCUS_DISTANCE) ?: 0f
            if (nearest <= 0f || request.get(CaptureRequest.CONTROL_AF_MODE) != AF_OFF) return
            val distance = request.get(CaptureRequest.LENS_FOCUS_DISTANCE)
            val advice = "Begin with TEMPLATE_STILL_CAPTURE and lock the focus on the chart, or set its distance."
            val near = distance != null && distance > 0f
            unless(near, "lens.focusDistance", distance, "the chart's, in 1/m", false, advice)
        }
    }
}
