package org.camssf.photo

import org.camssf.ChartNotFound
import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.spectra.ChartLayout
import org.camssf.spectra.ChartTable
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertFalse
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import kotlin.math.exp

/** The parts that a pose is found with, each by a closed form. */
class PoseTest {
    private val square = doubleArrayOf(0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0)
    private val leaning = doubleArrayOf(10.0, 20.0, 110.0, 30.0, 95.0, 90.0, 15.0, 80.0)

    @Test
    fun `a map of four points to four maps them, and back`() {
        val map = Homography.of(square, leaning)!!
        assertArrayEquals(leaning, map.map(square), 1e-9)
        assertArrayEquals(square, map.inverse()!!.map(leaning), 1e-9)
        assertEquals(110.0, map.x(1.0, 0.0), 1e-9)
        assertEquals(30.0, map.y(1.0, 0.0), 1e-9)
        val there = map * map.inverse()!!
        assertArrayEquals(leaning, there.map(leaning), 1e-9)
        // Straight lines stay straight: the diagonals cross where the middle goes.
        val middle = map.map(doubleArrayOf(0.5, 0.5))
        fun side(a: Int, b: Int) = (leaning[2 * b] - leaning[2 * a]) * (middle[1] - leaning[2 * a + 1]) -
            (leaning[2 * b + 1] - leaning[2 * a + 1]) * (middle[0] - leaning[2 * a])
        assertEquals(0.0, side(0, 2), 1e-9)
        assertEquals(0.0, side(1, 3), 1e-9)
    }

    @Test
    fun `what flattens the plane has no way back`() {
        assertNull(Homography(doubleArrayOf(1.0, 2.0, 0.0, 2.0, 4.0, 0.0, 0.0, 0.0, 1.0)).inverse())
        assertNull(Homography(DoubleArray(9) { Double.NaN }).inverse())
        assertNull(Homography.of(doubleArrayOf(0.0, 0.0, 1.0, 0.0, 2.0, 0.0, 3.0, 0.0), square))
    }

    @Test
    fun `convex is what turns one way at every corner`() {
        assertTrue(Lattice.convex(leaning))
        assertTrue(Lattice.convex(DoubleArray(8) { leaning[6 - it + 2 * (it % 2)] }))
        assertFalse(Lattice.convex(doubleArrayOf(0.0, 0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0)), "crossed")
        for (corner in 0..3) {
            for (into in listOf(0.0, 0.1)) {
                // A corner on, or behind, the line between its neighbours.
                val dented = square.copyOf()
                dented[2 * corner] = if (square[2 * corner] == 0.0) 0.5 + into else 0.5 - into
                dented[2 * corner + 1] = if (square[2 * corner + 1] == 0.0) 0.5 + into else 0.5 - into
                assertFalse(Lattice.convex(dented))
                assertFalse(Lattice.convex(DoubleArray(8) { dented[6 - it + 2 * (it % 2)] }))
            }
        }
    }

    @Test
    fun `the area is positive where corners run clockwise as seen`() {
        val wide = doubleArrayOf(2.0, 3.0, 5.0, 3.0, 5.0, 5.0, 2.0, 5.0)
        assertEquals(6.0, Lattice.area(wide))
        assertEquals(-6.0, Lattice.area(DoubleArray(8) { wide[6 - it + 2 * (it % 2)] }))
    }

    private val layout = ChartLayout.of("classic24")!!

    @Test
    fun `a lattice has its patches where its corners say`() {
        val corners = doubleArrayOf(100.0, 50.0, 400.0, 50.0, 400.0, 250.0, 100.0, 250.0)
        val lattice = Lattice.of(layout, corners)!!
        assertArrayEquals(corners, lattice.corners(), 1e-9)
        val quads = lattice.quads()
        assertEquals(8 * 24, quads.size)
        assertArrayEquals(doubleArrayOf(100.0, 50.0), quads.copyOfRange(0, 2), 1e-9)
        assertArrayEquals(doubleArrayOf(400.0, 50.0), quads.copyOfRange(8 * 5 + 2, 8 * 5 + 4), 1e-9)
        assertArrayEquals(doubleArrayOf(400.0, 250.0), quads.copyOfRange(8 * 23 + 4, 8 * 23 + 6), 1e-9)
        // Edges are the layout's share of the distance of centres.
        fun centre(patch: Int, axis: Int) = (0..3).sumOf { quads[8 * patch + 2 * it + axis] } / 4
        assertEquals(layout.sideX, (quads[2] - quads[0]) / (centre(1, 0) - centre(0, 0)), 1e-9)
        assertEquals(layout.sideY, (quads[7] - quads[1]) / (centre(6, 1) - centre(0, 1)), 1e-9)
        assertNull(Lattice.of(layout, doubleArrayOf(0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0)))
    }

