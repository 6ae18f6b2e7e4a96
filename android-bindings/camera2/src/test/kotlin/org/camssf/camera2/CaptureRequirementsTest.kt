package org.camssf.camera2

import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CameraMetadata
import android.hardware.camera2.CaptureRequest
import android.hardware.camera2.CaptureResult
import android.hardware.camera2.impl.CameraMetadataNative
import org.junit.Assert.assertEquals
import org.junit.Assert.assertTrue
import org.junit.Test
import org.junit.jupiter.api.Tag
import org.junit.runner.RunWith
import org.robolectric.RobolectricTestRunner
import org.robolectric.annotation.Config

@Tag("R-CAMERA2")
@RunWith(RobolectricTestRunner::class)
@Config(sdk = [35])
class CaptureRequirementsTest {
    @Test
    fun `a request made by apply lacks nothing`() {
        assertEquals(emptyList<String>(), lacking(CaptureRequirements.check(applied(camera()), camera())))
    }

    @Test
    fun `a camera without OFF and without a map is asked for neither`() {
        val poor = camera {
            it[CameraCharacteristics.NOISE_REDUCTION_AVAILABLE_NOISE_REDUCTION_MODES] = intArrayOf(1)
            it.remove(CameraCharacteristics.STATISTICS_INFO_AVAILABLE_LENS_SHADING_MAP_MODES)
        }
        val request = applied(poor)
        assertEquals(null, request.get(CaptureRequest.NOISE_REDUCTION_MODE))
        assertEquals(null, request.get(CaptureRequest.STATISTICS_LENS_SHADING_MAP_MODE))
        val found = CaptureRequirements.check(request, poor)
        assertEquals(listOf("noiseReduction.mode"), lacking(found))
        assertTrue(found.none { it.fatal })
    }

    @Test
    fun `each wrong setting of a request is named, only changed samples are fatal`() {
        val cases = listOf(
            Triple(CaptureRequest.NOISE_REDUCTION_MODE, 1, "noiseReduction.mode"),
            Triple(CaptureRequest.SENSOR_TEST_PATTERN_MODE, 1, "sensor.testPatternMode"),
            Triple(CaptureRequest.STATISTICS_LENS_SHADING_MAP_MODE, 0, "statistics.lensShadingMapMode"),
            Triple(CaptureRequest.SHADING_MODE, CameraMetadata.SHADING_MODE_OFF, "shading.mode"),
            Triple(CaptureRequest.CONTROL_AE_MODE, CameraMetadata.CONTROL_AE_MODE_ON, "control.aeMode"),
            Triple(CaptureRequest.FLASH_MODE, CameraMetadata.FLASH_MODE_SINGLE, "flash.mode"),
        )
        for ((key, value, name) in cases) {
            val found = CaptureRequirements.check(applied(camera(), key to value), camera())
            assertEquals(listOf(name), lacking(found))
            assertEquals(name, name.startsWith("noise") || name.startsWith("sensor"), found.single().fatal)
            assertTrue(found.single().toString().startsWith("$name is "))
        }
    }

    @Test
    fun `each wrong value of a result is named`() {
        assertEquals(emptyList<String>(), lacking(CaptureRequirements.check(result(), camera())))
        val cases = mapOf<CaptureResult.Key<Int>, Pair<Int, String>>(
            CaptureResult.NOISE_REDUCTION_MODE to (4 to "noiseReduction.mode"),
            CaptureResult.SENSOR_TEST_PATTERN_MODE to (1 to "sensor.testPatternMode"),
            CaptureResult.SHADING_MODE to (0 to "shading.mode"),
            CaptureResult.CONTROL_AE_MODE to (1 to "control.aeMode"),
            CaptureResult.LENS_STATE to (CameraMetadata.LENS_STATE_MOVING to "lens.state"),
            CaptureResult.FLASH_STATE to (CameraMetadata.FLASH_STATE_FIRED to "flash.state"),
        )
        for ((key, wrong) in cases) {
            val result = result { it[key] = wrong.first }
            assertEquals(listOf(wrong.second), lacking(CaptureRequirements.check(result, camera())))
        }
        val bare = result { it.remove(CaptureResult.STATISTICS_LENS_SHADING_CORRECTION_MAP) }
        assertEquals(listOf("statistics.lensShadingMapMode"), lacking(CaptureRequirements.check(bare, camera())))
    }

