package org.camssf.guide

import org.camssf.finder.Candidate
import org.camssf.photo.Point
import kotlin.math.acos
import kotlin.math.hypot
import kotlin.math.sqrt

/**
 * The homography from the chart's plane to a picture: patch (column, row) is centred at (u, v) = (column, row).
 *
 * It maps the centres of the four corner patches, which do not depend on the width of the gaps.
 */
internal class ChartPlane private constructor(private val m: DoubleArray, val columns: Int, val rows: Int) {
    private val inverse = adjugate(m)

    fun x(u: Double, v: Double): Double = (m[0] * u + m[1] * v + m[2]) / (m[6] * u + m[7] * v + m[8])

    fun y(u: Double, v: Double): Double = (m[3] * u + m[4] * v + m[5]) / (m[6] * u + m[7] * v + m[8])

    /**
     * True if a pixel lies within `beyond` pitches of the block of patch centres, so that it may show the chart or
     * its frame.
     */
    fun shows(x: Int, y: Int, beyond: Double): Boolean {
        val depth = inverse[6] * x + inverse[7] * y + inverse[8]
        val u = (inverse[0] * x + inverse[1] * y + inverse[2]) / depth
        val v = (inverse[3] * x + inverse[4] * y + inverse[5]) / depth
        return u > -beyond && v > -beyond && u < columns - 1 + beyond && v < rows - 1 + beyond
    }

    /** Mean distance of patch centres, px. */
    val pitch: Double by lazy {
        val (w, h) = columns - 1.0 to rows - 1.0
        val corners = listOf(0.0 to 0.0, w to 0.0, w to h, 0.0 to h).map {
            x(it.first, it.second) to
                y(it.first, it.second)
        }
        var twice = 0.0
        for (i in 0..3) {
            val (a, b) = corners[i] to corners[(i + 1) % 4]
            twice += a.first * b.second - b.first * a.second
        }
        sqrt(kotlin.math.abs(twice) / 2 / (w * h))
    }

    /** Longer side of the block of patches, px: the distance between the outer centres plus one patch. */
    val longest: Double by lazy {
        val (w, h) = columns - 1.0 to rows - 1.0
        fun side(u: Double, v: Double, p: Double, q: Double) = hypot(x(p, q) - x(u, v), y(p, q) - y(u, v))
        maxOf(side(0.0, 0.0, w, 0.0), side(0.0, h, w, h)) * (columns - 0.14) / w
    }

    /**
     * Distance from the chart, including its border, to the picture's nearest border, pitches; below 0 the chart is
     * cut.
     */
    fun margin(width: Int, height: Int): Double {
        val (low, right, bottom) = Triple(-BORDER, columns - 1 + BORDER, rows - 1 + BORDER)
        val corners = listOf(low to low, right to low, right to bottom, low to bottom)
        return corners.minOf { (u, v) ->
            minOf(minOf(x(u, v), width - 1 - x(u, v)), minOf(y(u, v), height - 1 - y(u, v)))
        } / pitch
    }

    /**
     * Angle between the chart's normal and the line of sight to its centre, degrees.
     *
     * @param focal focal length of the lens, px; the optical axis passes through the picture's centre.
     */
    fun tilt(width: Int, height: Int, focal: Double): Double {
        val (cx, cy) = (width - 1) / 2.0 to (height - 1) / 2.0
        fun ray(column: Int) = doubleArrayOf(
            (m[column] - cx * m[6 + column]) / focal,
            (m[3 + column] - cy * m[6 + column]) / focal,
            m[6 + column],
        )
        val (a, b) = ray(0) to ray(1)
        val normal = doubleArrayOf(
            a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0],
        )
        val (u, v) = (columns - 1) / 2.0 to (rows - 1) / 2.0
        val sight = doubleArrayOf((x(u, v) - cx) / focal, (y(u, v) - cy) / focal, 1.0)
        val cosine = kotlin.math.abs(dot(normal, sight)) / sqrt(dot(normal, normal) * dot(sight, sight))
        return Math.toDegrees(acos(cosine.coerceAtMost(1.0)))
    }

    companion object {
        /**
         * Approximate distance from the centre of a corner patch to the end of the chart's printed border, pitches.
         */
        private const val BORDER = 0.75

        /** The plane of a candidate; null if its corner patches form no quadrilateral. */
        fun of(candidate: Candidate): ChartPlane? {
            val (columns, rows) = candidate.kind.columns to candidate.kind.rows
            val all = candidate.patches
            val corners = listOf(all[0], all[columns - 1], all[all.size - 1], all[all.size - columns])
            val square = square(corners) ?: return null
            // From pitches to the unit square: divide by the number of steps.
            val m = DoubleArray(9) { square[it] / doubleArrayOf(columns - 1.0, rows - 1.0, 1.0)[it % 3] }
            return ChartPlane(m, columns, rows)
        }

        /** The projective map of (0, 0), (1, 0), (1, 1), (0, 1) to four points (Heckbert 1989, section 2.2.3). */
        fun square(points: List<Point>): DoubleArray? {
            val (a, b, c, d) = points
            val (dx1, dy1) = b.x - c.x to b.y - c.y
            val (dx2, dy2) = d.x - c.x to d.y - c.y
            val (sx, sy) = a.x - b.x + c.x - d.x to a.y - b.y + c.y - d.y
            val area = dx1 * dy2 - dx2 * dy1
            if (!area.isFinite() || kotlin.math.abs(area) < 1.0) return null
            val g = (sx * dy2 - dx2 * sy) / area
            val h = (dx1 * sy - sx * dy1) / area
            return doubleArrayOf(
                b.x - a.x + g * b.x, d.x - a.x + h * d.x, a.x,
                b.y - a.y + g * b.y, d.y - a.y + h * d.y, a.y,
                g, h, 1.0,
            )
        }

        /** The inverse up to its scale, which has no effect in a projective map. */
        private fun adjugate(m: DoubleArray): DoubleArray = doubleArrayOf(
            m[4] * m[8] - m[5] * m[7], m[2] * m[7] - m[1] * m[8], m[1] * m[5] - m[2] * m[4],
            m[5] * m[6] - m[3] * m[8], m[0] * m[8] - m[2] * m[6], m[2] * m[3] - m[0] * m[5],
            m[3] * m[7] - m[4] * m[6], m[1] * m[6] - m[0] * m[7], m[0] * m[4] - m[1] * m[3],
        )

        private fun dot(a: DoubleArray, b: DoubleArray) = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    }
}
