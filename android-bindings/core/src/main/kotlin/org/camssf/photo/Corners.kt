package org.camssf.photo

import org.camssf.InvalidArgument
import org.camssf.frozen
import kotlin.math.PI
import kotlin.math.atan2
import kotlin.math.roundToInt

/**
 * A position in a photo.
 *
 * @property x px of the active area; the centre of the first sample is 0.
 * @property y px of the active area, downwards.
 */
public data class Point(public val x: Double, public val y: Double)

/**
 * Four corners in order around a block of patches. The names are the **chart's**, not the photo's: if the chart is
 * upside down, its top left is the photo's bottom right. Rough corners (taps) may start at any corner; camssf
 * determines which one it is. In a [ChartPose] the names are correct.
 *
 * @property topLeft px.
 * @property topRight px.
 * @property bottomRight px.
 * @property bottomLeft px.
 * @throws InvalidArgument a number is not finite.
 */
public data class Corners(
    public val topLeft: Point,
    public val topRight: Point,
    public val bottomRight: Point,
    public val bottomLeft: Point,
) {
    /** The four corners, starting at the top left. */
    public val points: List<Point> = listOf(topLeft, topRight, bottomRight, bottomLeft).frozen()

    init {
        if (!points.all { it.x.isFinite() && it.y.isFinite() }) {
            throw InvalidArgument("A number of the corners is not finite.", ADVICE)
        }
    }

    /** Number of 90° clockwise turns of the chart as photographed, relative to upright: 0 to 3. */
    public val quarterTurns: Int
        get() {
            val acrossX = topRight.x + bottomRight.x - topLeft.x - bottomLeft.x
            val acrossY = topRight.y + bottomRight.y - topLeft.y - bottomLeft.y
            val turns = Math.rint(atan2(acrossY, acrossX) * (180 / PI) / 90).roundToInt()
            return (turns % 4 + 4) % 4
        }

    /** The same four corners, starting at another one: the top left of `turned(1)` is this object's top right. */
    public fun turned(quarters: Int): Corners {
        val all = points
        val (a, b, c, d) = List(4) { all[((it + quarters) % 4 + 4) % 4] }
        return Corners(a, b, c, d)
    }

    /** x, y of the four corners, eight numbers; a new array at each call. */
    public fun toArray(): DoubleArray = DoubleArray(8) { if (it % 2 == 0) points[it / 2].x else points[it / 2].y }

    public companion object {
        internal const val ADVICE =
            "Give four points x, y in pixels of the photo, one after the other around the block of patches."

        /**
         * Sorts four taps in any order clockwise around their centre, as seen in the photo; the first corner is
         * arbitrary. Convert taps to the mosaic first ([PreviewMap.toMosaic]), because a mirrored preview reverses
         * the order.
         *
         * @throws InvalidArgument not exactly four taps, or a number that is not finite.
         */
        @JvmStatic
        public fun around(taps: List<Point>): Corners {
            if (taps.size != 4) throw InvalidArgument("${taps.size} taps are not four corners.", ADVICE)
            val (x, y) = taps.sumOf { it.x } / taps.size to taps.sumOf { it.y } / taps.size
            val (a, b, c, d) = taps.sortedBy { atan2(it.y - y, it.x - x) }
            return Corners(a, b, c, d)
        }

        /**
         * Creates corners from x, y of four points, eight numbers.
         *
         * @throws InvalidArgument not exactly eight numbers, or a number that is not finite.
         */
        @JvmStatic
        public fun of(vararg numbers: Double): Corners {
            if (numbers.size != 8) {
                throw InvalidArgument("The corners are ${numbers.size} numbers, not four points of two.", ADVICE)
            }
            val (a, b, c, d) = List(4) { Point(numbers[2 * it], numbers[2 * it + 1]) }
            return Corners(a, b, c, d)
        }
    }
}
