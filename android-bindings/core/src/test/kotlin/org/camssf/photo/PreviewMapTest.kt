package org.camssf.photo

import org.camssf.InvalidArgument
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.util.Random
import kotlin.math.PI
import kotlin.math.abs
import kotlin.math.cos
import kotlin.math.sin

/** Previews of every rotation, mirrored or not, of seeded crops, zooms and views. */
class PreviewMapTest {
    private val random = Random(5)
    private val array = PreviewCrop.of(Region(0, 0, 4080, 3072))

    private class Case(val crop: PreviewCrop, val turn: Int, val mirrored: Boolean, val width: Int, val height: Int)

    private val cases = List(400) {
        val (left, top) = random.nextInt(900) to random.nextInt(900)
        val samples = Region(left, top, left + 300 + random.nextInt(2800), top + 300 + random.nextInt(1800))
        val crop = PreviewCrop.of(samples).zoomed(0.5 + 4 * random.nextDouble())
        Case(crop, it % 4 * 90, it % 8 >= 4, 50 + random.nextInt(2000), 50 + random.nextInt(2000))
    }

    private fun place(): Point = Point(-200 + 4500 * random.nextDouble(), -200 + 3500 * random.nextDouble())

    private fun maps(case: Case): List<PreviewMap> = PreviewFit.values().map {
        PreviewMap.ofView(case.crop, case.turn, case.mirrored, case.width, case.height, it)
    } + PreviewMap.ofPicture(case.crop, case.width, case.height, case.turn, case.mirrored)

    @Test
    fun `there and back again is the same place`() {
        for (case in cases) {
            for (map in maps(case)) {
                val mosaic = place()
                near(mosaic, map.toMosaic(map.fromMosaic(mosaic)), 1e-9)
                val view = Point(case.width * random.nextDouble(), case.height * random.nextDouble())
                near(view, map.fromMosaic(map.toMosaic(view)), 1e-9)
            }
        }
    }

    /** The chain one matrix after the other, with angles in place of whole numbers. */
    @Test
    fun `it is the chain of crop, turn, mirror and scale`() {
        for (case in cases) {
            for ((which, map) in maps(case).withIndex()) {
                val crop = case.crop
                val turned = if (case.turn % 180 == 0) crop.width to crop.height else crop.height to crop.width
                val both = listOf(case.width / turned.first, case.height / turned.second)
                val scales = when (which) {
                    PreviewFit.INSIDE.ordinal -> List(2) { both.min() }
                    PreviewFit.FILL.ordinal -> List(2) { both.max() }
                    else -> both
                }
                val centre = shift(-(crop.left + crop.width / 2), -(crop.top + crop.height / 2))
                val angle = case.turn * PI / 180 // y runs down: this turns clockwise as seen
                val turn = arrayOf(
                    doubleArrayOf(cos(angle), -sin(angle), 0.0),
                    doubleArrayOf(sin(angle), cos(angle), 0.0),
                    doubleArrayOf(0.0, 0.0, 1.0),
                )
                val mirror = scale(if (case.mirrored) -1.0 else 1.0, 1.0)
                val origin = if (which == 3) 0.5 else 0.0
                val window = shift(case.width / 2.0 - origin, case.height / 2.0 - origin)
                val all =
                    product(window, product(scale(scales[0], scales[1]), product(mirror, product(turn, centre))))
                val mosaic = place()
                val found = map.fromMosaic(mosaic)
                val wanted = Point(
                    all[0][0] * mosaic.x + all[0][1] * mosaic.y + all[0][2],
                    all[1][0] * mosaic.x + all[1][1] * mosaic.y + all[1][2],
                )
                near(wanted, found, 1e-8)
                assertEquals(scales.average(), map.scale, 1e-12 * scales.average()) // a scale where both agree
            }
        }
    }

    /** By hand: a phone upright, its sensor lying; what the sensor sees top left is shown top right. */
    @Test
    fun `a quarter turn brings the sensor's top left to the top right`() {
        val map = PreviewMap.ofView(array, 90, false, 1536, 2040)
        near(Point(1536.0, 0.0), map.fromMosaic(Point(-0.5, -0.5)), 1e-9)
        near(Point(1536.0, 2040.0), map.fromMosaic(Point(4079.5, -0.5)), 1e-9)
        near(Point(0.0, 0.0), map.fromMosaic(Point(-0.5, 3071.5)), 1e-9)
        near(Point(1535.75, 0.25), map.fromMosaic(Point(0.0, 0.0)), 1e-9)
        val front = PreviewMap.ofView(array, 90, true, 1536, 2040)
        near(Point(0.0, 0.0), front.fromMosaic(Point(-0.5, -0.5)), 1e-9)
        val flat = PreviewMap.ofView(array, 180, false, 4080, 3072)
        near(Point(4080.0, 3072.0), flat.fromMosaic(Point(-0.5, -0.5)), 1e-9)
        val left = PreviewMap.ofView(array, 270, false, 3072, 4080)
        near(Point(0.0, 4080.0), left.fromMosaic(Point(-0.5, -0.5)), 1e-9)
    }

