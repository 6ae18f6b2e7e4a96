package org.camssf.spectra

import org.camssf.LeastSquares
import kotlin.math.hypot

/** Chromaticities of whites, from XYZ and from a camera's raw values; Python's camssf.colorimetry. */
internal object Chromaticity {
    /** Steps of the interpolation between two matrices, as in the DNG specification. */
    private const val STEPS = 30

    /** Limits of the temperature that interpolates the matrices, K. */
    private val KELVIN = 1500.0..25_000.0

    /** Points of Planck's locus, evenly spaced in 1 / T. */
    private const val POINTS = 200

    /** D = X + 15 Y + 3 Z of u' = 4 X / D and v' = 9 Y / D. */
    private val DIVISOR = doubleArrayOf(1.0, 15.0, 3.0)
    val SCALE = doubleArrayOf(4.0, 9.0)

    /**
     * u'v' (2), CIE 1976, of a raw white (3); null if the matrices give no chromaticity. Two matrices are interpolated
     * by the inverse of the white's own temperature (DNG 1.7, chapter 6), which iteration finds.
     */
    fun of(white: DoubleArray, matrices: List<Pair<Double, DoubleArray>>): DoubleArray? {
        val (cool, first) = matrices.firstOrNull() ?: return null
        val (hot, second) = matrices.last()
        var kelvin = 5000.0
        var xyz = DoubleArray(3)
        repeat(STEPS) {
            val share = if (cool == hot) {
                1.0
            } else {
                val part = (1.0 / kelvin - 1.0 / hot) / (1.0 / cool - 1.0 / hot)
                part.coerceIn(0.0, 1.0)
            }
            val mixed = Array(3) { row ->
                DoubleArray(3) {
                    share * first[3 * row + it] + (1.0 - share) * second[3 * row + it]
                }
            }
            xyz = LeastSquares.solve(mixed, white) ?: return null
            if (!xyz.all { it > 0 }) return null
            kelvin = correlatedTemperature(xyz).coerceIn(KELVIN)
        }
        return uv(xyz)
    }

    /** Distance of u'v' (2) from Planck's locus in CIE 1960 u, v (Krystek, Color Res. Appl. 1985, 10, 38). */
    fun offLocus(white: DoubleArray): Double = (0 until POINTS).minOf {
        val t =
            1.0 / (1.0 / KELVIN.endInclusive + it * (1.0 / KELVIN.start - 1.0 / KELVIN.endInclusive) / (POINTS - 1))
        val u = (0.860117757 + 1.54118254e-4 * t + 1.28641212e-7 * t * t) /
            (1 + 8.42420235e-4 * t + 7.08145163e-7 * t * t)
        val v = (0.317398726 + 4.22806245e-5 * t + 4.20481691e-8 * t * t) /
            (1 - 2.89741816e-5 * t + 1.61456053e-7 * t * t)
        hypot(white[0] - u, white[1] * 2.0 / 3.0 - v)
    }

    /** D of a colour (3). */
    fun divisor(xyz: DoubleArray): Double = (0..2).sumOf { xyz[it] * DIVISOR[it] }

    /** u'v' (2) of a colour (3). */
    fun uv(xyz: DoubleArray): DoubleArray = DoubleArray(2) { xyz[it] * SCALE[it] / divisor(xyz) }
}
