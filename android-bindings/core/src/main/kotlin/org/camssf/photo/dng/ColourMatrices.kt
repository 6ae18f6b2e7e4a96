package org.camssf.photo.dng

import org.camssf.photo.ColourMatrix

/**
 * The file's usable colour matrices, CameraCalibration and AnalogBalance included (DNG 1.7, chapter 6), and in words
 * which were left out and why.
 */
internal fun colourMatrices(tiff: Tiff, first: Directory): Pair<List<ColourMatrix>, String> {
    val gains = finite(tiff, first, Tag.ANALOG_BALANCE, 3) ?: doubleArrayOf(1.0, 1.0, 1.0)
    val why = ArrayList<String>()
    val found = listOf(
        Triple(Tag.COLOR_MATRIX_1, Tag.CALIBRATION_1, Tag.ILLUMINANT_1),
        Triple(Tag.COLOR_MATRIX_2, Tag.CALIBRATION_2, Tag.ILLUMINANT_2),
    ).mapIndexedNotNull { i, (matrix, calibration, light) ->
        val toCamera = finite(tiff, first, matrix, 9) ?: return@mapIndexedNotNull null
        val own = finite(tiff, first, calibration, 9)
        try {
            ColourMatrix.checked(tiff.one(first, light, 0), toCamera, own, gains)
        } catch (error: IllegalArgumentException) {
            why += "ColorMatrix${i + 1} was left out: it ${error.message}"
            null
        }
    }
    return found to why.joinToString("; ")
}
