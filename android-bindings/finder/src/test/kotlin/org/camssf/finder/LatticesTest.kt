package org.camssf.finder

import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.abs
import kotlin.math.cos
import kotlin.math.hypot
import kotlin.math.sin
import kotlin.math.sqrt

/** Patches that were drawn, as blobs and as lattices. */
class LatticesTest {
    private class Patch(val x: Double, val y: Double, val wide: Double = 20.0, val high: Double = wide)

    private val blobs = Blobs()
    private val lattices = Lattices(blobs)

    /** Bright on dark, borders as light as the part of the pixel that they cover. */
    private fun search(patches: List<Patch>, width: Int = 640, height: Int = 480): List<BlobLattice> {
        val light = FloatArray(width * height) { 0.05f }
        fun cover(pixel: Int, middle: Double, size: Double) =
            (minOf(pixel + 0.5, middle + size / 2) - maxOf(pixel - 0.5, middle - size / 2)).coerceIn(0.0, 1.0)
        for (patch in patches) {
            for (y in (patch.y - patch.high).toInt()..(patch.y + patch.high).toInt()) {
                for (x in (patch.x - patch.wide).toInt()..(patch.x + patch.wide).toInt()) {
                    if (x !in 0 until width || y !in 0 until height) continue
                    val part = cover(x, patch.x, patch.wide) * cover(y, patch.y, patch.high)
                    light[y * width + x] = maxOf(light[y * width + x], (0.05 + 0.95 * part).toFloat())
                }
            }
        }
        blobs.find(Codes().also { it.read(Picture.light(listOf(light), width, height)) })
        return lattices.find()
    }

    private fun grid(
        columns: Int,
        rows: Int,
        pitch: Double = 26.0,
        x: Double = 100.0,
        y: Double = 80.0,
        size: Double = 20.0,
        without: Set<Pair<Int, Int>> = emptySet(),
    ) = (0 until rows).flatMap { j -> (0 until columns).map { it to j } }.filter { it !in without }
        .map { (i, j) -> Patch(x + pitch * i, y + pitch * j, size) }

    /** Each blob at most a quarter of a px from where the map says, and of the patch that lies there. */
    private fun assertFits(lattice: BlobLattice, patches: List<Patch>, off: Double = 0.25) {
        assertEquals(patches.size, lattice.size)
        assertEquals(lattice.size, (0 until lattice.size).map { lattice.u[it] to lattice.v[it] }.toSet().size)
        val order = (0 until lattice.size).map { 1000 * lattice.u[it] + lattice.v[it] }
        assertEquals(order.sorted(), order)
        for (i in 0 until lattice.size) {
            val (u, v) = lattice.u[i].toDouble() to lattice.v[i].toDouble()
            val (x, y) = lattice.map.x(u, v) to lattice.map.y(u, v)
            assertTrue(hypot(x - blobs.x[lattice.blob[i]], y - blobs.y[lattice.blob[i]]) < off)
            assertTrue(patches.any { hypot(it.x - blobs.x[lattice.blob[i]], it.y - blobs.y[lattice.blob[i]]) < 0.25 })
        }
    }

    @Test
    fun `a blob has its patch's middle, area and second moments`() {
        search(listOf(Patch(100.0, 80.0, 21.0, 15.0), Patch(300.0, 200.0, 9.0), Patch(500.0, 300.0, 35.0, 13.0)))
        assertEquals(3, blobs.size)
        val sizes = listOf(9.0 to 9.0, 21.0 to 15.0, 35.0 to 13.0)
        for ((wide, high) in sizes) {
            val i = (0..2).single { abs(blobs.area[it] - wide * high) < 1.0 }
            assertEquals(wide * wide / 12, blobs.xx[i], 0.02 * wide * wide)
            assertEquals(high * high / 12, blobs.yy[i], 0.02 * high * high)
            assertEquals(0.0, blobs.xy[i], 0.5)
            assertEquals(blobs.xx[i] * blobs.yy[i] - blobs.xy[i] * blobs.xy[i], blobs.det[i], 1e-9)
        }
    }

    /** Sixteen pixels at least; a twentieth of the picture at most; three and a half times as long as wide. */
    @Test
    fun `what is too small, too large or too long is no blob`() {
        fun count(vararg patches: Patch) = search(patches.toList(), 200, 160).let { blobs.size }
        assertEquals(1, count(Patch(50.5, 50.5, 4.0)))
        assertEquals(0, count(Patch(50.5, 51.0, 4.0, 3.0)))
        assertEquals(1, count(Patch(100.0, 80.0, 39.0)))
        assertEquals(0, count(Patch(100.0, 80.0, 41.0)))
        assertEquals(1, count(Patch(100.0, 80.0, 39.0, 13.0)))
        assertEquals(0, count(Patch(100.0, 80.0, 55.0, 13.0)))
        // Two that touch at an angle are no parallelogram.
        assertEquals(0, count(Patch(60.0, 80.0, 24.0, 8.0), Patch(52.0, 92.0, 8.0, 24.0)))
    }

