package org.camssf.passport

import kotlin.math.abs

/**
 * Checks the parts of a passport's excerpt that an app needs: verdict, camera, curves, bands, gains and shots,
 * and that members which do not belong to an excerpt are absent. Python checks the whole schema.
 */
internal object ResultForm {
    private const val SIZE = 681
    private const val LARGEST = 1e12
    private const val LONGEST = 4096
    private val COLOURS = listOf("red", "green", "blue")
    private val OUTSIDE = listOf("code_covariance", "truth", "excerpt")

    /** True if the result states that it was refused. */
    fun isRefused(result: Any?): Boolean =
        ((result as? Map<*, *>)?.get("verdict") as? Map<*, *>)?.get("status") == "refused"

    fun holds(result: Any?): Boolean {
        val values = result as? Map<*, *> ?: return false
        val camera = values["camera"] as? Map<*, *> ?: return false
        val shots = values["shots"] as? List<*> ?: return false
        return values["format"] == Excerpt.FORMAT && OUTSIDE.none { it in values } && isCamera(camera) &&
            isVerdict(values["verdict"]) &&
            isNumbers(values["channel_gain"], 3) &&
            shots.size in 1..64 && shots.all(::isShot) && isCurves(values["ssf"], peak = true) &&
            (values["ssf_std"] == null || isCurves(values["ssf_std"], peak = false))
    }

    private fun isCamera(camera: Map<*, *>): Boolean =
        camera.keys - "unique_model" == setOf("make", "model") && (camera - "unique_model").values.all(::isText) &&
            (camera["unique_model"] == null || isText(camera["unique_model"]))

    fun isText(value: Any?): Boolean = value is String && value.codePointCount(0, value.length) <= LONGEST

    private fun isVerdict(verdict: Any?): Boolean {
        val values = verdict as? Map<*, *> ?: return false
        val reasons = values["reasons"] as? List<*> ?: return false
        return values["status"] == "accepted" || (values["status"] == "doubtful" && reasons.isNotEmpty())
    }

    private fun isShot(shot: Any?): Boolean {
        val values = shot as? Map<*, *> ?: return false
        val lamp = values["lamp"] as? Map<*, *> ?: return false
        return isText(lamp["name"]) && "power" !in lamp && "light" !in values && "pose" in values &&
            values["pose"] == null && (values["patches"] as? List<*>)?.isEmpty() ?: false
    }

    private fun isCurves(curves: Any?, peak: Boolean): Boolean {
        val values = curves as? Map<*, *> ?: return false
        if (values.keys != COLOURS.toSet() + "wavelength_nm") return false
        if (!values.values.all { isNumbers(it, SIZE) }) return false
        val grid = numbers(values["wavelength_nm"])
        return grid.indices.all { grid[it] == 380 + it / 2.0 } &&
            (!peak || COLOURS.all { abs(numbers(values[it]).max() - 1) <= 1e-6 })
    }

    private fun isNumbers(value: Any?, size: Int): Boolean = value is List<*> && value.size == size &&
        value.all { it is Number && abs(it.toDouble()) <= LARGEST }

    private fun numbers(value: Any?): List<Double> = (value as List<*>).map { (it as Number).toDouble() }
}