    @Test
    fun `a result that is silent about noise reduction is not held against the samples`() {
        val silent = result { it.remove(CaptureResult.NOISE_REDUCTION_MODE) }
        assertTrue(CaptureRequirements.check(silent, camera()).none { it.fatal })
    }

    @Test
    fun `what a camera cannot do is named`() {
        assertEquals(emptyList<String>(), lacking(CaptureRequirements.check(camera())))
        val poor = camera {
            it[CameraCharacteristics.REQUEST_AVAILABLE_CAPABILITIES] = intArrayOf(0)
            it[CameraCharacteristics.SENSOR_INFO_COLOR_FILTER_ARRANGEMENT] = 5
            it.remove(CameraCharacteristics.NOISE_REDUCTION_AVAILABLE_NOISE_REDUCTION_MODES)
        }
        val found = CaptureRequirements.check(poor)
        val filters = "sensor.info.colorFilterArrangement"
        val names = listOf("capability RAW", "capability MANUAL_SENSOR", filters, "noise reduction OFF")
        assertEquals(names, lacking(found))
        assertEquals(listOf(true, true, true, false), found.map { it.fatal })
        assertEquals(names - "capability MANUAL_SENSOR", lacking(CaptureRequirements.check(poor, false)))
    }

    @Test
    fun `without manual control the exposure stays automatic, and a request for it is fatal`() {
        val automatic = camera { it[CameraCharacteristics.REQUEST_AVAILABLE_CAPABILITIES] = intArrayOf(0, 3) }
        val request = CaptureRequest.Builder(CameraMetadataNative(), false, -1, "0", null)
        request.set(CaptureRequest.CONTROL_AE_MODE, CameraMetadata.CONTROL_AE_MODE_ON)
        CaptureRequirements.apply(request, automatic, 10_000_000L, 100)
        assertEquals(CameraMetadata.CONTROL_AE_MODE_ON, request.get(CaptureRequest.CONTROL_AE_MODE))
        assertEquals(null, request.get(CaptureRequest.SENSOR_EXPOSURE_TIME))
        val kept = CaptureRequirements.check(request, automatic)
        assertEquals(listOf("control.aeMode" to false), kept.map { it.key to it.fatal })
        val forced = CaptureRequirements.check(applied(camera()), automatic)
        assertEquals(listOf("capability MANUAL_SENSOR" to true), forced.map { it.key to it.fatal })
    }

    @Test
    fun `exposure and sensitivity outside what the camera offers are fatal`() {
        val cases = listOf(
            CaptureRequest.SENSOR_EXPOSURE_TIME to listOf(100_000L, 1_000_000_000L, 99_999L, 1_000_000_001L, null),
            CaptureRequest.SENSOR_SENSITIVITY to listOf(50, 3200, 49, 3201, null),
        )
        for ((key, values) in cases) {
            values.forEachIndexed { i, value ->
                val request = applied(camera())
                @Suppress("UNCHECKED_CAST")
                request.set(key as CaptureRequest.Key<Any?>, value)
                val found = CaptureRequirements.check(request, camera())
                assertEquals(if (i < 2) emptyList() else listOf(key.name.substringAfter("android.")), lacking(found))
                assertTrue(found.all { it.fatal && " to " in it.wanted })
            }
        }
    }

    @Test
    fun `a lens that is switched to infinity is named, but for one that cannot move`() {
        val off = CaptureRequest.CONTROL_AF_MODE to CameraMetadata.CONTROL_AF_MODE_OFF
        val request = applied(camera(), off)
        for ((distance, good) in listOf(null to false, 0f to false, 2.5f to true)) {
            request.set(CaptureRequest.LENS_FOCUS_DISTANCE, distance)
            val found = CaptureRequirements.check(request, camera())
            assertEquals(if (good) emptyList() else listOf("lens.focusDistance"), lacking(found))
            assertTrue(found.none { it.fatal })
        }
        val fixed = camera { it[CameraCharacteristics.LENS_INFO_MINIMUM_FOCUS_DISTANCE] = 0f }
        assertEquals(emptyList<String>(), lacking(CaptureRequirements.check(applied(fixed, off), fixed)))
    }