    /** Bright patches of the layout's size on black, drawn with soft edges. */
    private fun drawn(width: Int, height: Int, lattice: Lattice): DoubleArray {
        val back = lattice.map.inverse()!!
        return DoubleArray(width * height) { at ->
            val (x, y) = at % width + 0.0 to at / width + 0.0
            val (u, v) = back.x(x, y) to back.y(x, y)
            val (i, j) = Math.rint(u) to Math.rint(v)
            val inside = i >= 0 && i < layout.columns && j >= 0 && j < layout.rows
            fun soft(off: Double, side: Double) = 1 / (1 + exp((kotlin.math.abs(off) - side / 2) * 60))
            if (inside) soft(u - i, lattice.side[0]) * soft(v - j, lattice.side[1]) else 0.0
        }
    }

    @Test
    fun `rough corners are moved to the borders of the patches`() {
        val truth = Lattice.of(layout, doubleArrayOf(40.0, 30.0, 260.0, 36.0, 256.0, 184.0, 36.0, 180.0))!!
        val image = drawn(300, 220, truth)
        val off = doubleArrayOf(6.0, -4.0, -5.0, 5.0, 4.0, 3.0, -3.0, 6.0)
        val rough = Lattice.of(layout, DoubleArray(8) { truth.corners()[it] + off[it] })!!
        val found = rough.refine(image, 300, 220)!!
        assertArrayEquals(truth.corners(), found.corners(), 0.5)
        assertArrayEquals(truth.side, found.side, 0.02)
        assertEquals(1.0, found.locked)
        // Without borders the lattice is lost.
        assertNull(rough.refine(DoubleArray(300 * 220), 300, 220))
        assertNull(rough.refine(DoubleArray(300 * 220) { 1.0 }, 300, 220))
    }

    /** A block that reaches beyond the picture is placed by the borders that are seen. */
    @Test
    fun `patches outside the picture have no say`() {
        val truth = Lattice.of(layout, doubleArrayOf(-20.0, 30.0, 200.0, 30.0, 200.0, 180.0, -20.0, 180.0))!!
        val image = drawn(240, 220, truth)
        val rough = Lattice.of(layout, DoubleArray(8) { truth.corners()[it] + if (it % 2 == 0) 3.0 else -3.0 })!!
        val found = rough.refine(image, 240, 220)!!
        assertArrayEquals(truth.corners(), found.corners(), 1.0)
        assertTrue(found.locked > 0.7 && found.locked < 1.0, "${found.locked}")
    }

    @Test
    fun `colours agree whatever the cast and the exposure`() {
        val expected = DoubleArray(12) { 0.1 + 0.07 * (it * 5 % 12) }
        val cast = DoubleArray(12) { expected[it] * listOf(300.0, 900.0, 20.0)[it % 3] }
        assertEquals(1.0, Agreement.of(cast, expected), 1e-12)
        assertEquals(-1.0, Agreement.of(DoubleArray(12) { 1 / expected[it] }, expected), 1e-9)
        assertEquals(0.0, Agreement.of(DoubleArray(12) { 5.0 }, expected))
        assertEquals(0.0, Agreement.of(DoubleArray(12), expected))
    }

    /** Lightness against, chroma alike: with 4 Σ l² = 16 and 8 Σ c² twice as much as Σ l². */
    @Test
    fun `chroma counts double`() {
        val (light, chroma) = doubleArrayOf(1.0, 1.0, -1.0, -1.0) to doubleArrayOf(0.5, -0.5, 0.5, -0.5)
        fun colours(sign: Int) = DoubleArray(12) { exp(sign * light[it / 3] + chroma[it / 3] * (1 - it % 3)) }
        assertEquals((8.0 - 4.0) / (8.0 + 4.0), Agreement.of(colours(1), colours(-1)), 1e-9)
    }

    @Test
    fun `below a five-hundredth of the largest all is the same black`() {
        val expected = DoubleArray(12) { 0.1 + 0.07 * (it * 5 % 12) }
        val light = DoubleArray(12) { 100 * expected[it] + 10 }
        fun with(dark: Double) = Agreement.of(light.copyOf().also { it[4] = dark }, expected)
        val most = light.max()
        assertEquals(with(2e-3 * most), with(-7.0))
        assertEquals(with(2e-3 * most), with(1e-3 * most))
        assertTrue(with(4e-3 * most) != with(2e-3 * most))
    }

