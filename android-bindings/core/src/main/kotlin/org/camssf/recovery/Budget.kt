package org.camssf.recovery

import org.camssf.Grid
import org.camssf.Nodes
import kotlin.math.sqrt

/** Splits the posterior variance of the curves by source, and computes the bands of predicted signals. */
internal object Budget {
    /** Sources, in the order of the result document. */
    val SOURCES = listOf("noise", "chart", "white", "lamp", "lamp modes", "uneven light", "unseen")

    /**
     * Uncertainty budget: the share of each source in the variance of each channel's curve of peak 1, (3); the shares
     * add up to 1. Python's `explain`.
     *
     * @param observation that the answer came from.
     * @param atoms the basis of the answer, with the width of its prior.
     */
    fun explain(observation: Observation, atoms: Atoms): Map<String, DoubleArray> {
        val sensing = LinearModel(observation, atoms)
        val gain = gain(sensing.matrix, sensing.covariance)
        val r = sensing.basis.count
        val code = (gain * Matrix(gain.columns, 1, sensing.target)).values
        val grams = List(3) { gram(sensing.basis, it, code) }
        fun shares(of: (Matrix) -> Matrix): DoubleArray = DoubleArray(3) { c ->
            val own = gain.part(c * r until (c + 1) * r, 0 until gain.columns)
            val spread = of(own)
            (0 until r).sumOf { i -> (0 until r).sumOf { grams[c][i, it] * spread[i, it] } }
        }
        val parts = LinkedHashMap<String, DoubleArray>()
        for ((source, term) in sensing.terms) parts[source] = shares { own -> (own * term).timesTransposed(own) }
        val seen = gain * sensing.matrix
        val left = Matrix.of(3 * r, 3 * r) { i, j -> (if (i == j) 1.0 else 0.0) - seen[i, j] }
        parts["unseen"] = DoubleArray(3) { c ->
            val own = left.part(c * r until (c + 1) * r, 0 until 3 * r)
            val spread = own.timesTransposed(own)
            (0 until r).sumOf { i -> (0 until r).sumOf { grams[c][i, it] * spread[i, it] } }
        }
        val whole = DoubleArray(3) { c -> parts.values.sumOf { it[c] } }
        return SOURCES.associateWith { source -> DoubleArray(3) { parts.getValue(source)[it] / whole[it] } }
    }

    /** G = (Aᵀ Σ⁻¹ A + I)⁻¹ Aᵀ Σ⁻¹, (3 r, N): maps the rows to the code. */
    private fun gain(of: Matrix, covariance: Matrix): Matrix {
        val size = of.rows
        val wide = of.columns
        // Σ = L Lᵀ; with Ã = L⁻¹ A, Aᵀ Σ⁻¹ = Ãᵀ L⁻¹.
        val whitened = covariance.whiten(Matrix.beside(of, Matrix.unit(size)))
        val matrix = whitened.part(0 until size, 0 until wide).transposed()
        val right = matrix * whitened.part(0 until size, wide until wide + size)
        val normal = matrix.timesTransposed(matrix).plus(Matrix.unit(wide))
        val root = normal.whiten(Matrix.beside(Matrix.unit(wide), right))
        return root.part(0 until wide, 0 until wide).transposed() * root.part(0 until wide, wide until wide + size)
    }

    /**
     * (r, r) Gram matrix, summed over the grid, of the derivatives of a channel's curve of peak 1 by the code, times
     * its peak.
     */
    private fun gram(basis: Atoms, channel: Int, code: DoubleArray): Matrix {
        val r = basis.count
        fun atom(v: Int, p: Int) = basis.dictionary[(channel * Nodes.SIZE + v) * r + p]
        val curve = DoubleArray(Nodes.SIZE) { v ->
            basis.mean[channel * Nodes.SIZE + v] + (0 until r).sumOf { atom(v, it) * code[channel * r + it] }
        }
        val top = curve.indices.maxByOrNull { curve[it] }!!
        val moves = List(r) { p -> Nodes.straight { atom(it, p) - curve[it] / curve[top] * atom(top, p) } }
        return Matrix.of(r, r) { i, j -> (0 until Grid.SIZE).sumOf { moves[i][it] * moves[j][it] } }
    }

    /**
     * (k, n, 3) one standard deviation of each true signal minus its prediction. Python's `predict`.
     *
     * @param observation that the answer came from, with all n patches; a masked signal has its predicted value and a
     *   standard error too large to matter.
     * @param ssf the answer.
     * @param atoms the basis of the answer, with the width of its prior.
     */
    fun bands(observation: Observation, ssf: Ssf, atoms: Atoms): DoubleArray {
        val sensing = LinearModel(observation, atoms)
        val (k, n) = observation.signals.shape
        // Gain modes are unknowns next to the code: their uncertainty is part of the band, but predictions are in
        // even light.
        val a = if (sensing.gains.columns == 0) sensing.matrix else Matrix.beside(sensing.matrix, sensing.gains)
        val size = a.rows
        val noise = sensing.terms.getValue("noise")
        val shared = sensing.gains.timesTransposed(sensing.gains)
        val more = sensing.terms.filterKeys { it != "noise" }.values.reduce { all, term -> all.plus(term) }
        val others = more.minus(shared)
        val kept = others.plus(a.timesTransposed(a))
        // S = A G; the diagonal of (I - S) kept (I - S)ᵀ + S N Sᵀ, by the few columns of A.
        val gain = gain(a, sensing.covariance.minus(shared))
        val across = kept.timesTransposed(gain) // kept Gᵀ
        val inner = gain * across
        for (i in 0 until inner.rows) {
            for (j in 0 until inner.columns) {
                inner[i, j] += (0 until size).sumOf { gain[i, it] * gain[j, it] * noise[it, it] }
            }
        }
        val smooth = a * inner
        val known = observation.known
        val first = DoubleArray(Grid.SIZE) { known.lamp.values[it] * known.whiteReflectance.values[it] * Grid.STEP }
        val folded = Nodes.fold(first)
        return DoubleArray(3 * k * n) { at ->
            val c = at % 3
            val j = at / 3 / n
            val row = c * k * n + at / 3
            var variance = kept[row, row]
            for (p in 0 until a.columns) variance += a[row, p] * (smooth[row, p] - 2 * across[row, p])
            val level = (0 until Nodes.SIZE).sumOf { sensing.basis.mean[c * Nodes.SIZE + it] * folded[it] }
            val seen = (0 until Grid.SIZE).sumOf {
                ssf.sharedLamp[j * Grid.SIZE + it] * known.whiteReflectance.values[it] * Grid.STEP *
                    ssf.sharedValues[3 * it + c]
            }
            sqrt(variance) * (sensing.white[c * k + j] / (seen * level))
        }
    }
}
