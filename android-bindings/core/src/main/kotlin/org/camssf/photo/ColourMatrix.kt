package org.camssf.photo

import org.camssf.spectra.correlatedTemperature

/**
 * One of a file's colour matrices: CIE XYZ to the camera's raw values, made for one illuminant (DNG 1.7, chapter 6).
 *
 * @property light the CIE illuminant: "A", "B", "C", "D50", "D55", "D65" or "D75".
 */
public class ColourMatrix internal constructor(public val light: String, internal val sharedValues: DoubleArray) {
    /** (3, 3) row-major: analogue gains · calibration · colour matrix; a copy at each call. */
    public val values: DoubleArray get() = sharedValues.copyOf()

    /** The camera's white (3) under [light], green 1. */
    public val white: DoubleArray get() = whiteOf(light, sharedValues).let { white ->
        DoubleArray(3) {
            white[it] /
                white[1]
        }
    }

    /** Correlated colour temperature of [light], K. */
    internal val kelvin: Double get() = correlatedTemperature(xyz(light))

    override fun equals(other: Any?): Boolean =
        other is ColourMatrix && light == other.light && sharedValues.contentEquals(other.sharedValues)

    override fun hashCode(): Int = 31 * light.hashCode() + sharedValues.contentHashCode()

    override fun toString(): String = "ColourMatrix($light, ${sharedValues.joinToString()})"

    public companion object {
        /** CIE 1931 x, y (CIE 15). */
        internal val WHITE_POINTS = mapOf(
            "A" to doubleArrayOf(0.44758, 0.40745),
            "B" to doubleArrayOf(0.34842, 0.35161),
            "C" to doubleArrayOf(0.31006, 0.31616),
            "D55" to doubleArrayOf(0.33243, 0.34744),
            "D65" to doubleArrayOf(0.31272, 0.32903),
            "D75" to doubleArrayOf(0.29903, 0.31488),
            "D50" to doubleArrayOf(0.34567, 0.35851),
        )

        /** CIE illuminants by Exif's LightSource codes. */
        private val LIGHT_SOURCES =
            mapOf(17 to "A", 18 to "B", 19 to "C", 20 to "D55", 21 to "D65", 22 to "D75", 23 to "D50")

        /**
         * A colour matrix with the calibration of the individual camera and its gains. Null for an illuminant that Exif
         * does not define, or if a channel of the white is not finite or below 0.1 % of the largest.
         *
         * @param illuminant an Exif LightSource code: 17 A, 18 B, 19 C, 20 D55, 21 D65, 22 D75, 23 D50.
         * @param matrix (3, 3) row-major XYZ to camera; copied.
         * @param calibration (3, 3) row-major calibration matrix of the individual camera; null for the identity.
         * @param gains (3) analogue gains.
         */
        @JvmStatic
        @JvmOverloads
        public fun of(
            illuminant: Int,
            matrix: DoubleArray,
            calibration: DoubleArray? = null,
            gains: DoubleArray = doubleArrayOf(1.0, 1.0, 1.0),
        ): ColourMatrix? {
            val light = LIGHT_SOURCES[illuminant] ?: return null
            val values = DoubleArray(9) { at ->
                val own = if (calibration == null) {
                    matrix[at]
                } else {
                    (0..2).sumOf { calibration[at / 3 * 3 + it] * matrix[3 * it + at % 3] }
                }
                gains[at / 3] * own
            }
            val white = whiteOf(light, values)
            val sound = white.all { !it.isNaN() && !it.isInfinite() } && white.min() > 1e-3 * white.max()
            return if (sound) ColourMatrix(light, values) else null
        }

        private fun xyz(light: String): DoubleArray {
            val (x, y) = WHITE_POINTS.getValue(light)
            return doubleArrayOf(x / y, 1.0, (1.0 - x - y) / y)
        }

        private fun whiteOf(light: String, values: DoubleArray): DoubleArray {
            val white = xyz(light)
            return DoubleArray(3) { row -> (0..2).sumOf { values[3 * row + it] * white[it] } }
        }
    }
}
