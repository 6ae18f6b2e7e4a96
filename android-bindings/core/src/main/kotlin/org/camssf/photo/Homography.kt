package org.camssf.photo

import org.camssf.LeastSquares
import kotlin.math.abs
import kotlin.math.hypot

/** A projective map of the plane: a (3, 3) matrix, row-major. Point arrays hold x and y alternately. */
internal class Homography(val matrix: DoubleArray) {
    fun x(x: Double, y: Double): Double = (matrix[0] * x + matrix[1] * y + matrix[2]) / depth(x, y)

    fun y(x: Double, y: Double): Double = (matrix[3] * x + matrix[4] * y + matrix[5]) / depth(x, y)

    private fun depth(x: Double, y: Double): Double = matrix[6] * x + matrix[7] * y + matrix[8]

    fun map(points: DoubleArray): DoubleArray = DoubleArray(points.size) {
        val at = it - it % 2
        if (it % 2 == 0) x(points[at], points[at + 1]) else y(points[at], points[at + 1])
    }

    /** The composition: the other map first, then this one. */
    operator fun times(other: Homography): Homography = Homography(
        DoubleArray(9) { i -> (0..2).sumOf { matrix[i / 3 * 3 + it] * other.matrix[3 * it + i % 3] } },
    )

    /** The inverse map; null if the matrix is singular. */
    fun inverse(): Homography? {
        val m = matrix
        val cofactors = doubleArrayOf(
            m[4] * m[8] - m[5] * m[7], m[2] * m[7] - m[1] * m[8], m[1] * m[5] - m[2] * m[4],
            m[5] * m[6] - m[3] * m[8], m[0] * m[8] - m[2] * m[6], m[2] * m[3] - m[0] * m[5],
            m[3] * m[7] - m[4] * m[6], m[1] * m[6] - m[0] * m[7], m[0] * m[4] - m[1] * m[3],
        )
        val determinant = m[0] * cofactors[0] + m[1] * cofactors[3] + m[2] * cofactors[6]
        if (determinant == 0.0 || !determinant.isFinite()) return null
        return Homography(DoubleArray(9) { cofactors[it] / determinant })
    }

    companion object {
        /** The map from four points to four others; null if three of them lie on a line. */
        fun of(source: DoubleArray, target: DoubleArray): Homography? {
            val rows = Array(8) { DoubleArray(8) }
            val right = DoubleArray(8)
            for (i in 0..3) {
                val x = source[2 * i]
                val y = source[2 * i + 1]
                val u = target[2 * i]
                val v = target[2 * i + 1]
                rows[2 * i] = doubleArrayOf(x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y)
                rows[2 * i + 1] = doubleArrayOf(0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y)
                right[2 * i] = u
                right[2 * i + 1] = v
            }
            val solution = LeastSquares.solve(rows, right) ?: return null
            return Homography(solution + 1.0)
        }
    }
}
