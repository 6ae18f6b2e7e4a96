package org.camssf.verdict

import org.camssf.LeastSquares
import kotlin.math.sqrt

/**
 * Applies the inverse of Σ = D + U Uᵀ, D block diagonal, without forming Σ or its inverse.
 *
 * With D = L Lᵀ, V = L⁻¹ U and C = I + Vᵀ V, Σ⁻¹ = L⁻ᵀ (I - V C⁻¹ Vᵀ) L⁻¹ (Woodbury). For an error v let z = L⁻¹ v, m
 * = C⁻¹ Vᵀ z, the part that U explains, and w = z - V m, the rest. Then aᵀ Σ⁻¹ b = w_aᵀ w_b + m_aᵀ m_b, a sum of
 * squares if a = b, so that no digits are lost even if U is much larger than D.
 *
 * @param blocks of D, each symmetric and positive definite.
 * @param shared U, (rows, errors).
 */
internal class Precision(blocks: List<Array<DoubleArray>>, shared: Array<DoubleArray>) {
    private val starts = blocks.runningFold(0) { from, block -> from + block.size }
    private val roots = blocks.map { Triangle.root(it) }
    private val errors = shared[0].size

    /** V (rows, errors). */
    private val whitened = Array(shared.size) { shared[it].copyOf() }

    /** Cholesky factor of C. */
    private val root: Triangle

    init {
        for ((b, own) in roots.withIndex()) own.forward(whitened, starts[b])
        val capacity = Array(errors) { a -> DoubleArray(errors).also { it[a] = 1.0 } }
        for (row in whitened) {
            for (a in 0 until errors) add(capacity[a], row[a], row, a + 1)
        }
        root = Triangle.root(capacity)
    }

    /** w, followed by m, of an error v. */
    fun weighed(values: DoubleArray): DoubleArray {
        val solved = values.copyOf()
        for ((b, own) in roots.withIndex()) own.forward(solved, starts[b])
        val correction = DoubleArray(errors)
        for (i in solved.indices) add(correction, solved[i], whitened[i], errors)
        root.forward(correction)
        root.backward(correction)
        for (i in solved.indices) solved[i] -= dot(whitened[i], correction)
        return solved + correction
    }

    /**
     * The part of vᵀ Σ⁻¹ v that free errors in all rows of a block explain: eᵀ (Σ⁻¹)⁻¹ e of the block's rows, with e
     * = Σ⁻¹ v.
     *
     * @param weighed the result of the function of this name for v.
     */
    fun alone(block: Int, weighed: DoubleArray): Double {
        val own = weighed.copyOfRange(starts[block], starts[block + 1])
        val shares = List(own.size) { whitened[starts[block] + it].copyOf().also { share -> root.forward(share) } }
        val left = Array(own.size) { a ->
            DoubleArray(own.size) { b -> (if (a == b) 1.0 else 0.0) - dot(shares[a], shares[b]) }
        }
        return dot(own, LeastSquares.solve(left, own) ?: return 0.0)
    }
}

/** The lower triangular factor of a Cholesky factorisation. */
private class Triangle private constructor(private val rows: Array<DoubleArray>) {
    /** Multiplies a part of a vector by the inverse of this triangle, in place. */
    fun forward(vector: DoubleArray, from: Int = 0) {
        for ((i, row) in rows.withIndex()) {
            var value = vector[from + i]
            for (j in 0 until i) value -= row[j] * vector[from + j]
            vector[from + i] = value / row[i]
        }
    }

    /** Multiplies some rows of a matrix by the inverse of this triangle, in place. */
    fun forward(matrix: Array<DoubleArray>, from: Int) {
        for ((i, row) in rows.withIndex()) {
            val own = matrix[from + i]
            for (j in 0 until i) add(own, -row[j], matrix[from + j], own.size)
            for (q in own.indices) own[q] /= row[i]
        }
    }

    /** Multiplies a vector by the inverse of the transpose, in place. */
    fun backward(vector: DoubleArray) {
        for (i in rows.indices.reversed()) {
            vector[i] /= rows[i][i]
            add(vector, -vector[i], rows[i], i)
        }
    }

    companion object {
        /** Factorises a symmetric positive definite matrix; only its lower triangle is read. */
        fun root(matrix: Array<DoubleArray>): Triangle {
            val rows = Array(matrix.size) { matrix[it].copyOf() }
            for (i in rows.indices) {
                for (j in 0..i) {
                    var value = rows[i][j]
                    for (p in 0 until j) value -= rows[i][p] * rows[j][p]
                    rows[i][j] = if (i == j) sqrt(value) else value / rows[j][j]
                }
            }
            return Triangle(rows)
        }
    }
}

/** into += factor · values, for the first `count` entries. */
private fun add(into: DoubleArray, factor: Double, values: DoubleArray, count: Int) {
    for (i in 0 until count) into[i] += factor * values[i]
}
