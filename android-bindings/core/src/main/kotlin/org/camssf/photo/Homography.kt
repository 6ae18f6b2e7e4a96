package org.camssf.photo

import kotlin.math.abs
import kotlin.math.max

/** A projective map of the plane: a (3, 3) matrix, row-major. Point arrays hold x and y alternately. */
internal class Homography(val matrix: DoubleArray) {
    fun x(x: Double, y: Double): Double = (matrix[0] * x + matrix[1] * y + matrix[2]) / depth(x, y)

    fun y(x: Double, y: Double): Double = (matrix[3] * x + matrix[4] * y + matrix[5]) / depth(x, y)

    /** Third homogeneous coordinate; on a plane seen by a camera its sign changes where the plane is behind it. */
    fun depth(x: Double, y: Double): Double = matrix[6] * x + matrix[7] * y + matrix[8]

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
        val determinant = determinant()
        if (determinant == 0.0 || !determinant.isFinite()) return null
        val cofactors = adjugate().matrix
        return Homography(DoubleArray(9) { cofactors[it] / determinant })
    }

    /** The inverse up to its scale, which changes nothing in a map of points. */
    fun adjugate(): Homography {
        val m = matrix
        return Homography(
            doubleArrayOf(
                m[4] * m[8] - m[5] * m[7], m[2] * m[7] - m[1] * m[8], m[1] * m[5] - m[2] * m[4],
                m[5] * m[6] - m[3] * m[8], m[0] * m[8] - m[2] * m[6], m[2] * m[3] - m[0] * m[5],
                m[3] * m[7] - m[4] * m[6], m[1] * m[6] - m[0] * m[7], m[0] * m[4] - m[1] * m[3],
            ),
        )
    }

    /** Area that a unit square at (x, y) is mapped to, by the Jacobian determinant; at least 1e-9. */
    fun area(x: Double, y: Double): Double {
        val w = depth(x, y)
        return max(abs(determinant() / (w * w * w)), 1e-9)
    }

    private fun determinant(): Double {
        val m = matrix
        return m[0] * (m[4] * m[8] - m[5] * m[7]) + m[1] * (m[5] * m[6] - m[3] * m[8]) +
            m[2] * (m[3] * m[7] - m[4] * m[6])
    }

    companion object {
        /** The map of four points to four others, in the same order around; null if three of them lie on a line. */
        fun of(source: DoubleArray, target: DoubleArray): Homography? {
            val back = ofSquare(source)?.inverse() ?: return null
            return ofSquare(target)?.times(back)
        }

        /** The map of (0, 0), (1, 0), (1, 1), (0, 1) to four points (Heckbert 1989, section 2.2.3). */
        private fun ofSquare(p: DoubleArray): Homography? {
            val ax = p[2] - p[4]
            val ay = p[3] - p[5]
            val bx = p[6] - p[4]
            val by = p[7] - p[5]
            val sx = p[0] - p[2] + p[4] - p[6]
            val sy = p[1] - p[3] + p[5] - p[7]
            val area = ax * by - bx * ay
            if (area == 0.0 || !area.isFinite()) return null
            val g = (sx * by - bx * sy) / area
            val h = (ax * sy - sx * ay) / area
            return Homography(
                doubleArrayOf(
                    p[2] - p[0] + g * p[2], p[6] - p[0] + h * p[6], p[0],
                    p[3] - p[1] + g * p[3], p[7] - p[1] + h * p[7], p[1],
                    g, h, 1.0,
                ),
            )
        }

        /**
         * The least-squares map of `count` rows (u, v, x, y) of `pairs`, (u, v) to (x, y); null if they do not
         * determine one. Sums are in the same order as in Python's `lattices`, for the same bits.
         */
        fun fit(pairs: DoubleArray, count: Int): Homography? {
            val mean = DoubleArray(4)
            for (i in 0 until 4 * count) mean[i % 4] += pairs[i]
            for (k in mean.indices) mean[k] /= count.toDouble()
            val (mu, mv, mx, my) = mean
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
            val h = solve(normal) ?: return null
            // Undo the scaling and centring: x = size · x' + mx, u' = u - mu.
            val all = doubleArrayOf(
                size * h[0] + mx * h[6], size * h[1] + mx * h[7], size * h[2] + mx,
                size * h[3] + my * h[6], size * h[4] + my * h[7], size * h[5] + my,
                h[6], h[7], 1.0,
            )
            for (r in 0..2) all[3 * r + 2] = all[3 * r + 2] - all[3 * r] * mu - all[3 * r + 1] * mv
            return Homography(all)
        }

        /** Gaussian elimination with partial pivoting; null if a pivot is practically 0. */
        private fun solve(m: Array<DoubleArray>): DoubleArray? {
            val n = m.size
            for (i in 0 until n) {
                var pivot = i
                for (r in i + 1 until n) if (abs(m[r][i]) > abs(m[pivot][i])) pivot = r
                m[i] = m[pivot].also { m[pivot] = m[i] }
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
}
