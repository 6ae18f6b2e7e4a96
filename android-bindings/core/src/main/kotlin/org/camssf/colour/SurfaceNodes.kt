package org.camssf.colour

import org.camssf.Grid

/** The 35 wavelengths, 380 to 720 nm every 10 nm, between which reflectances are linear. */
internal object SurfaceNodes {
    const val SIZE = 35
    private const val EACH = (Grid.SIZE - 1) / (SIZE - 1)

    /** Wavelengths (35), nm. */
    val wavelengths = DoubleArray(SIZE) { 380.0 + 10.0 * it }

    /** Of a function f (681) the weights (35) of the nodes: Σ f R over the grid equals Σ fold(f) R over the nodes. */
    fun fold(values: DoubleArray): DoubleArray {
        val found = DoubleArray(SIZE)
        for (m in values.indices) {
            val share = (m % EACH) / EACH.toDouble()
            found[m / EACH] += (1 - share) * values[m]
            if (share > 0) found[m / EACH + 1] += share * values[m]
        }
        return found
    }
}
