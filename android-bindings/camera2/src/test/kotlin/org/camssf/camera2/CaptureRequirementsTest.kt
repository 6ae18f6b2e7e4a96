package org.camssf.camera2

import android.hardware.camera2.CameraCharacteristics
import android.hardware.camera2.CameraMetadata
import android.hardware.camera2.CaptureRequest
import android.hardware.camera2.CaptureResult
import android.hardware.camera2.impl.CameraMetadataNative
import org.junit.Assert.assertEquals
import org.junit.Assert.assertTrue
import org.junit.Test
import org.junit.runner.RunWith
import org.robolectric.RobolectricTestRunner
import org.robolectric.annotation.Config

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
        val names = listOf("capability RAW", filters, "noise reduction OFF")
        assertEquals(names, lacking(found))
        assertEquals(listOf(true, true, false), found.map { it.fatal })
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
