package org.camssf.photo

import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Test
import kotlin.math.abs

/** Homographies by what they do to points. */
class HomographyTest {
    private val tilted = Homography(doubleArrayOf(30.0, 4.0, 200.0, -3.0, 26.0, 150.0, 0.01, -0.02, 1.0))

    private fun pairs(places: List<Pair<Int, Int>>, of: (Int, Int) -> Pair<Double, Double>) =
        places.flatMap { (u, v) ->
            of(u, v).let { listOf(u.toDouble(), v.toDouble(), it.first, it.second) }
        }.toDoubleArray()

    private val grid = (0..5).flatMap { u -> (0..3).map { v -> u to v } }

    private fun seen(u: Int, v: Int) =
        tilted.x(u.toDouble(), v.toDouble()) to tilted.y(u.toDouble(), v.toDouble())

    @Test
    fun `points that a map has moved tell the map`() {
        assertEquals(200.0 to 150.0, seen(0, 0))
        assertEquals((200 + 60 + 4.0) / (1 + 0.02 - 0.02), seen(2, 1).first, 1e-12)
        for (places in listOf(grid, grid.take(8), listOf(0 to 0, 5 to 0, 5 to 3, 0 to 3))) {
            val found = Homography.fit(pairs(places, ::seen), places.size)!!
            assertArrayEquals(tilted.matrix, DoubleArray(9) { found.matrix[it] / found.matrix[8] }, 1e-6)
        }
        // What lies behind the count is not looked at.
        val more = pairs(grid, ::seen) + doubleArrayOf(2.0, 2.0, 999.0, -999.0)
        val found = Homography.fit(more, grid.size)!!
        assertArrayEquals(tilted.matrix, DoubleArray(9) { found.matrix[it] / found.matrix[8] }, 1e-6)
    }

    /** Errors that no shift, scale or tilt can follow stay; the middle of opposite errors does not move. */
    @Test
    fun `opposite errors at one place cancel`() {
        val places = grid + grid
        var at = 0
        val noisy = pairs(places) { u, v ->
            val sign = if (at++ < grid.size) 1 else -1
            u * 10.0 + sign * 0.5 to v * 10.0 - sign * 0.25
        }
        val found = Homography.fit(noisy, places.size)!!
        for ((u, v) in grid) {
            assertEquals(10.0 * u, found.x(u.toDouble(), v.toDouble()), 1e-2)
            assertEquals(10.0 * v, found.y(u.toDouble(), v.toDouble()), 1e-2)
        }
    }

    @Test
    fun `points in one place or on one line tell none`() {
        assertNull(Homography.fit(pairs(grid) { _, _ -> 7.0 to 9.0 }, grid.size))
        assertNull(Homography.fit(pairs((0..9).map { it to 0 }) { u, _ -> 3.0 * u to 1.0 }, 10))
        assertNull(Homography.fit(pairs(listOf(0 to 0, 1 to 0, 0 to 1)) { u, v -> u * 1.0 to v * 1.0 }, 3))
    }

    @Test
    fun `the way back`() {
        val back = tilted.adjugate()
        for ((u, v) in grid) {
            val (x, y) = seen(u, v)
            assertEquals(u.toDouble(), back.x(x, y), 1e-9)
            assertEquals(v.toDouble(), back.y(x, y), 1e-9)
        }
    }

    @Test
    fun `a pitch squared covers what its small parts cover`() {
        val h = 1e-4
        for ((u, v) in grid) {
            val corners = listOf(-h to -h, h to -h, h to h, -h to h).map { (du, dv) ->
                tilted.x(u + du, v + dv) to tilted.y(u + du, v + dv)
            }
            val area = corners.indices.sumOf { i ->
                val (a, b) = corners[i] to corners[(i + 1) % 4]
                a.first * b.second - b.first * a.second
            } / 2
            val found = tilted.area(u.toDouble(), v.toDouble())
            assertEquals(abs(area) / (4 * h * h), found, 1e-4 * found)
        }
        assertEquals(1e-9, Homography(doubleArrayOf(1.0, 2.0, 0.0, 2.0, 4.0, 0.0, 0.0, 0.0, 1.0)).area(0.0, 0.0))
    }
}
