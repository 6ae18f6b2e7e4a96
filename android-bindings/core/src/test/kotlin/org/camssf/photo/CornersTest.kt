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
}
