package org.camssf.photo

import org.camssf.InvalidArgument
import kotlin.math.PI
import kotlin.math.atan2
import kotlin.math.roundToInt

/**
 * A place in a photo.
 *
 * @property x px of the active area; the centre of the first sample is 0.
 * @property y px of the active area, downwards.
 */
public data class Point(public val x: Double, public val y: Double)

/**
 * Four corners, one after the other around a block of patches. The names are the **chart's**, not the photo's: where the
 * chart lies upside down, its top left is the photo's bottom right. Of rough corners (taps) any may come first, camssf
 * finds out which it is; of a [ChartPose] the names are true.
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
    init {
        if (!points.all { it.x.isFinite() && it.y.isFinite() }) {
            throw InvalidArgument("A number of the corners is not finite.", ADVICE)
        }
    }

    /** The four of them, from the top left on. */
    public val points: List<Point> get() = listOf(topLeft, topRight, bottomRight, bottomLeft)

    /** How often 90° clockwise turns the chart as photographed from upright: 0 to 3. */
    public val quarterTurns: Int
        get() {
            val acrossX = topRight.x + bottomRight.x - topLeft.x - bottomLeft.x
            val acrossY = topRight.y + bottomRight.y - topLeft.y - bottomLeft.y
            val turns = Math.rint(atan2(acrossY, acrossX) * (180 / PI) / 90).roundToInt()
            return (turns % 4 + 4) % 4
        }

    /** The same four, beginning with another: the top left of `turned(1)` is this one's top right. */
    public fun turned(quarters: Int): Corners {
        val all = points
        val (a, b, c, d) = List(4) { all[((it + quarters) % 4 + 4) % 4] }
        return Corners(a, b, c, d)
    }

    /** x, y of the four, eight numbers; a new array at each call. */
    public fun toArray(): DoubleArray = DoubleArray(8) { if (it % 2 == 0) points[it / 2].x else points[it / 2].y }

    public companion object {
        internal const val ADVICE =
            "Give four points x, y in pixels of the photo, one after the other around the block of patches."

        /**
         * From four taps in whatever order: clockwise about their middle, as seen in the photo, beginning with any. Bring
         * taps to the mosaic first ([PreviewMap.toMosaic]): a mirrored preview runs the other way round.
         *
         * @throws InvalidArgument another count, or a number that is not finite.
         */
        @JvmStatic
        public fun around(taps: List<Point>): Corners {
            if (taps.size != 4) throw InvalidArgument("${taps.size} taps are not four corners.", ADVICE)
            val (x, y) = taps.sumOf { it.x } / taps.size to taps.sumOf { it.y } / taps.size
            val (a, b, c, d) = taps.sortedBy { atan2(it.y - y, it.x - x) }
            return Corners(a, b, c, d)
        }

        /**
         * From x, y of four points, eight numbers.
         *
         * @throws InvalidArgument another count, or a number that is not finite.
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