    /** A chart of one patch, of this reflectance on the grid. */
    private fun table(reflectance: DoubleArray) =
        ChartTable("one", "one", layout, listOf("a"), Grid.wavelengths.values, reflectance, DoubleArray(1), 0, "test")

    @Test
    fun `the plain camera's channels fall to a half 45 nm from their middles`() {
        fun seen(nm: Int): DoubleArray {
            val line = DoubleArray(Grid.SIZE) { if (Grid.wavelengths[it] == nm.toDouble()) 1.0 else 0.0 }
            return table(line).genericSignals()
        }
        for ((channel, middle) in listOf(600, 540, 455).withIndex()) {
            val most = seen(middle)[channel]
            assertEquals(0.5, seen(middle + 45)[channel] / most, 1e-12)
            assertEquals(0.5, seen(middle - 45)[channel] / most, 1e-12)
            assertEquals(1.0 / 16, seen(middle + 90)[channel] / most, 1e-12)
        }
        val grey = table(DoubleArray(Grid.SIZE) { 0.4 })
        assertArrayEquals(DoubleArray(3) { 0.4 }, grey.genericSignals(), 1e-12)
    }

    private fun mosaic(width: Int, height: Int, cfa: String = "RGGB", sample: (Int, Int) -> Int) = Mosaic(
        Mosaic.Origin("a.dng"), width, height, Region(0, 0, width, height),
        ShortArray(width * height) { sample(it % width, it / width).toShort() },
        Mosaic.Sensor(cfa, doubleArrayOf(10.0, 20.0, 30.0, 40.0), 1000.0),
    )

    @Test
    fun `a view is the mean of its cells, above black`() {
        val photo = mosaic(40, 24, "GBRG") { x, y -> 100 * (x % 2 + 2 * (y % 2)) + 500 + x / 2 + y / 2 }
        val small = ChartView.of(Whole(photo), 100, Region(4, 6, 24, 18))
        assertEquals(listOf(10, 6, 2), listOf(small.width, small.height, small.step))
        for (at in 0 until 60) {
            val level = 500 + 2 + at % 10 + 3 + at / 10
            assertEquals(level + 200 - 30f, small.colours[3 * at])
            assertEquals((level - 10 + level + 300 - 40) / 2f, small.colours[3 * at + 1])
            assertEquals(level + 100 - 20f, small.colours[3 * at + 2])
        }
        // Three cells a pixel; what is left over is not seen.
        val large = ChartView.of(Whole(photo), 5, Region(4, 6, 25, 18))
        assertEquals(listOf(5, 3, 4), listOf(large.width, large.height, large.step))
        val tiny = ChartView.of(Whole(photo), 4, Region(4, 6, 24, 18))
        assertEquals(listOf(3, 2, 6), listOf(tiny.width, tiny.height, tiny.step))
        assertEquals(500 + 3 + 4 + 200 - 30f, tiny.colours[0])
        assertEquals(500 + 6 + 7 + 200 - 30f, tiny.colours[3 * 4])
        val error = assertThrows(InvalidArgument::class.java) { ChartView.of(Whole(photo), 9, Region(4, 6, 5, 18)) }
        assertEquals("The corners leave no picture.", error.message)
        assertThrows(InvalidArgument::class.java) { ChartView.of(Whole(photo), 9, Region(4, 6, 24, 7)) }
    }

    @Test
    fun `a pixel of the view is the middle of its samples`() {
        val view = ChartView.of(Whole(mosaic(40, 24) { _, _ -> 100 }), 4, Region(4, 6, 24, 18))
        assertArrayEquals(doubleArrayOf(6.5, 8.5, 12.5, 20.5), view.toMosaic(doubleArrayOf(0.0, 0.0, 1.0, 2.0)))
        assertArrayEquals(doubleArrayOf(0.0, 0.0, 1.0, 2.0), view.fromMosaic(doubleArrayOf(6.5, 8.5, 12.5, 20.5)))
    }

    @Test
    fun `brightness is the sum of the channels' roots, by their own highlights`() {
        val photo = mosaic(80, 80) { x, y -> if (x < 40) 10 + 10 * (x % 2 + 2 * (y % 2)) else 410 }
        val found = ChartView.of(Whole(photo), 100, Region(0, 0, 80, 80)).brightness()
        assertEquals(0.0, found[0], 1e-6)
        assertEquals(3.0, found[39], 1e-3)
        val dark = mosaic(80, 80) { _, _ -> 5 }
        assertArrayEquals(DoubleArray(1600), ChartView.of(Whole(dark), 100, Region(0, 0, 80, 80)).brightness())
    }

