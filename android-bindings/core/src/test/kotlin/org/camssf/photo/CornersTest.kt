package org.camssf.photo

import org.camssf.InvalidArgument
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Test

class CornersTest {
    private val upright = Corners.of(0.0, 0.0, 60.0, 2.0, 61.0, 40.0, 1.0, 39.0)

    @Test
    fun `points have names`() {
        assertEquals(Point(0.0, 0.0), upright.topLeft)
        assertEquals(Point(60.0, 2.0), upright.topRight)
        assertEquals(Point(61.0, 40.0), upright.bottomRight)
        assertEquals(Point(1.0, 39.0), upright.bottomLeft)
        val around = listOf(upright.topLeft, upright.topRight, upright.bottomRight, upright.bottomLeft)
        assertEquals(around, upright.points)
        assertArrayEquals(doubleArrayOf(0.0, 0.0, 60.0, 2.0, 61.0, 40.0, 1.0, 39.0), upright.toArray())
    }

    @Test
    fun `they know how the chart is turned`() {
        assertEquals(listOf(0, 1, 2, 3), (0..3).map { upright.turned(it).quarterTurns })
        assertEquals(upright.topRight, upright.turned(1).topLeft)
        assertEquals(upright, upright.turned(-1).turned(5).turned(-4))
    }

    @Test
    fun `what are no four points is refused`() {
        for (wrong in listOf(DoubleArray(6), DoubleArray(8) { if (it == 3) Double.NaN else 1.0 })) {
            assertThrows(InvalidArgument::class.java) { Corners.of(*wrong) }
        }
    }

    @Test
    fun `four taps are put in order, clockwise as seen from the left above`() {
        val wanted = upright
        val points = upright.points
        for (order in listOf(listOf(0, 1, 2, 3), listOf(2, 0, 3, 1), listOf(3, 2, 1, 0), listOf(1, 3, 0, 2))) {
            assertEquals(wanted, Corners.around(order.map { points[it] }))
        }
        // Far from the origin, too.
        val far = points.map { Point(it.x + 1000, it.y + 2000) }
        assertEquals(far, Corners.around(far.reversed()).points)
        for (count in listOf(0, 3, 5)) {
            val error = assertThrows(InvalidArgument::class.java) { Corners.around(List(count) { Point(1.0, 2.0) }) }
            assertEquals("$count taps are not four corners.", error.message)
        }
    }

    /** Where the top edge runs decides, to the nearest quarter. */
    @Test
    fun `a chart that leans is turned to the nearest quarter`() {
        fun square(degrees: Double): Corners {
            val points = listOf(-1 to -1, 1 to -1, 1 to 1, -1 to 1).flatMap { (x, y) ->
                val (c, s) = Math.cos(Math.toRadians(degrees)) to Math.sin(Math.toRadians(degrees))
                listOf(50 + 10 * (c * x - s * y), 70 + 10 * (s * x + c * y))
            }
            return Corners.of(*points.toDoubleArray())
        }
        val known = mapOf(0 to 0, 44 to 0, 46 to 1, 134 to 1, 136 to 2, 224 to 2, 226 to 3, 314 to 3, 316 to 0)
        for ((degrees, turns) in known) {
            assertEquals(turns, square(degrees.toDouble()).quarterTurns, "$degrees")
        }
    }
}