    @Test
    fun `a frame of every fourth sample counts pixels by their centres`() {
        val map = PreviewMap.ofPicture(array, 1020, 768)
        near(Point(1.5, 1.5), map.toMosaic(Point(0.0, 0.0)), 1e-9)
        near(Point(5.5, 1.5), map.toMosaic(Point(1.0, 0.0)), 1e-9)
        assertEquals(0.25, map.scale, 1e-12)
    }

    @Test
    fun `a stream of another shape lacks two ends, and a zoom keeps the middle`() {
        assertEquals(PreviewCrop(-0.5, 388.0, 4079.5, 2683.0), array.shapedAs(1920, 1080).rounded())
        assertEquals(PreviewCrop(503.5, -0.5, 3575.5, 3071.5), array.shapedAs(500, 500).rounded())
        assertEquals(array, array.shapedAs(4080, 3072).rounded())
        assertEquals(PreviewCrop(1019.5, 767.5, 3059.5, 2303.5), array.zoomed(2.0).rounded())
        assertEquals(array, array.zoomed(1.0))
    }

    @Test
    fun `inside shows all, fill cuts`() {
        val inside = PreviewMap.ofView(array, 0, false, 1000, 3000, PreviewFit.INSIDE)
        val fill = PreviewMap.ofView(array, 0, false, 1000, 3000)
        for (corner in listOf(Point(-0.5, -0.5), Point(4079.5, 3071.5))) {
            assertTrue(inside.fromMosaic(corner).let { it.x in -1e-9..1000 + 1e-9 && it.y in 0.0..3000.0 })
            assertTrue(fill.fromMosaic(corner).let { it.y in -1e-9..3000 + 1e-9 && it.x !in 0.0..1000.0 })
        }
    }

    /** CameraX: an opposite camera's picture is turned by sensor less screen, a front camera's by their sum. */
    @Test
    fun `screens that are turned`() {
        assertEquals(listOf(90, 0, 270, 180), listOf(0, 90, 180, 270).map { PreviewMap.rotationOf(90, it, false) })
        assertEquals(listOf(270, 0, 90, 180), listOf(0, 90, 180, 270).map { PreviewMap.rotationOf(270, it, true) })
    }

    @Test
    fun `corners keep their names, taps find their order`() {
        val chart = Corners.of(600.0, 500.0, 2500.0, 620.0, 2400.0, 1900.0, 580.0, 1750.0)
        for (case in cases) {
            val map = PreviewMap.ofView(case.crop, case.turn, case.mirrored, case.width, case.height)
            val seen = map.fromMosaic(chart)
            near(map.fromMosaic(chart.topRight), seen.topRight, 0.0)
            near(map.fromMosaic(chart.bottomLeft), seen.bottomLeft, 0.0)
            chart.points.zip(map.toMosaic(seen).points).forEach { (a, b) -> near(a, b, 1e-9) }
            val taps = Corners.around(seen.points.shuffled(random).map { map.toMosaic(it) })
            val best = (0..3).minOf { turn -> chart.points.zip(taps.turned(turn).points).maxOf { distance(it) } }
            assertTrue(best < 1e-9, "off by $best")
        }
    }

    @Test
    fun `what is no preview is refused`() {
        for (wrong in listOf<() -> Any>(
            { PreviewMap.ofView(array, 45, false, 10, 10) },
            { PreviewMap.ofView(array, 90, false, 0, 10) },
            { PreviewMap.ofPicture(array, 10, -1) },
            { PreviewMap.rotationOf(-90, 0, false) },
            { PreviewCrop(3.0, 0.0, 3.0, 5.0) },
            { PreviewCrop(0.0, Double.NaN, 3.0, 5.0) },
            { array.zoomed(0.0) },
            { array.zoomed(Double.POSITIVE_INFINITY) },
            { array.shapedAs(0, 9) },
            { Corners.around(listOf(Point(0.0, 0.0))) },
        )) {
            assertThrows(InvalidArgument::class.java) { wrong() }
        }
    }

    private fun near(wanted: Point, found: Point, most: Double) =
        assertTrue(distance(wanted to found) <= most, "$found, not $wanted")

    private fun distance(pair: Pair<Point, Point>) =
        maxOf(abs(pair.first.x - pair.second.x), abs(pair.first.y - pair.second.y))

    private fun PreviewCrop.rounded(): PreviewCrop {
        fun round(value: Double) = Math.rint(value * 1e6) / 1e6
        return PreviewCrop(round(left), round(top), round(right), round(bottom))
    }

    private fun shift(x: Double, y: Double) =
        arrayOf(doubleArrayOf(1.0, 0.0, x), doubleArrayOf(0.0, 1.0, y), doubleArrayOf(0.0, 0.0, 1.0))

    private fun scale(x: Double, y: Double) =
        arrayOf(doubleArrayOf(x, 0.0, 0.0), doubleArrayOf(0.0, y, 0.0), doubleArrayOf(0.0, 0.0, 1.0))

    private fun product(a: Array<DoubleArray>, b: Array<DoubleArray>) =
        Array(3) { i -> DoubleArray(3) { j -> (0..2).sumOf { a[i][it] * b[it][j] } } }
}
