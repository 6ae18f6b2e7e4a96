package org.camssf.colour

import org.camssf.Grid

/** The 35 wavelengths, 380 to 720 nm every 10 nm, between which reflectances are linear. */
internal object SurfaceNodes {
    const val SIZE = 35

    /** Wavelengths (35), nm. */
    val wavelengths = DoubleArray(SIZE) { 380.0 + 10.0 * it }

    /** Weights (35) of the nodes, from a function (681) of wavelength. */
    fun fold(values: DoubleArray): DoubleArray = fold(values, SIZE)
}

/**
 * Weights of evenly spaced nodes, from a function f (681) of wavelength: Σ f R over the grid equals Σ fold(f) R over the
 * nodes for every R that is linear between them.
 *
 * @param size number of nodes from 380 to 720 nm.
 */
internal fun fold(values: DoubleArray, size: Int): DoubleArray {
    val weights = DoubleArray(size)
    val steps = (Grid.SIZE - 1) / (size - 1)
    for (m in values.indices) {
        val share = (m % steps) / steps.toDouble()
        weights[m / steps] += (1 - share) * values[m]
        if (share > 0) weights[m / steps + 1] += share * values[m]
    }
    return weights
}
