package org.camssf.spectra

/**
 * Correlated colour temperature of XYZ (3), CIE 1931, K: McCamy (Color Res. Appl. 1992, 17, 142), T = -449 n³ + 3525 n² -
 * 6823.3 n + 5520.33, n = (x - 0.3320) / (y - 0.1858).
 */
internal fun correlatedTemperature(xyz: DoubleArray): Double {
    val n = (xyz[0] / xyz.sum() - 0.3320) / (xyz[1] / xyz.sum() - 0.1858)
    return ((-449.0 * n + 3525.0) * n - 6823.3) * n + 5520.33
}