    @Test
    fun `patches side by side are one lattice`() {
        for ((columns, rows) in listOf(6 to 4, 4 to 6, 14 to 10, 4 to 2)) {
            val patches = grid(columns, rows)
            assertFits(search(patches).single(), patches)
        }
        assertEquals(0, search(grid(4, 2, without = setOf(3 to 1))).size, "seven are too few")
        assertEquals(0, search(grid(9, 1)).size, "one row fixes no plane")
    }

    /** Seen from the side, the farther rows are smaller and nearer to each other. */
    @Test
    fun `a tilted lattice is one, and runs clockwise`() {
        val patches = (0..3).flatMap { j ->
            (0..5).map { i ->
                val w = 1 + 0.08 * j
                Patch(150 + (40.0 * i - 100) / w, 60 + 45.0 * j / w, 30 / w, 30 / w * 0.9)
            }
        }
        val found = search(patches).single()
        assertFits(found, patches, 1.5)
        val h = found.map
        val (x, y) = h.x(0.0, 0.0) to h.y(0.0, 0.0)
        val (px, py) = h.x(1.0, 0.0) - x to h.y(1.0, 0.0) - y
        val (qx, qy) = h.x(0.0, 1.0) - x to h.y(0.0, 1.0) - y
        assertTrue(px * qy - py * qx > 0)
    }

    @Test
    fun `one missing row is bridged, two part a lattice`() {
        fun gap(rows: Set<Int>) = (0..5).flatMap { i -> rows.map { i to it } }.toSet()
        val one = grid(6, 8, without = gap(setOf(3)))
        val bridged = search(one)
        assertEquals(42, bridged[0].size)
        val two = search(grid(6, 8, without = gap(setOf(3, 4))))
        assertEquals(listOf(18, 18), two.map { it.size })
        // The larger part is found, wherever it lies.
        assertEquals(24, search(grid(6, 8, without = gap(setOf(2, 3))))[0].size)
        assertEquals(24, search(grid(6, 8, without = gap(setOf(4, 5))))[0].size)
    }

    /** Off by more than an eighth of a pitch, or of another size than its place expects. */
    @Test
    fun `what lies beside its place or has another size is left out`() {
        val holes = setOf(2 to 1)
        fun with(patch: Patch) = search(grid(6, 4, 30.0, without = holes) + patch).maxOf { it.size }
        val (x, y) = 100 + 60.0 to 80 + 30.0
        assertEquals(24, with(Patch(x + 2, y)))
        assertEquals(24, with(Patch(x, y - 2.5)))
        assertEquals(23, with(Patch(x + 4.5, y)))
        assertEquals(23, with(Patch(x, y - 4.5)))
        assertEquals(24, with(Patch(x, y, 16.0)))
        assertEquals(23, with(Patch(x, y, 13.0)))
        assertEquals(24, with(Patch(x, y, 25.0)))
    }

    /** Distances are told in a patch's own size: edges of 0.52 to 1 pitch. */
    @Test
    fun `patches too far from each other are no lattice`() {
        assertEquals(24, search(grid(6, 4, 36.0, size = 20.0)).single().size)
        assertEquals(0, search(grid(6, 4, 41.0, size = 20.0)).size)
    }

    /** Square patches whose columns lie farther apart than their rows: up to 1.3 times. */
    @Test
    fun `steps of very unlike lengths are no lattice`() {
        fun stretched(across: Double, down: Double) = search(
            (0..3).flatMap { j -> (0..5).map { Patch(100 + across * it, 80 + down * j, 21.0) } },
        ).size
        assertEquals(1, stretched(36.0, 29.0))
        assertEquals(1, stretched(29.0, 36.0))
        assertEquals(0, stretched(40.0, 27.0))
        assertEquals(0, stretched(27.0, 40.0))
    }

    @Test
    fun `steps that are far from square are no lattice`() {
        fun sheared(shear: Double) = search(
            (0..3).flatMap { j -> (0..5).map { Patch(100 + 30.0 * it + shear * 30 * j, 80 + 30.0 * j, 20.0) } },
        ).size
        assertEquals(1, sheared(0.0))
        assertEquals(1, sheared(0.3))
        assertEquals(1, sheared(-0.3))
        assertEquals(0, sheared(0.5))
        assertEquals(0, sheared(-0.5))
    }

