package org.camssf.finder

import org.camssf.photo.Homography
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.abs

/** A lattice that is given, over a chart that was drawn: 24 patches, 40 px apart, about a point. */
class OrientationTest {
    private val kind = ChartKind.CLASSIC_24
    private val blobs = Blobs()
    private val orientation = Orientation(blobs)
    private val all = (0..5).flatMap { i -> (0..3).map { i to it } }

    /** The chart's patch (0, 0) stands at place (3, -2) of the lattice. */
    private fun lattice(x: Double, y: Double, seen: List<Pair<Int, Int>>): BlobLattice {
        val map = Homography(doubleArrayOf(40.0, 0.0, x - 220, 0.0, 40.0, y + 20, 0.0, 0.0, 1.0))
        val order = seen.map { (i, j) -> i + 3 to j - 2 }.sortedWith(compareBy({ it.first }, { it.second }))
        val blob = IntArray(order.size) { it }
        for ((at, place) in order.withIndex()) {
            blobs.x[at] = map.x(place.first.toDouble(), place.second.toDouble())
            blobs.y[at] = map.y(place.first.toDouble(), place.second.toDouble())
        }
        return BlobLattice(map, order.map { it.first }.toIntArray(), order.map { it.second }.toIntArray(), blob)
    }

    private fun codes(painter: Painter) = Codes().also { it.read(painter.picture()) }

    private fun orient(x: Double, y: Double, seen: List<Pair<Int, Int>> = all): Placement? =
        orientation.orient(codes(Painter().chart(x, y, 40.0)), lattice(x, y, seen), kind)

    private fun assertUpright(found: Placement?) {
        assertTrue(found!!.score > 0.99, "${found.score}")
        assertArrayEquals(IntArray(24) { it % 6 + 3 }, found.u)
        assertArrayEquals(IntArray(24) { it / 6 - 2 }, found.v)
        assertTrue(!found.mirrored)
    }

    @Test
    fun `patches are named in the chart's order`() {
        val found = orient(300.0, 250.0)
        assertUpright(found)
        assertEquals(kind, found!!.kind)
        // Nine digits: another library's logarithms must not choose.
        assertEquals(Math.rint(found.score * 1e9) / 1e9, found.score)
    }

    @Test
    fun `a chart that stands on its head or is seen in a mirror is told so`() {
        val over = codes(Painter().chart(300.0, 250.0, 40.0, 180.0))
        val head = orientation.orient(over, lattice(300.0, 250.0, all), kind)!!
        assertArrayEquals(IntArray(24) { 8 - it % 6 }, head.u)
        assertArrayEquals(IntArray(24) { 1 - it / 6 }, head.v)
        assertTrue(!head.mirrored && head.score > 0.99)
        val mirror = codes(Painter().chart(300.0, 250.0, 40.0, mirrored = true))
        val seen = orientation.orient(mirror, lattice(300.0, 250.0, all), kind)!!
        assertArrayEquals(IntArray(24) { 8 - it % 6 }, seen.u)
        assertArrayEquals(IntArray(24) { it / 6 - 2 }, seen.v)
        assertTrue(seen.mirrored && seen.score > 0.99)
    }

    /** Colours are taken up to a fifth of a pitch, 8 px, from a patch's middle, at the nearest pixel. */
    @Test
    fun `every patch must lie in the picture`() {
        val inside = listOf(107.6 to 250.0, 531.4 to 250.0, 300.0 to 67.6, 300.0 to 411.4)
        for ((x, y) in inside) assertUpright(orient(x, y))
        for ((x, y) in listOf(107.4 to 250.0, 531.6 to 250.0, 300.0 to 67.4, 300.0 to 411.6)) {
            assertTrue((orient(x, y)?.score ?: -1.0) < 0.9, "$x, $y")
        }
    }

    @Test
    fun `eleven of twenty-four patches must have been seen, anywhere on the chart`() {
        for (step in listOf(5, 7, 11)) {
            val some = List(11) { all[it * step % 24] }
            assertUpright(orient(300.0, 250.0, some))
            assertNull(orient(300.0, 250.0, some.drop(1)))
        }
        // Some at one end: the rest is looked for beyond them.
        assertUpright(orient(300.0, 250.0, all.filter { it.first < 3 }))
        assertUpright(orient(300.0, 250.0, all.filter { it.first > 2 }))
        assertUpright(orient(300.0, 250.0, all.filter { it.second > 1 }))
        assertUpright(orient(300.0, 250.0, all.filter { it.second < 2 }))
    }

    /** Of the 24 places around a chart seven may hold patches. */
    @Test
    fun `a part of a larger grid is no chart`() {
        val sides = listOf(
            (-1..6).map { it to -1 }, (-1..6).map { it to 4 }, (-1..3).map { -1 to it } + (0..3).map { 6 to it },
        )
        for (side in sides) {
            assertUpright(orient(300.0, 250.0, all + side.take(7)))
            assertTrue((orient(300.0, 250.0, all + side.take(8))?.score ?: -1.0) < 0.9)
        }
        // What lies two places away is another's.
        assertUpright(orient(300.0, 250.0, all + (-1..6).map { it to -2 }))
    }

    @Test
    fun `brightness alone has one number a patch`() {
        val painter = Painter().chart(300.0, 250.0, 40.0)
        val codes = Codes().also { it.read(Picture.luma(Plane(painter.planes[1], 640), 640, 480)) }
        assertUpright(orientation.orient(codes, lattice(300.0, 250.0, all), kind))
    }

    private fun fit(seen: List<Pair<Int, Int>>, off: Double): Pair<Homography, Int>? {
        val found = orient(300.0, 250.0)!!
        val lattice = lattice(300.0, 250.0, seen)
        // In pitches of 40 px; the third blob in the order of places.
        blobs.x[2] += 40 * off
        return orientation.fit(lattice, found)
    }

    @Test
    fun `the chart's own map is fitted without strays`() {
        val (exact, count) = fit(all, 0.0)!!
        assertEquals(24, count)
        assertEquals(200.0, exact.x(0.0, 0.0), 1e-6)
        assertEquals(310.0, exact.y(5.0, 3.0), 1e-6)
        assertEquals(400.0, exact.x(5.0, 3.0), 1e-6)
        val (straight, fewer) = fit(all, 0.07)!!
        assertEquals(23, fewer)
        for (i in 0..23) {
            assertEquals(200 + 40.0 * (i % 6), straight.x(i % 6.0, (i / 6).toDouble()), 1e-6)
            assertEquals(190 + 40.0 * (i / 6), straight.y(i % 6.0, (i / 6).toDouble()), 1e-6)
        }
        assertEquals(24, fit(all, 0.02)!!.second)
        // What is no patch of the chart has no say.
        assertEquals(24, fit(all + listOf(7 to 0, 0 to -2), 0.0)!!.second)
    }

    @Test
    fun `too few patches that lie straight are no chart`() {
        val twelve = all.filterIndexed { i, _ -> i % 2 == 0 }
        assertEquals(11, fit(twelve, 0.06)!!.second)
        assertNull(fit(twelve.drop(1), 0.06))
        assertTrue(abs(fit(twelve.drop(1), 0.0)!!.first.x(0.0, 0.0) - 200) < 1e-6)
    }
}
