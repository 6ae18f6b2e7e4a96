package org.camssf.photo

/**
 * The camera's white under an illuminant, computed from the file's colour matrix.
 *
 * @property illuminant the illuminant, an Exif LightSource code: 17 A, 18 B, 19 C, 20 D55, 21 D65, 22 D75, 23 D50.
 * @param white (3) R, G, B, scaled to green 1; copied.
 */
public class Neutral(public val illuminant: Int, white: DoubleArray) {
    private val own = white.copyOf()

    /** (3) R, G, B, scaled to green 1; a copy at each call. */
    public val white: DoubleArray get() = own.copyOf()

    override fun toString(): String = "Neutral(illuminant=$illuminant, white=${own.joinToString()})"

    public companion object {
        /** CIE 1931 x, y of Exif's LightSource codes: A, B, C, D55, D65, D75, D50 (CIE 15). */
        private val WHITE_POINTS = mapOf(
            17 to doubleArrayOf(0.44758, 0.40745),
            18 to doubleArrayOf(0.34842, 0.35161),
            19 to doubleArrayOf(0.31006, 0.31616),
            20 to doubleArrayOf(0.33243, 0.34744),
            21 to doubleArrayOf(0.31272, 0.32903),
            22 to doubleArrayOf(0.29903, 0.31488),
            23 to doubleArrayOf(0.34567, 0.35851),
        )

        /**
         * Camera white = gains · calibration · colour matrix · XYZ of the illuminant (DNG 1.7, chapter 6). Null for
         * an illuminant that the class does not list, or if a channel is not finite or below 0.1 % of the largest.
         *
         * @param matrix (3, 3) row-major XYZ to camera.
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
        ): Neutral? {
            val (x, y) = WHITE_POINTS[illuminant] ?: return null
            val plain = times(matrix, doubleArrayOf(x / y, 1.0, (1.0 - x - y) / y))
            val seen = if (calibration == null) plain else times(calibration, plain)
            val white = DoubleArray(3) { gains[it] * seen[it] }
            val sound = white.all { !it.isNaN() && !it.isInfinite() } && white.min() > 1e-3 * white.max()
            return if (sound) Neutral(illuminant, DoubleArray(3) { white[it] / white[1] }) else null
        }

        private fun times(matrix: DoubleArray, vector: DoubleArray): DoubleArray =
            DoubleArray(3) { row -> (0..2).sumOf { matrix[3 * row + it] * vector[it] } }
    }
}
