package org.camssf.colour

import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Test
import kotlin.math.abs
import kotlin.math.cos
import kotlin.math.pow
import kotlin.math.sin

class AlgebraTest {
    /** d_i d_j 2^-|i - j|, sizes from 1 down to 1e-3. */
    private fun matrix(n: Int): Array<DoubleArray> {
        val size = DoubleArray(n) { 10.0.pow(-3.0 * it / n) }
        return Array(n) { a -> DoubleArray(n) { b -> size[a] * size[b] * 0.5.pow(abs(a - b)) } }
    }

    @Test
    fun `eigenvectors are orthonormal, rebuild their matrix, and come largest first`() {
        val given = matrix(30)
        val parts = Symmetric.eigen(given)
        assertEquals(parts.map { it.first }.sortedDescending(), parts.map { it.first })
        for ((i, one) in parts.withIndex()) {
            for ((j, other) in parts.withIndex()) {
                assertEquals(if (i == j) 1.0 else 0.0, dot(one.second, other.second), 1e-13)
            }
        }
        for (a in given.indices) {
            for (b in given.indices) {
                val built = parts.sumOf { (size, axis) -> size * axis[a] * axis[b] }
                assertEquals(given[a][b], built, 1e-14)
            }
        }
    }

    @Test
    fun `small eigenvalues have their digits beside large ones`() {
        val (c, s) = cos(0.3) to sin(0.3)
        val (large, small) = 1.0 to 1e-9
        val given = arrayOf(
            doubleArrayOf(large * c * c + small * s * s, (large - small) * c * s),
            doubleArrayOf((large - small) * c * s, large * s * s + small * c * c),
        )
        val found = Symmetric.eigen(given)
        assertEquals(large, found[0].first, 1e-15)
        assertEquals(small, found[1].first, 1e-16)
    }

    @Test
    fun `a matrix without eigenvalues to turn is taken as it is`() {
        val found = Symmetric.eigen(arrayOf(doubleArrayOf(0.0, 0.0), doubleArrayOf(0.0, 2.0)))
        assertEquals(listOf(2.0, 0.0), found.map { it.first })
    }

    @Test
    fun `the root's square is the matrix, and there is none of what is not positive definite`() {
        val given = matrix(12)
        val root = Symmetric.root(given)!!
        for (a in given.indices) for (b in given.indices) assertEquals(given[a][b], dot(root[a], root[b]), 1e-16)
        assertNull(Symmetric.root(arrayOf(doubleArrayOf(1.0, 2.0), doubleArrayOf(2.0, 1.0))))
        assertNull(Symmetric.root(arrayOf(doubleArrayOf(Double.NaN))))
    }

    @Test
    fun `forward undoes the root`() {
        val given = matrix(5)
        val root = Symmetric.root(given)!!
        val right = Array(5) { row -> DoubleArray(5) { given[row][it] } }
        Symmetric.forward(root, right) // L⁻¹ L Lᵀ
        for (a in 0..4) for (b in 0..4) assertEquals(root[b][a], right[a][b], 1e-15)
    }
}
