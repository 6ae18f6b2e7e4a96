package org.camssf.recovery

import kotlin.math.abs

/** Finds a root of a function of one variable. */
internal object Brent {
    /**
     * The root of f between a and b, where f has different signs, to within ± `tolerance`. Brent's method (R. P.
     * Brent, Algorithms for Minimization without Derivatives, 1973, ch. 4), with steps and ties as in SciPy's
     * `brentq`, so that a wide tolerance gives the same result.
     */
    fun root(a: Double, fa: Double, b: Double, fb: Double, tolerance: Double, f: (Double) -> Double): Double {
        var before = a
        var fBefore = fa
        var now = b
        var fNow = fb
        var other = 0.0
        var fOther = 0.0
        var step = 0.0
        var last = 0.0
        repeat(100) {
            if (fBefore != 0.0 && fNow != 0.0 && (fBefore < 0) != (fNow < 0)) {
                other = before
                fOther = fBefore
                step = now - before
                last = step
            }
            if (abs(fOther) < abs(fNow)) {
                before = now
                now = other
                other = before
                fBefore = fNow
                fNow = fOther
                fOther = fBefore
            }
            val delta = (tolerance + RELATIVE * abs(now)) / 2
            val half = (other - now) / 2
            if (fNow == 0.0 || abs(half) < delta) return now
            if (abs(last) > delta && abs(fNow) < abs(fBefore)) {
                val attempt = if (before == other) {
                    -fNow * (now - before) / (fNow - fBefore)
                } else {
                    val near = (fBefore - fNow) / (before - now)
                    val far = (fOther - fNow) / (other - now)
                    -fNow * (fOther * far - fBefore * near) / (far * near * (fOther - fBefore))
                }
                if (2 * abs(attempt) < minOf(abs(last), 3 * abs(half) - delta)) {
                    last = step
                    step = attempt
                } else {
                    last = half
                    step = half
                }
            } else {
                last = half
                step = half
            }
            before = now
            fBefore = fNow
            now += if (abs(step) > delta) {
                step
            } else if (half > 0) {
                delta
            } else {
                -delta
            }
            fNow = f(now)
        }
        return now
    }

    /** SciPy's default relative tolerance. */
    private const val RELATIVE = 8.881784197001252e-16
}
