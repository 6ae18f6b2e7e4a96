package org.camssf.photo

import org.camssf.Rows
import org.camssf.Rules
import org.camssf.fixed
import org.camssf.spectra.Chromaticity
import org.camssf.spectra.correlatedTemperature

/**
 * One of a file's colour matrices: CIE XYZ to the camera's raw values, made for one illuminant (DNG 1.7, chapter 6).
 *
 * @property light the CIE illuminant: "A", "B", "C", "D50", "D55", "D65" or "D75".
 */
public class ColourMatrix internal constructor(public val light: String, internal val sharedValues: DoubleArray) {
    /** (3, 3) row-major: analogue gains · calibration · colour matrix. */
    public val values: Rows get() = Rows(sharedValues, 3, 3)

    /** The camera's white (3) under [light], green 1. */
    public val white: Rows get() = Rows(sharedWhite, 3)

    internal val sharedWhite: DoubleArray
        get() = whiteOf(light, sharedValues).let { white -> DoubleArray(3) { white[it] / white[1] } }

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

        /** CIE illuminants by Exif's LightSource codes; daylight, flash and weathers as in Adobe's SDK. */
        private val LIGHT_SOURCES = mapOf(
            1L to "D55", 3L to "A", 4L to "D55", 9L to "D55", 10L to "D65", 11L to "D75",
            17L to "A", 18L to "B", 19L to "C", 20L to "D55", 21L to "D65", 22L to "D75", 23L to "D50",
        )

        /** As the other `of`, without calibration. */
        @JvmStatic
        public fun of(illuminant: Int, matrix: DoubleArray): ColourMatrix? = of(illuminant, matrix, null)

        /**
         * A colour matrix with the calibration of the individual camera. Null if no camera can have it, or
         * for an illuminant whose spectrum is not known.
         *
         * @param illuminant an Exif LightSource code: 1 daylight, 4 flash and 9 fine weather count as D55, 3 tungsten
         *   as A, 10 cloudy as D65, 11 shade as D75; 17 A, 18 B, 19 C, 20 D55, 21 D65, 22 D75, 23 D50.
         * @param matrix (3, 3) row-major XYZ to camera; copied.
         * @param calibration (3, 3) row-major calibration matrix of the individual camera; null for the identity.
         */
        @JvmStatic
        public fun of(illuminant: Int, matrix: DoubleArray, calibration: DoubleArray?): ColourMatrix? = try {
            checked(illuminant.toLong(), matrix, calibration, doubleArrayOf(1.0, 1.0, 1.0))
        } catch (_: IllegalArgumentException) {
            null
        }

        /**
         * As [of].
         *
         * @throws IllegalArgumentException why it is left out; the message completes "was left out: it ...".
         */
        internal fun checked(
            illuminant: Long,
            matrix: DoubleArray,
            calibration: DoubleArray?,
            gains: DoubleArray,
        ): ColourMatrix {
            val light = requireNotNull(LIGHT_SOURCES[illuminant]) {
                "was made for light source $illuminant, whose spectrum is not known"
            }
            val values = DoubleArray(9) { at ->
                val own = if (calibration == null) {
                    matrix[at]
                } else {
                    (0..2).sumOf { calibration[at / 3 * 3 + it] * matrix[3 * it + at % 3] }
                }
                gains[at / 3] * own
            }
            val white = whiteOf(light, values)
            val darkest = Rules.shipped.number("lamp.darkest_channel")
            require(white.all { !it.isNaN() && !it.isInfinite() } && white.min() > darkest * white.max()) {
                "gives no white under $light"
            }
            val red = white[0] / white[1]
            val most = Rules.shipped.number(if (light == "A") "lamp.most_red_bulb" else "lamp.most_red_daylight")
            require(red <= most) {
                "gives a white under $light whose red is ${fixed(red, 2)} of its green, as no sensor's is"
            }
            return ColourMatrix(light, values)
        }

        /**
         * Whether the matrices turn a file's AsShotNeutral (3) into a white that no lamp has. A neutral of three equal
         * numbers says nothing: some writers store it for unknown.
         */
        internal fun noLight(neutral: DoubleArray, matrices: List<ColourMatrix>): Boolean {
            val equal = Rules.shipped.number("lamp.equal_neutral")
            if (matrices.isEmpty() || neutral.max() < equal * neutral.min()) return false
            val white = Chromaticity.of(neutral, matrices.map { it.kelvin to it.sharedValues }) ?: return true
            return Chromaticity.offLocus(white) > Rules.shipped.number("lamp.off_locus")
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