    @Test
    fun `a percentile lies straight between its neighbours`() {
        val values = floatArrayOf(9f, 1f, 5f, 3f, 7f)
        val known = mapOf(0.0 to 1f, 0.25 to 3f, 0.5 to 5f, 0.6 to 5.8f, 0.7 to 6.6f, 0.98 to 8.84f, 1.0 to 9f)
        for ((share, value) in known) {
            assertEquals(value, ChartView.percentile(values, share), 1e-6f)
        }
        assertEquals(4f, ChartView.percentile(floatArrayOf(4f), 0.98))
    }

    @Test
    fun `the part around the corners is 15 per cent and 8 px wider`() {
        val region = ChartPose.region(Corners.of(100.0, 50.0, 200.0, 60.0, 190.0, 90.0, 110.0, 85.0))
        assertEquals(Region(76, 36, 223, 104), region)
        val corner = ChartPose.region(Corners.of(10.0, 5.0, 30.0, 5.0, 30.0, 25.0, 10.0, 25.0))
        assertEquals(Region(0, 0, 41, 36), corner)
        assertEquals(Region(0, 0, 1, 1), ChartPose.region(Corners.of(*DoubleArray(8) { -50.0 })))
    }

    private val chart = ChartTable.read("classic24")

    private fun refused(photo: Mosaic, vararg corners: Double) =
        assertThrows(Exception::class.java) { ChartPose.refine(photo, Corners.of(*corners), chart) }

    @Test
    fun `a photo has 64 px to each side, and corners lie in it`() {
        fun corners(right: Double, bottom: Double) = doubleArrayOf(0.0, 0.0, right, 0.0, right, bottom, 0.0, bottom)
        for ((width, height) in listOf(63 to 64, 64 to 63)) {
            val small = refused(mosaic(width, height) { _, _ -> 100 }, *corners(60.0, 60.0)) as ChartNotFound
            assertEquals("a.dng: the photo has only $width × $height px.", small.message)
            assertEquals(63.0 to 64.0, small.value to small.threshold)
        }
        val plain = mosaic(70, 64) { _, _ -> 100 }
        val grey = refused(plain, *corners(69.0, 63.0)) as ChartNotFound
        assertTrue("do not agree with the chart" in grey.message, grey.message)
        assertEquals(0.0, grey.value!!, 1e-9)
        assertEquals(0.6, grey.threshold)
        for (wrong in listOf(corners(69.1, 63.0), corners(69.0, 63.1), corners(60.0, 60.0).also { it[0] = -0.1 })) {
            val outside = refused(plain, *wrong)
            assertEquals("A corner lies outside a.dng, a photo of 70 × 64 px.", outside.message)
        }
        val crossed = refused(plain, 5.0, 5.0, 50.0, 50.0, 50.0, 5.0, 5.0, 50.0) as InvalidArgument
        assertEquals("The corners do not go around a convex quadrilateral.", crossed.message)
    }

    @Test
    fun `a table that fits no layout is refused`() {
        fun table(layout: String, patches: Int) = ChartTable(
            "odd", "odd table", ChartLayout.of(layout)!!, chart.patches.take(patches), chart.wavelengths,
            chart.reflectance, chart.sharedTolerance, 18, "test",
        )
        val photo = mosaic(70, 64) { _, _ -> 100 }
        val corners = Corners.of(5.0, 5.0, 60.0, 5.0, 60.0, 50.0, 5.0, 50.0)
        for (odd in listOf(table("sg140", 24), table("classic24", 23))) {
            val error = assertThrows(InvalidArgument::class.java) { ChartPose.refine(photo, corners, odd) }
            assertEquals("The chart table 'odd table' does not fit the layout ${odd.layout.name}.", error.message)
        }
    }

    @Test
    fun `a pose tells its corners and patches as points`() {
        val quads = DoubleArray(16) { it + 0.5 }
        val pose = ChartPose("classic24", leaning, quads, 3, "by hand", 0.9, listOf("a note"))
        assertEquals(Corners.of(*leaning), pose.corners)
        assertEquals(listOf(Corners.of(*quads.copyOf(8)), Corners.of(*quads.copyOfRange(8, 16))), pose.patches)
        assertArrayEquals(quads, pose.sharedQuads)
        assertEquals(listOf("a note"), pose.notes)
    }
}
