package org.camssf.dng

import org.camssf.Neutral

/** CIE 1931 x, y of Exif's LightSource codes: A, B, C, D55, D65, D75, D50 (CIE 15). */
private val WHITE_POINTS = mapOf(
    17L to doubleArrayOf(0.44758, 0.40745),
    18L to doubleArrayOf(0.34842, 0.35161),
    19L to doubleArrayOf(0.31006, 0.31616),
    20L to doubleArrayOf(0.33243, 0.34744),
    21L to doubleArrayOf(0.31272, 0.32903),
    22L to doubleArrayOf(0.29903, 0.31488),
    23L to doubleArrayOf(0.34567, 0.35851),
)

/** Camera white = AnalogBalance · CameraCalibration · ColorMatrix · XYZ of the light (DNG 1.7, chapter 6). */
internal fun neutrals(tiff: Tiff, first: Directory): List<Neutral> {
    val gains = finite(tiff, first, Tag.ANALOG_BALANCE, 3) ?: doubleArrayOf(1.0, 1.0, 1.0)
    return listOf(
        Triple(Tag.COLOR_MATRIX_1, Tag.CALIBRATION_1, Tag.ILLUMINANT_1),
        Triple(Tag.COLOR_MATRIX_2, Tag.CALIBRATION_2, Tag.ILLUMINANT_2),
    ).mapNotNull { (matrix, calibration, light) ->
        val toCamera = finite(tiff, first, matrix, 9)
        val own = finite(tiff, first, calibration, 9)
        val code = tiff.one(first, light, 0)
        val xy = WHITE_POINTS[code]
        if (toCamera == null || xy == null) return@mapNotNull null
        val xyz = doubleArrayOf(xy[0] / xy[1], 1.0, (1.0 - xy[0] - xy[1]) / xy[1])
        val plain = times(toCamera, xyz)
        val seen = if (own == null) plain else times(own, plain)
        val white = DoubleArray(3) { gains[it] * seen[it] }
        val sound = white.all { !it.isNaN() && !it.isInfinite() } && white.min() > 1e-3 * white.max()
        if (sound) Neutral(code.toInt(), DoubleArray(3) { white[it] / white[1] }) else null
    }
}

private fun times(matrix: DoubleArray, vector: DoubleArray): DoubleArray =
    DoubleArray(3) { row -> (0..2).sumOf { matrix[3 * row + it] * vector[it] } }
