package org.camssf.passport

import java.math.BigDecimal
import java.math.RoundingMode

/**
 * The part of a result that a passport holds: curves, bands, verdict and provenance, without the single patches.
 *
 * Python's `documents/excerpt.py` makes the same excerpt.
 */
internal object Excerpt {
    private const val DECIMALS = 5
    private val LEFT_OUT = setOf("code_covariance", "truth", "excerpt")
    private val CURVES = setOf("ssf", "ssf_std")

    /**
     * The excerpt of a result. Curves and bands are rounded to five decimals.
     *
     * @param result a result with curves; members that do not have its form are kept, so that [ResultForm] rejects
     *   them.
     */
    fun of(result: Members): Members {
        val kept = (result.values - LEFT_OUT).mapValues { (name, value) ->
            when (name) {
                in CURVES -> curves(value)
                "shots" -> (value as? List<*>)?.map { shot(it) } ?: value
                else -> value
            }
        }
        return try {
            Sound.parse(Sound.write(members(kept))) as Members // unpaired surrogates as they are written
        } catch (_: UnsoundException) { // names that differ only in unpaired surrogates: the form is wrong
            members(emptyMap())
        }
    }

    private fun shot(shot: Any?): Any? {
        val values = (shot as? Members)?.values ?: return shot
        val lamp = values["lamp"]
        val named = if (lamp is Members) members(lamp.values - "power") else lamp
        val kept = LinkedHashMap(values - "light")
        if ("lamp" in kept) kept["lamp"] = named
        kept["pose"] = null
        kept["patches"] = emptyList<Any?>()
        return members(kept)
    }

    private fun curves(curves: Any?): Any? {
        val values = (curves as? Members)?.values ?: return curves
        return members(
            values.mapValues { (name, value) ->
                if (name == "wavelength_nm" || value !is List<*>) value else value.map { rounded(it) }
            },
        )
    }

    private fun rounded(value: Any?): Any? {
        val number = (value as? Numeral)?.text?.toDouble() ?: return value
        if (!number.isFinite()) return value
        val short = BigDecimal(number).setScale(DECIMALS, RoundingMode.HALF_EVEN).stripTrailingZeros()
        return Numeral(if (short.signum() == 0) "0" else short.toPlainString())
    }

    private fun members(values: Map<String, Any?>) = Members(values, emptyMap())
}
