package org.camssf.colour

import kotlin.math.cbrt
import kotlin.math.max

/** Lab, of three numbers at a time. XYZ is relative: Y of a perfect white diffuser is 1. */
internal object Spaces {
    private const val BEND = 216.0 / 24389.0
    private const val BEND_ROOT = 6.0 / 29.0
    private const val SLOPE = 24389.0 / 27.0

    private fun curve(t: Double): Double = if (t > BEND) cbrt(t) else (SLOPE * t + 16) / 116

    private fun rise(t: Double): Double = if (t > BEND) {
        val root = cbrt(max(t, BEND))
        1 / (root * root) / 3
    } else {
        SLOPE / 116
    }

    /** CIE 1976 L*a*b* of XYZ seen under a white (3): CIE 15. `into` may be the same array as `xyz`. */
    fun lab(xyz: DoubleArray, white: DoubleArray, into: DoubleArray = DoubleArray(3)): DoubleArray {
        val x = curve(xyz[0] / white[0])
        val y = curve(xyz[1] / white[1])
        val z = curve(xyz[2] / white[2])
        into[0] = 116 * y - 16
        into[1] = 500 * (x - y)
        into[2] = 200 * (y - z)
        return into
    }

    /** L*, a*, b* in the place of the cube roots (3) of XYZ over its white. */
    fun labOfRoots(roots: DoubleArray) {
        for (c in 0..2) if (roots[c] <= BEND_ROOT) roots[c] = (SLOPE * roots[c] * roots[c] * roots[c] + 16) / 116
        val (x, y, z) = roots
        roots[0] = 116 * y - 16
        roots[1] = 500 * (x - y)
        roots[2] = 200 * (y - z)
    }

    /** ∂ Lab / ∂ XYZ, (3, 3). */
    fun slopes(xyz: DoubleArray, white: DoubleArray): DoubleArray {
        val (x, y, z) = List(3) { rise(xyz[it] / white[it]) / white[it] }
        return doubleArrayOf(0.0, 116 * y, 0.0, 500 * x, -500 * y, 0.0, 0.0, 200 * y, -200 * z)
    }

    private fun product(a: DoubleArray, b: DoubleArray): DoubleArray = DoubleArray(9) {
        val row = it / 3 * 3
        a[row] * b[it % 3] + a[row + 1] * b[it % 3 + 3] + a[row + 2] * b[it % 3 + 6]
    }

    /** Covariance (3, 3) transformed by a matrix: M Σ Mᵀ. */
    fun through(matrix: DoubleArray, covariance: DoubleArray): DoubleArray =
        product(product(matrix, covariance), DoubleArray(9) { matrix[it % 3 * 3 + it / 3] })
}