    /** A camera with these locks; null where it does not say. */
    private fun lockable(exposure: Boolean? = true, white: Boolean? = true, manual: Boolean = true) = camera {
        if (exposure != null) it[CameraCharacteristics.CONTROL_AE_LOCK_AVAILABLE] = exposure
        if (white != null) it[CameraCharacteristics.CONTROL_AWB_LOCK_AVAILABLE] = white
        if (!manual) it[CameraCharacteristics.REQUEST_AVAILABLE_CAPABILITIES] = intArrayOf(0, 3)
    }

    private fun locked(camera: CameraCharacteristics): Map<String, Any> =
        CaptureRequirements.locks(camera, 10_000_000L, 100).mapKeys { it.key.name.substringAfter("android.") }

    @Test
    fun `exposure and white balance are locked by hand where the camera can`() {
        assertEquals(emptyList<String>(), lacking(CaptureRequirements.checkLocks(lockable(), 10_000_000L, 100)))
        val request = CaptureRequest.Builder(CameraMetadataNative(), false, -1, "0", null)
        CaptureRequirements.lock(request, lockable(), 10_000_000L, 100)
        assertEquals(CameraMetadata.CONTROL_AE_MODE_OFF, request.get(CaptureRequest.CONTROL_AE_MODE))
        assertEquals(10_000_000L, request.get(CaptureRequest.SENSOR_EXPOSURE_TIME))
        assertEquals(100, request.get(CaptureRequest.SENSOR_SENSITIVITY))
        assertEquals(true, request.get(CaptureRequest.CONTROL_AWB_LOCK))
        assertEquals(null, request.get(CaptureRequest.CONTROL_AE_LOCK))
    }

    @Test
    fun `each lock that a camera lacks is said and not asked for`() {
        fun said(camera: CameraCharacteristics) = CaptureRequirements.checkLocks(camera, 10_000_000L, 100)
        for (absent in listOf(false, null)) {
            val white = lockable(white = absent)
            assertEquals(listOf("control.awbLockAvailable"), lacking(said(white)))
            assertTrue("control.awbLock" !in locked(white))
            val nothing = lockable(exposure = absent, white = absent, manual = false)
            val names = listOf("capability MANUAL_SENSOR", "control.aeLockAvailable", "control.awbLockAvailable")
            assertEquals(names, lacking(said(nothing)))
            assertEquals(emptyMap<String, Any>(), locked(nothing))
            assertTrue(said(nothing).none { it.fatal } && said(nothing).none { "kept as it is" in it.advice })
        }
        val automatic = lockable(manual = false)
        assertEquals(listOf("capability MANUAL_SENSOR"), lacking(said(automatic)))
        assertTrue("kept as it is" in said(automatic).single().advice)
        assertEquals(mapOf("control.aeLock" to true, "control.awbLock" to true), locked(automatic))
    }

    @Test
    fun `an exposure that the camera does not offer cannot be locked`() {
        for ((time, iso, key) in listOf(
            Triple(99_999L, 100, "sensor.exposureTime"),
            Triple(10_000_000L, 3201, "sensor.sensitivity"),
        )) {
            val found = CaptureRequirements.checkLocks(lockable(), time, iso)
            assertEquals(listOf(key to true), found.map { it.key to it.fatal })
        }
    }

    private fun lacking(found: List<Shortfall>) = found.map { it.key }

    /** A request made by [CaptureRequirements.apply], then changed. */
    private fun applied(
        camera: CameraCharacteristics,
        vararg changes: Pair<CaptureRequest.Key<Int>, Int>,
    ): CaptureRequest.Builder {
        val builder = CaptureRequest.Builder(CameraMetadataNative(), false, -1, "0", null)
        CaptureRequirements.apply(builder, camera, 10_000_000L, 100)
        assertEquals(10_000_000L, builder.get(CaptureRequest.SENSOR_EXPOSURE_TIME))
        assertEquals(100, builder.get(CaptureRequest.SENSOR_SENSITIVITY))
        for ((key, value) in changes) builder.set(key, value)
        return builder
    }
}