    @Test
    fun `two lattices are two, that with more patches first`() {
        val few = grid(4, 3, 22.0, 60.0, 60.0, 17.0)
        val many = grid(6, 4, 34.0, 300.0, 240.0, 27.0)
        for (both in listOf(few + many, many + few)) {
            val found = search(both)
            assertEquals(listOf(24, 12), found.map { it.size })
        }
        val swapped = search(grid(6, 4, 22.0, 60.0, 60.0, 17.0) + grid(4, 3, 34.0, 300.0, 240.0, 27.0))
        assertEquals(listOf(24, 12), swapped.map { it.size })
    }

    @Test
    fun `a search forgets the last picture`() {
        search(grid(14, 10))
        val patches = grid(4, 3, x = 300.0)
        assertFits(search(patches).single(), patches)
        assertEquals(0, search(emptyList()).size)
    }

    /** A parallelogram that a linear map (a, b, c, d) and a shift make of a square with this middle and edge. */
    private inner class Square(val x: Double, val y: Double, val edge: Double = 20.0) {
        fun add(map: DoubleArray) {
            val (a, b, c, d) = map
            val variance = edge * edge / 12
            val i = blobs.size++
            blobs.x[i] = 320 + a * x + b * y
            blobs.y[i] = 240 + c * x + d * y
            blobs.area[i] = edge * edge * abs(a * d - b * c)
            blobs.xx[i] = variance * (a * a + b * b)
            blobs.xy[i] = variance * (a * c + b * d)
            blobs.yy[i] = variance * (c * c + d * d)
            blobs.det[i] = blobs.xx[i] * blobs.yy[i] - blobs.xy[i] * blobs.xy[i]
        }
    }

    /** Turned by every angle, stretched, sheared, mirrored. */
    private val linear = (0 until 360 step 25).flatMap { turn ->
        val (c, s) = cos(Math.toRadians(turn.toDouble())) to sin(Math.toRadians(turn.toDouble()))
        listOf(
            doubleArrayOf(c, -s, s, c),
            doubleArrayOf(1.4 * c, -0.6 * s, 1.4 * s, 0.6 * c),
            doubleArrayOf(c + 0.5 * s, 0.5 * c - s, s, c),
            doubleArrayOf(c, s, s, -c),
        )
    }

    /** 6 × 4 squares; each pitch along x and y, and how far each row is shifted against the last. */
    private fun squares(
        across: Double,
        down: Double = across,
        shift: Double = 0.0,
        edge: (Int) -> Double = { 20.0 },
    ) = (0..23).map { Square(across * (it % 6) + shift * (it / 6), down * (it / 6), edge(it % 6 + it / 6)) }

    private fun sizes(squares: List<Square>, map: DoubleArray): List<Int> {
        blobs.size = 0
        squares.forEach { it.add(map) }
        val found = lattices.find()
        for (lattice in found) {
            for (i in 0 until lattice.size) {
                val (u, v) = lattice.u[i].toDouble() to lattice.v[i].toDouble()
                assertEquals(blobs.x[lattice.blob[i]], lattice.map.x(u, v), 1e-6)
                assertEquals(blobs.y[lattice.blob[i]], lattice.map.y(u, v), 1e-6)
            }
        }
        return found.map { it.size }
    }

    /** Distances and angles are told in a blob's own moments, so a linear map moves no limit of finder.json. */
    @Test
    fun `a lattice is the same from wherever it is seen`() {
        val limits = FinderFile.limits
        val nearest = 20 * sqrt(limits.neighbour[0] / 12)
        val farthest = 20 * sqrt(limits.neighbour[1] / 12)
        val longer = 28 * sqrt(limits.lengths)
        val shift = 24 * limits.cosine / sqrt(1 - limits.cosine * limits.cosine)
        val larger = 20 / sqrt(limits.sizes[0])
        fun unlike(ratio: Double) = { place: Int -> if (place % 2 == 0) 20.0 else ratio * larger }
        val whole = listOf(24)
        for (map in linear) {
            assertEquals(whole, sizes(squares(1.01 * nearest), map))
            assertTrue(sizes(squares(0.99 * nearest), map) != whole)
            assertEquals(whole, sizes(squares(0.99 * farthest), map))
            assertEquals(emptyList<Int>(), sizes(squares(1.01 * farthest), map))
            assertEquals(whole, sizes(squares(0.99 * longer, 28.0), map))
            assertTrue(sizes(squares(1.01 * longer, 28.0), map) != whole)
            assertEquals(whole, sizes(squares(24.0, shift = 0.98 * shift), map))
            assertTrue(sizes(squares(24.0, shift = 1.02 * shift), map) != whole)
            assertEquals(whole, sizes(squares(28.0, edge = unlike(0.99)), map))
            assertTrue(sizes(squares(28.0, edge = unlike(1.01)), map) != whole)
        }
    }
}
