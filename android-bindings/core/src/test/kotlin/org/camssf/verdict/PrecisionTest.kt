package org.camssf.verdict

import org.camssf.LeastSquares
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Test
import kotlin.random.Random

/** Σ⁻¹ by its structure, against Σ written out. */
class PrecisionTest {
    private val random = Random(7)
    private val sizes = listOf(3, 6, 3, 1, 9)
    private val n = sizes.sum()

    private fun numbers(size: Int) = DoubleArray(size) { random.nextDouble(-1.0, 1.0) }

    /** Noise of 1e-4 beside errors that the rows of a block share, as large as a chart's. */
    private val blocks = sizes.map { size ->
        val factors = List(size) { numbers(4) }
        Array(size) { a ->
            DoubleArray(size) { b -> 1e-4 * dot(factors[a], factors[b]) + if (a == b) 1e-8 else 0.0 }
        }
    }

    /** As large as a white's and a lamp's; fewer errors than rows, and more. */
    private val shared = listOf(5, n + 7).map { errors ->
        Array(n) { numbers(errors).also { row -> for (q in row.indices) row[q] *= 1e-2 } }
    }

    private fun dense(shared: Array<DoubleArray>): Array<DoubleArray> {
        val sigma = Array(n) { a -> DoubleArray(n) { b -> dot(shared[a], shared[b]) } }
        var from = 0
        for (block in blocks) {
            for (a in block.indices) for (b in block.indices) sigma[from + a][from + b] += block[a][b]
            from += block.size
        }
        return sigma
    }

    @Test
    fun `products are those of the inverse`() {
        for (u in shared) {
            val precision = Precision(blocks, u)
            val (a, b) = List(2) { numbers(n) }
            val inverse = LeastSquares.solve(dense(u), b)!!
            val whole = dot(b, inverse)
            assertEquals(whole, dot(precision.weighed(b), precision.weighed(b)), 1e-9 * whole)
            assertEquals(dot(a, inverse), dot(precision.weighed(a), precision.weighed(b)), 1e-9 * whole)
        }
    }

    /** What free errors of a block explain is what the other rows leave of χ². */
    @Test
    fun `a block alone explains what is lost without it`() {
        for (u in shared) {
            val precision = Precision(blocks, u)
            val v = numbers(n)
            val weighed = precision.weighed(v)
            val whole = dot(weighed, weighed)
            var from = 0
            for ((block, size) in sizes.withIndex()) {
                val rest = (0 until n).filter { it !in from until from + size }
                val all = dense(u)
                val sigma = Array(rest.size) { a -> DoubleArray(rest.size) { b -> all[rest[a]][rest[b]] } }
                val left = DoubleArray(rest.size) { v[rest[it]] }
                val lost = whole - dot(left, LeastSquares.solve(sigma, left)!!)
                assertEquals(lost, precision.alone(block, weighed), 1e-9 * whole)
                from += size
            }
        }
    }
}
