package org.camssf

import kotlin.math.abs
import kotlin.math.hypot

/** Small dense least squares by Householder reflections. */
internal object LeastSquares {
    /**
     * The x that minimises ‖A x - b‖, for A (rows, unknowns) with rows ≥ unknowns; null if the columns are linearly
     * dependent or a value is not finite.
     */
    fun solve(matrix: Array<DoubleArray>, right: DoubleArray): DoubleArray? {
        val a = Array(matrix.size) { matrix[it].copyOf() }
        val b = right.copyOf()
        val n = a[0].size
        val sizes = DoubleArray(n) { j -> norm(a, j, 0) }
        for (j in 0 until n) {
            val length = norm(a, j, j)
            if (!(length > 1e-14 * sizes[j]) || !length.isFinite()) return null
            val head = if (a[j][j] > 0) -length else length
            // The Householder vector that maps column j to head e, e the first unit vector: v = column - head e.
            val v = DoubleArray(a.size - j) { a[j + it][j] }
            v[0] -= head
            val square = v.sumOf { it * it }
            for (c in j until n) {
                val share = 2 * v.indices.sumOf { v[it] * a[j + it][c] } / square
                for (i in v.indices) a[j + i][c] -= share * v[i]
            }
            val share = 2 * v.indices.sumOf { v[it] * b[j + it] } / square
            for (i in v.indices) b[j + i] -= share * v[i]
        }
        val x = DoubleArray(n)
        for (j in n - 1 downTo 0) {
            x[j] = (b[j] - (j + 1 until n).sumOf { a[j][it] * x[it] }) / a[j][j]
        }
        return x.takeIf { all -> all.all { it.isFinite() } }
    }

    private fun norm(a: Array<DoubleArray>, column: Int, from: Int): Double {
        var length = 0.0
        for (i in from until a.size) length = hypot(length, abs(a[i][column]))
        return length
    }
}
