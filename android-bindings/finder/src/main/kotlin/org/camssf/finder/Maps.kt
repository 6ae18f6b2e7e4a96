package org.camssf.finder

import kotlin.math.abs
import kotlin.math.max

/**
 * Homographies as nine numbers, row by row. Sums are in the same order as in Python's `lattices`, for the same bits.
 */
internal object Maps {
    fun x(h: DoubleArray, u: Double, v: Double): Double =
        (h[0] * u + h[1] * v + h[2]) / (h[6] * u + h[7] * v + h[8])

    fun y(h: DoubleArray, u: Double, v: Double): Double =
        (h[3] * u + h[4] * v + h[5]) / (h[6] * u + h[7] * v + h[8])

    /** Inverse homography by cofactors, up to its scale. */
    fun inverse(h: DoubleArray): DoubleArray = doubleArrayOf(
        h[4] * h[8] - h[5] * h[7], h[2] * h[7] - h[1] * h[8], h[1] * h[5] - h[2] * h[4],
        h[5] * h[6] - h[3] * h[8], h[0] * h[8] - h[2] * h[6], h[2] * h[3] - h[0] * h[5],
        h[3] * h[7] - h[4] * h[6], h[1] * h[6] - h[0] * h[7], h[0] * h[4] - h[1] * h[3],
    )

    /** Area of one lattice cell at (u, v), px²; never 0. */
    fun area(h: DoubleArray, u: Double, v: Double): Double {
        val w = h[6] * u + h[7] * v + h[8]
        val det = h[0] * (h[4] * h[8] - h[5] * h[7]) - h[1] * (h[3] * h[8] - h[5] * h[6]) +
            h[2] * (h[3] * h[7] - h[4] * h[6])
        return max(abs(det / (w * w * w)), 1e-9)
    }

    /**
     * Least-squares homography of `count` rows (u, v, x, y), centred and scaled; null if they do not determine one.
     */
    fun fitted(pairs: DoubleArray, count: Int): DoubleArray? {
        var mu = 0.0
        var mv = 0.0
        var mx = 0.0
        var my = 0.0
        for (i in 0 until count) {
            mu += pairs[4 * i]
            mv += pairs[4 * i + 1]
            mx += pairs[4 * i + 2]
            my += pairs[4 * i + 3]
        }
        mu /= count
        mv /= count
        mx /= count
        my /= count
        var size = 0.0
        for (i in 0 until count) size = max(max(size, abs(pairs[4 * i + 2] - mx)), abs(pairs[4 * i + 3] - my))
        if (size <= 0.0) return null
        val normal = Array(8) { DoubleArray(9) }
        val row = DoubleArray(9)
        for (i in 0 until count) {
            val p = pairs[4 * i] - mu
            val q = pairs[4 * i + 1] - mv
            val s = (pairs[4 * i + 2] - mx) / size
            val t = (pairs[4 * i + 3] - my) / size
            for (axis in 0..1) {
                val to = if (axis == 0) s else t
                row.fill(0.0)
                row[3 * axis] = p
                row[3 * axis + 1] = q
                row[3 * axis + 2] = 1.0
                row[6] = -to * p
                row[7] = -to * q
                row[8] = to
                for (r in 0..7) for (c in 0..8) normal[r][c] += row[r] * row[c]
            }
        }
        val h = solved(normal) ?: return null
        // Undo the scaling and centring: x = size · x' + mx, u' = u - mu.
        val all = doubleArrayOf(
            size * h[0] + mx * h[6], size * h[1] + mx * h[7], size * h[2] + mx,
            size * h[3] + my * h[6], size * h[4] + my * h[7], size * h[5] + my,
            h[6], h[7], 1.0,
        )
        for (r in 0..2) all[3 * r + 2] = all[3 * r + 2] - all[3 * r] * mu - all[3 * r + 1] * mv
        return all
    }

    /** Gaussian elimination with partial pivoting; null if a pivot is practically 0. */
    private fun solved(m: Array<DoubleArray>): DoubleArray? {
        val n = m.size
        for (i in 0 until n) {
            var pivot = i
            for (r in i + 1 until n) if (abs(m[r][i]) > abs(m[pivot][i])) pivot = r
            val swapped = m[i]
            m[i] = m[pivot]
            m[pivot] = swapped
            if (abs(m[i][i]) < 1e-12) return null
            for (r in i + 1 until n) {
                val part = m[r][i] / m[i][i]
                for (j in i..n) m[r][j] -= part * m[i][j]
            }
        }
        val x = DoubleArray(n)
        for (i in n - 1 downTo 0) {
            var total = m[i][n]
            for (j in i + 1 until n) total -= m[i][j] * x[j]
            x[i] = total / m[i][i]
        }
        return x
    }
}
