package org.camssf.passport

import kotlin.math.abs

/**
 * Checks the parts of data/passport.schema.json that an app needs: verdict, camera, curves, bands, gains and shots,
 * and that members which do not belong to an excerpt are absent. Python checks the whole schema.
 */
internal object ResultForm {
    private const val FORMAT = "camssf-result/1"
    private const val SIZE = 681
    private const val LARGEST = 1e12
    private const val LONGEST = 4096
    private val COLOURS = listOf("red", "green", "blue")
    private val OUTSIDE = listOf("code_covariance", "truth", "excerpt")

    /** True if the result states that it was refused. */
    fun isRefused(result: Any?): Boolean =
        ((result as? Members)?.values?.get("verdict") as? Members)?.values?.get("status") == "refused"

    fun holds(result: Any?): Boolean {
        val values = (result as? Members)?.values ?: return false
        val camera = (values["camera"] as? Members)?.values ?: return false
        val shots = values["shots"] as? List<*> ?: return false
        return values["format"] == FORMAT && OUTSIDE.none { it in values } && camera.keys == setOf("make", "model") &&
            camera.values.all(::isText) && isVerdict(values["verdict"]) && isNumbers(values["channel_gain"], 3) &&
            shots.size in 1..64 && shots.all(::isShot) && isCurves(values["ssf"], peak = true) &&
            (values["ssf_std"] == null || isCurves(values["ssf_std"], peak = false))
    }

    fun isText(value: Any?): Boolean = value is String && value.codePointCount(0, value.length) <= LONGEST

    private fun isVerdict(verdict: Any?): Boolean {
        val values = (verdict as? Members)?.values ?: return false
        val reasons = values["reasons"] as? List<*> ?: return false
        return values["status"] == "accepted" || (values["status"] == "doubtful" && reasons.isNotEmpty())
    }

    private fun isShot(shot: Any?): Boolean {
        val values = (shot as? Members)?.values ?: return false
        val lamp = (values["lamp"] as? Members)?.values ?: return false
        return isText(lamp["name"]) && "power" !in lamp && "light" !in values && "pose" in values &&
            values["pose"] == null && (values["patches"] as? List<*>)?.isEmpty() ?: false
    }

    private fun isCurves(curves: Any?, peak: Boolean): Boolean {
        val values = (curves as? Members)?.values ?: return false
        if (values.keys != COLOURS.toSet() + "wavelength_nm") return false
        if (!values.values.all { isNumbers(it, SIZE) }) return false
        val grid = numbers(values["wavelength_nm"])
        return grid.indices.all { grid[it] == 380 + it / 2.0 } &&
            (!peak || COLOURS.all { abs(numbers(values[it]).max() - 1) <= 1e-6 })
    }

    private fun isNumbers(value: Any?, size: Int): Boolean = value is List<*> && value.size == size &&
        value.all { it is Numeral && abs(it.text.toDouble()) <= LARGEST }

    private fun numbers(value: Any?): List<Double> = (value as List<*>).map { (it as Numeral).text.toDouble() }
}
