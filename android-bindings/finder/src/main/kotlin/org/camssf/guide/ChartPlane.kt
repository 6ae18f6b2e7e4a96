package org.camssf.guide

import org.camssf.finder.Candidate
import org.camssf.photo.Homography
import org.camssf.photo.Lattice
import kotlin.math.abs
import kotlin.math.acos
import kotlin.math.hypot
import kotlin.math.max
import kotlin.math.min
import kotlin.math.sqrt

/**
 * The homography from the chart's plane to a picture: patch (column, row) is centred at (u, v) = (column, row).
 *
 * It maps the centres of the four corner patches, which do not depend on the width of the gaps.
 *
 * @param corners (4, 2) px centres of the corner patches.
 */
internal class ChartPlane private constructor(
    private val map: Homography,
    corners: DoubleArray,
    private val columns: Int,
    private val rows: Int,
) {
    private val back = map.adjugate()

    /** Mean distance of patch centres, px. */
    val pitch: Double = sqrt(abs(Lattice.area(corners)) / ((columns - 1) * (rows - 1)))

    /** Longer side of the block of patches, px: the distance between the outer centres plus one patch. */
    val longest: Double = max(
        hypot(corners[2] - corners[0], corners[3] - corners[1]),
        hypot(corners[4] - corners[6], corners[5] - corners[7]),
    ) * (columns - 0.14) / (columns - 1)

    fun x(u: Double, v: Double): Double = map.x(u, v)

    fun y(u: Double, v: Double): Double = map.y(u, v)

    /**
     * True if a pixel lies within `beyond` pitches of the block of patch centres, so that it may show the chart or
     * its frame.
     */
    fun shows(x: Int, y: Int, beyond: Double): Boolean {
        val u = back.x(x.toDouble(), y.toDouble())
        val v = back.y(x.toDouble(), y.toDouble())
        return u > -beyond && v > -beyond && u < columns - 1 + beyond && v < rows - 1 + beyond
    }

    /**
     * Distance from the chart, including its border, to the picture's nearest border, pitches; below 0 the chart is
     * cut.
     */
    fun margin(width: Int, height: Int): Double {
        val border = map.map(block(-BORDER, columns - 1 + BORDER, rows - 1 + BORDER))
        return border.indices.minOf {
            min(border[it], (if (it % 2 == 0) width else height) - 1 - border[it])
        } / pitch
    }

    /**
     * Angle between the chart's normal and the line of sight to its centre, degrees.
     *
     * @param focal focal length of the lens, px; the optical axis passes through the picture's centre.
     */
    fun tilt(width: Int, height: Int, focal: Double): Double {
        val m = map.matrix
        val cx = (width - 1) / 2.0
        val cy = (height - 1) / 2.0
        fun ray(column: Int) = doubleArrayOf(
            (m[column] - cx * m[6 + column]) / focal,
            (m[3 + column] - cy * m[6 + column]) / focal,
            m[6 + column],
        )
        val a = ray(0)
        val b = ray(1)
        val normal = doubleArrayOf(
            a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0],
        )
        val u = (columns - 1) / 2.0
        val v = (rows - 1) / 2.0
        val sight = doubleArrayOf((x(u, v) - cx) / focal, (y(u, v) - cy) / focal, 1.0)
        val cosine = abs(dot(normal, sight)) / sqrt(dot(normal, normal) * dot(sight, sight))
        return Math.toDegrees(acos(cosine.coerceAtMost(1.0)))
    }

    companion object {
        /**
         * Approximate distance from the centre of a corner patch to the end of the chart's printed border, pitches.
         */
        private const val BORDER = 0.75

        /** The plane of a candidate; null if its corner patches form no quadrilateral. */
        fun of(candidate: Candidate): ChartPlane? {
            val columns = candidate.kind.columns
            val rows = candidate.kind.rows
            val all = candidate.patches
            val centres = intArrayOf(0, columns - 1, all.size - 1, all.size - columns)
            val corners = DoubleArray(8) { all[centres[it / 2]].run { if (it % 2 == 0) x else y } }
            val map = Homography.of(block(0.0, columns - 1.0, rows - 1.0), corners) ?: return null
            return ChartPlane(map, corners, columns, rows)
        }

        /** (4, 2) corners of a rectangle whose left and top are both `low`. */
        private fun block(low: Double, right: Double, bottom: Double) =
            doubleArrayOf(low, low, right, low, right, bottom, low, bottom)

        private fun dot(a: DoubleArray, b: DoubleArray) = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    }
}
