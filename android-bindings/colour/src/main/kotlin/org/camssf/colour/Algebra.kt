package org.camssf.colour

import kotlin.math.abs
import kotlin.math.sqrt

/** Dense linear algebra of small symmetric matrices (n, n), given as rows. */
internal object Symmetric {
    /** Limit of Jacobi sweeps; with quadratic convergence, fewer than ten suffice. */
    private const val SWEEPS = 64

    /** Cholesky factor L, a lower triangle, with A = L Lᵀ; null if A is not positive definite. */
    fun root(matrix: Array<DoubleArray>): Array<DoubleArray>? {
        val rows = Array(matrix.size) { DoubleArray(matrix.size) }
        for (i in rows.indices) {
            for (j in 0..i) {
                var value = matrix[i][j]
                for (p in 0 until j) value -= rows[i][p] * rows[j][p]
                if (i == j && !(value > 0 && value.isFinite())) return null
                rows[i][j] = if (i == j) sqrt(value) else value / rows[j][j]
            }
        }
        return rows
    }

    /** Forward substitution: replaces a matrix B (n, m) by L⁻¹ B, in place. */
    fun forward(root: Array<DoubleArray>, right: Array<DoubleArray>) {
        for (i in root.indices) {
            for (j in 0 until i) add(right[i], -root[i][j], right[j])
            for (q in right[i].indices) right[i][q] /= root[i][i]
        }
    }

    /**
     * Eigenvalues in descending order, each with its unit eigenvector, by Jacobi rotations, which keep the relative
     * accuracy of small eigenvalues.
     */
    fun eigen(matrix: Array<DoubleArray>): List<Pair<Double, DoubleArray>> {
        val n = matrix.size
        val a = Array(n) { matrix[it].copyOf() }
        val axes = Array(n) { i -> DoubleArray(n).also { it[i] = 1.0 } } // rows are the eigenvectors
        repeat(SWEEPS) {
            var turned = false
            for (p in 0 until n) {
                for (q in p + 1 until n) {
                    if (abs(a[p][q]) <= ROUNDING * sqrt(abs(a[p][p] * a[q][q])) || a[p][q] == 0.0) continue
                    turned = true
                    turn(a, axes, p, q)
                }
            }
            if (!turned) return sorted(a, axes)
        }
        return sorted(a, axes)
    }

    private fun sorted(a: Array<DoubleArray>, axes: Array<DoubleArray>) =
        a.indices.sortedByDescending { a[it][it] }.map { a[it][it] to axes[it] }

    private fun turn(a: Array<DoubleArray>, axes: Array<DoubleArray>, p: Int, q: Int) {
        val theta = (a[q][q] - a[p][p]) / (2 * a[p][q])
        val t = (if (theta < 0) -1.0 else 1.0) / (abs(theta) + sqrt(theta * theta + 1))
        val c = 1 / sqrt(t * t + 1)
        val s = t * c
        val corner = a[p][q]
        for (i in a.indices) {
            if (i == p || i == q) continue
            val left = a[i][p]
            val right = a[i][q]
            a[i][p] = c * left - s * right
            a[i][q] = s * left + c * right
            a[p][i] = a[i][p]
            a[q][i] = a[i][q]
        }
        a[p][p] -= t * corner
        a[q][q] += t * corner
        a[p][q] = 0.0
        a[q][p] = 0.0
        val first = axes[p]
        val second = axes[q]
        for (i in first.indices) {
            val left = first[i]
            first[i] = c * left - s * second[i]
            second[i] = s * left + c * second[i]
        }
    }

    private const val ROUNDING = 1e-17
}

/** into += factor · values. */
internal fun add(into: DoubleArray, factor: Double, values: DoubleArray) {
    if (factor == 0.0) return
    for (i in into.indices) into[i] += factor * values[i]
}

internal fun dot(a: DoubleArray, b: DoubleArray): Double {
    var total = 0.0
    for (i in a.indices) total += a[i] * b[i]
    return total
}

/** Each number times a factor. */
internal operator fun DoubleArray.times(factor: Double): DoubleArray = DoubleArray(size) { this[it] * factor }

/** Mean of arrays of one size, by weights of sum 1. */
internal fun mean(values: List<DoubleArray>, weights: DoubleArray): DoubleArray {
    val mean = DoubleArray(values[0].size)
    for (i in values.indices) for (at in mean.indices) mean[at] += weights[i] * values[i][at]
    return mean
}

/** Covariance (n, n) of arrays (n) about their [mean], by weights of sum 1, row-major. */
internal fun covariance(values: List<DoubleArray>, weights: DoubleArray): DoubleArray {
    val mean = mean(values, weights)
    val n = mean.size
    val squares = values.map { value ->
        DoubleArray(n * n) { (value[it / n] - mean[it / n]) * (value[it % n] - mean[it % n]) }
    }
    return mean(squares, weights)
}
