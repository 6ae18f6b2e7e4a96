package org.camssf.photo.dng

import org.camssf.photo.ColourMatrix

/** The file's colour matrices, CameraCalibration and AnalogBalance included (DNG 1.7, chapter 6). */
internal fun colourMatrices(tiff: Tiff, first: Directory): List<ColourMatrix> {
    val gains = finite(tiff, first, Tag.ANALOG_BALANCE, 3) ?: doubleArrayOf(1.0, 1.0, 1.0)
    return listOf(
        Triple(Tag.COLOR_MATRIX_1, Tag.CALIBRATION_1, Tag.ILLUMINANT_1),
        Triple(Tag.COLOR_MATRIX_2, Tag.CALIBRATION_2, Tag.ILLUMINANT_2),
    ).mapNotNull { (matrix, calibration, light) ->
        val toCamera = finite(tiff, first, matrix, 9) ?: return@mapNotNull null
        val own = finite(tiff, first, calibration, 9)
        ColourMatrix.of(tiff.one(first, light, 0).toInt(), toCamera, own, gains)
    }
}
