package org.camssf.colour

import org.camssf.LeastSquares
import org.camssf.Rules
import kotlin.math.max
import kotlin.math.sqrt

/** Distance of signals from those that any surface can give under the lamp. */
internal object SurfaceDistance {
    /** Largest accepted distance, in standard deviations. */
    val REACH get() = Rules.shipped.number("colour.reach")

    /**
     * min over 0 ≤ R ≤ 1 of ‖Σ^-½ (y - A R)‖, R linear between 5-nm nodes, by Wolfe's algorithm for the point of a
     * polytope that is nearest to the origin (Math. Program. 1976, 11, 128).
     *
     * @param y (3) signals.
     * @param spread (3, 3) their covariance Σ.
     * @param matrix A, (3) of (69): lamp times curves, scaled so that white gives 1.
     */
    fun of(y: DoubleArray, spread: DoubleArray, matrix: List<DoubleArray>): Double {
        val floor = 1e-12 + 1e-6 * (spread[0] + spread[4] + spread[8]) / 3
        val root =
            Symmetric.root(Array(3) { a -> DoubleArray(3) { spread[3 * a + it] + if (a == it) floor else 0.0 } })
                ?: throw NoColour.error()
        val whitened = Array(3) { matrix[it].copyOf() + y[it] }
        Symmetric.forward(root, whitened)
        val atoms = List(matrix[0].size) { i -> DoubleArray(3) { whitened[it][i] } }
        val target = DoubleArray(3) { whitened[it].last() }
        return nearest { along ->
            val corner = DoubleArray(3) { -target[it] }
            for (atom in atoms) if (dot(atom, along) < 0) add(corner, 1.0, atom)
            corner
        }
    }

    /**
     * Distance of a polytope in three dimensions from the origin. `outermost` gives the polytope's extreme point
     * opposite to a direction.
     */
    private fun nearest(outermost: (DoubleArray) -> DoubleArray): Double {
        var corners = listOf(outermost(doubleArrayOf(1.0, 1.0, 1.0)))
        var weights = doubleArrayOf(1.0)
        var x = corners[0]
        repeat(MOST) {
            val next = outermost(x)
            val size = dot(x, x)
            val scale = max(size, dot(next, next))
            if (size - dot(x, next) <= ROUNDING * sqrt(size * scale) || size <= ROUNDING * ROUNDING * scale) {
                return sqrt(size)
            }
            corners = corners + next
            weights += 0.0
            while (true) {
                val flat = flattest(corners) ?: return sqrt(size)
                if (flat.all { it > 0 }) {
                    weights = flat
                    break
                }
                val part = flat.indices.filter { flat[it] <= 0 }.minOf { weights[it] / (weights[it] - flat[it]) }
                val between = DoubleArray(flat.size) { weights[it] + part * (flat[it] - weights[it]) }
                val left = flat.indices.filter { flat[it] <= 0 }.minByOrNull { between[it] }!!
                val kept = flat.indices.filter { it != left && between[it] > 0 }
                corners = kept.map { corners[it] }
                weights = kept.map { between[it] }.toDoubleArray()
            }
            x = DoubleArray(3) { axis -> corners.indices.sumOf { weights[it] * corners[it][axis] } }
        }
        return sqrt(dot(x, x))
    }

    /** Weights, with sum 1, of the shortest vector in the affine hull of the corners; null if it is not unique. */
    private fun flattest(corners: List<DoubleArray>): DoubleArray? {
        if (corners.size == 1) return doubleArrayOf(1.0)
        val base = corners[0]
        val rows = Array(3) { axis -> DoubleArray(corners.size - 1) { corners[it + 1][axis] - base[axis] } }
        if (corners.size > 4) return null
        val free = LeastSquares.solve(rows, DoubleArray(3) { -base[it] }) ?: return null
        return doubleArrayOf(1 - free.sum()) + free
    }

    private const val MOST = 10_000
    private const val ROUNDING = 1e-14
}
