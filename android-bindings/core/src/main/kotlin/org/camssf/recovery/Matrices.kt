package org.camssf.recovery

import org.camssf.InvalidArgument
import kotlin.math.sqrt

/** A dense matrix, row-major. */
internal class Matrix(val rows: Int, val columns: Int, val values: DoubleArray = DoubleArray(rows * columns)) {
    operator fun get(i: Int, j: Int): Double = values[i * columns + j]

    operator fun set(i: Int, j: Int, value: Double) {
        values[i * columns + j] = value
    }

    /** this · other. */
    operator fun times(other: Matrix): Matrix {
        val found = Matrix(rows, other.columns)
        for (i in 0 until rows) {
            for (p in 0 until columns) {
                val factor = values[i * columns + p]
                if (factor == 0.0) continue
                val to = i * other.columns
                val from = p * other.columns
                for (j in 0 until other.columns) found.values[to + j] += factor * other.values[from + j]
            }
        }
        return found
    }

    /** this · otherᵀ. */
    fun timesTransposed(other: Matrix): Matrix {
        val found = Matrix(rows, other.rows)
        for (i in 0 until rows) {
            for (j in 0 until other.rows) {
                var total = 0.0
                for (p in 0 until columns) total += values[i * columns + p] * other.values[j * columns + p]
                found.values[i * other.rows + j] = total
            }
        }
        return found
    }

    fun transposed(): Matrix = of(columns, rows) { i, j -> this[j, i] }

    fun plus(other: Matrix): Matrix = Matrix(
        rows, columns,
        DoubleArray(values.size) {
            values[it] + other.values[it]
        },
    )

    fun minus(other: Matrix): Matrix =
        Matrix(rows, columns, DoubleArray(values.size) { values[it] - other.values[it] })

    /** The submatrix of these rows and columns. */
    fun part(rows: IntRange, columns: IntRange): Matrix =
        of(rows.last - rows.first + 1, columns.last - columns.first + 1) { i, j ->
            this[
                rows.first + i, columns.first +
                    j,
            ]
        }

    /**
     * L⁻¹ `right` with this = L Lᵀ (Cholesky).
     *
     * @throws InvalidArgument this matrix is not positive definite.
     */
    fun whiten(right: Matrix): Matrix {
        val root = Matrix(rows, rows)
        for (i in 0 until rows) {
            for (j in 0..i) {
                var value = this[i, j]
                for (p in 0 until j) value -= root.values[i * rows + p] * root.values[j * rows + p]
                if (i == j && !(value > 0 && value.isFinite())) {
                    throw InvalidArgument("The signals' covariance is none.", "Check the tolerances.")
                }
                root[i, j] = if (i == j) sqrt(value) else value / root[j, j]
            }
        }
        val found = Matrix(rows, right.columns, right.values.copyOf())
        val c = right.columns
        for (i in 0 until rows) {
            for (p in 0 until i) {
                val factor = root[i, p]
                if (factor != 0.0) for (j in 0 until c) found.values[i * c + j] -= factor * found.values[p * c + j]
            }
            for (j in 0 until c) found.values[i * c + j] /= root[i, i]
        }
        return found
    }

    companion object {
        inline fun of(rows: Int, columns: Int, value: (Int, Int) -> Double): Matrix =
            Matrix(rows, columns, DoubleArray(rows * columns) { value(it / columns, it % columns) })

        fun unit(size: Int): Matrix = of(size, size) { i, j -> if (i == j) 1.0 else 0.0 }

        /** Concatenates matrices of the same number of rows side by side. */
        fun beside(vararg parts: Matrix): Matrix {
            val found = Matrix(parts[0].rows, parts.sumOf { it.columns })
            var from = 0
            for (part in parts) {
                for (i in 0 until part.rows) for (j in 0 until part.columns) found[i, from + j] = part[i, j]
                from += part.columns
            }
            return found
        }
    }
}
