package org.camssf.photo

import org.camssf.ChartNotFound
import org.camssf.InvalidArgument
import org.camssf.fixed
import org.camssf.spectra.ChartLayout
import org.camssf.spectra.ChartTable
import kotlin.math.PI
import kotlin.math.abs
import kotlin.math.atan2
import kotlin.math.hypot
import kotlin.math.max
import kotlin.math.min
import kotlin.math.roundToInt
import kotlin.math.sqrt

/**
 * Where the chart lies.
 *
 * Points are x, y in pixels of the active area, where the centre of the first sample is (0, 0). Corners run top left,
 * top right, bottom right, bottom left **of the chart**, not of the photo.
 *
 * @property layout name of the [ChartLayout].
 * @property corners (4, 2) outer corners of the block of patches (outer borders of the corner patches).
 * @property quads (n, 4, 2) corners of each patch, on its borders, in the chart's reading order.
 * @property quarterTurns how often 90° clockwise turns the chart as photographed from upright: 0 to 3.
 * @property method "detected" or "by hand".
 * @property score agreement with the chart's own colours, 0 to 1 (correlation).
 * @property notes what the user should know.
 */
public class ChartPose internal constructor(
    public val layout: String,
    public val corners: DoubleArray,
    public val quads: DoubleArray,
    public val quarterTurns: Int,
    public val method: String,
    public val score: Double,
    public val notes: List<String>,
) {
    public companion object {
        /** Correlation with the table's colours from which a grid of patches is taken for the chart. */
        private const val ACCEPT = 0.6

        /** How far a corner may move, in pitches. */
        private const val NEAR = 0.55

        /** Share of patch borders that must lie where the lattice says. */
        private const val LOCKED = 0.6
        private const val SMALLEST = 64
        private const val ADVICE =
            "Give four points x, y in pixels of the photo, one after the other around the block of patches."

        /**
         * The pose from four rough corners (taps, a viewfinder's overlay): turned by the colours, moved to the printed
         * borders where these lie near, else kept, which `notes` says. The same rule as Python's
         * `find_chart(mosaic, table, corners=...)`.
         *
         * @param mosaic the photo of the chart; its region must hold the part that [region] names.
         * @param corners (4, 2) outer corners of the block of patches, one after the other around it from any of them,
         *   px of the active area, off by half a patch at most.
         * @throws ChartNotFound the colours inside the corners do not agree with the chart, or it is mirrored.
         * @throws InvalidArgument the corners are no convex quadrilateral in the photo.
         */
        @JvmStatic
        public fun refine(mosaic: Mosaic, corners: DoubleArray, chart: ChartTable): ChartPose {
            val layout = ChartLayout.of(chart.layout)
            if (layout == null || chart.patches.size != layout.columns * layout.rows) {
                throw InvalidArgument(
                    "The chart table '${chart.table}' fits no layout that camssf knows.",
                    "Use another.",
                )
            }
            if (min(mosaic.width, mosaic.height) < SMALLEST) {
                throw ChartNotFound(
                    "${mosaic.name}: the photo has only ${mosaic.width} × ${mosaic.height} px.",
                    "Give the RAW photo of the whole sensor.",
                    min(mosaic.width, mosaic.height).toDouble(),
                    SMALLEST.toDouble(),
                )
            }
            check(corners, mosaic)
            return Search(mosaic, layout, Agreement.expected(chart), corners).pose()
        }

        /**
         * The part of a photo that [refine] looks at and that patches are measured in; it may reach beyond the photo.
         *
         * @throws InvalidArgument the corners are not four finite points.
         */
        @JvmStatic
        public fun region(corners: DoubleArray): Region {
            check(corners)
            val (left, right) = reach(corners, 0)
            val (top, bottom) = reach(corners, 1)
            return Region(left, top, right, bottom)
        }

        /** First and one behind the last pixel of the corners' box, 15 % and 8 px wider. */
        private fun reach(corners: DoubleArray, axis: Int): Pair<Int, Int> {
            val places = List(4) { corners[2 * it + axis] }
            val margin = 0.15 * (places.max() - places.min()) + 8
            return max(places.min() - margin, 0.0).toInt() / 2 * 2 to max(places.max() + margin, 1.0).toInt()
        }

        private fun check(corners: DoubleArray) {
            if (corners.size != 8) {
                throw InvalidArgument("The corners are ${corners.size} numbers, not four points of two.", ADVICE)
            }
            if (!corners.all {
                    it.isFinite()
                }
            ) {
                throw InvalidArgument("A number of the corners is not finite.", ADVICE)
            }
        }

        private fun check(corners: DoubleArray, photo: Mosaic) {
            check(corners)
            val last = intArrayOf(photo.width - 1, photo.height - 1)
            if (corners.indices.any { corners[it] < 0 || corners[it] > last[it % 2] }) {
                throw outside(photo.name, photo.width, photo.height)
            }
            if (!Lattice.convex(corners)) {
                throw InvalidArgument("The corners do not go around a convex quadrilateral.", ADVICE)
            }
        }

        /** `points` (4, 2) beginning with the one at `first`. */
        private fun from(points: DoubleArray, first: Int): DoubleArray =
            DoubleArray(8) { points[(it + 2 * first) % 8] }
    }

    /** A lattice named by its colours. */
    private class Match(val corners: DoubleArray, val score: Double, val mirrored: Boolean)

    private class Search(
        private val mosaic: Mosaic,
        private val layout: ChartLayout,
        private val expected: DoubleArray,
        private val corners: DoubleArray,
    ) {
        private val view = ChartView.of(
            mosaic,
            40 * max(layout.columns, layout.rows),
            region(corners).let {
                Region(it.left, it.top, min(it.right, mosaic.width), min(it.bottom, mosaic.height))
            },
        )

        fun pose(): ChartPose {
            // Clockwise as seen, so that only a real mirror mirrors.
            val around = if (Lattice.area(corners) > 0) corners else DoubleArray(8) { corners[6 - it + 2 * (it % 2)] }
            val tries = listOf(0, 1).map { name(lattice(view.fromMosaic(from(around, it)))) }
            val start = if (tries[1].score > tries[0].score) tries[1] else tries[0]
            var found = start
            var lattice = lattice(start.corners)
            val refined = lattice.refine(view.brightness(), view.width, view.height)
            val notes = ArrayList<String>()
            if (refined != null && refined.locked >= LOCKED && moved(refined.corners(), start.corners) <= NEAR) {
                lattice = refined
                val named = name(refined)
                found = Match(refined.corners(), named.score, start.mirrored)
            } else {
                notes += "No patch borders lie near the corners given by hand: they were kept as they are."
            }
            if (found.score < ACCEPT) {
                throw ChartNotFound(
                    "${mosaic.name}: the colours inside the corners given by hand do not agree with the chart.",
                    "Give the outer corners of the block of patches, one after the other, and check the chart's name.",
                    found.score,
                    ACCEPT,
                )
            }
            if (found.mirrored) {
                throw ChartNotFound(
                    "${mosaic.name}: the chart is mirrored (its colours agree as seen in a mirror, " +
                        "${fixed(found.score, 2)}).",
                    "Photograph the chart itself, not its mirror image.",
                )
            }
            return finished(view.toMosaic(found.corners), lattice.side, found.score, notes)
        }

        private fun finished(corners: DoubleArray, side: DoubleArray, score: Double, notes: List<String>): ChartPose {
            val map = Homography.of(Lattice.block(layout, side), corners)!!
            val across = DoubleArray(2) { corners[2 + it] + corners[4 + it] - corners[it] - corners[6 + it] }
            val turns = Math.rint(atan2(across[1], across[0]) * (180 / PI) / 90).roundToInt()
            return ChartPose(
                layout.name,
                corners,
                Lattice(layout, map, side, 0.0).quads(),
                (turns % 4 + 4) % 4,
                "by hand",
                score.coerceIn(0.0, 1.0),
                notes,
            )
        }

        private fun lattice(corners: DoubleArray): Lattice = Lattice.of(layout, corners)
            ?: throw InvalidArgument("The corners do not go around a convex quadrilateral.", ADVICE)

        /** Largest way of a corner, in pitches of where it came from. */
        private fun moved(now: DoubleArray, before: DoubleArray): Double {
            val pitch = sqrt(abs(Lattice.area(before)) / (layout.columns * layout.rows))
            return (0..3).maxOf { hypot(now[2 * it] - before[2 * it], now[2 * it + 1] - before[2 * it + 1]) } / pitch
        }

        /** Which way up the lattice is, by its colours. A quarter turn is another lattice: the caller tries both. */
        private fun name(lattice: Lattice): Match {
            val n = layout.columns * layout.rows
            val seen = DoubleArray(3 * n)
            for (i in 0 until n) {
                for (dy in SPAN) {
                    for (dx in SPAN) {
                        val u = i % layout.columns + dx * lattice.side[0]
                        val v = i / layout.columns + dy * lattice.side[1]
                        val x = Math.rint(lattice.map.x(u, v)).coerceIn(0.0, view.width - 1.0).toInt()
                        val y = Math.rint(lattice.map.y(u, v)).coerceIn(0.0, view.height - 1.0).toInt()
                        for (c in 0..2) seen[3 * i + c] += view.colours[3 * (y * view.width + x) + c].toDouble()
                    }
                }
            }
            for (i in seen.indices) seen[i] /= SPAN.size * SPAN.size.toDouble()
            val corners = lattice.corners()
            var best = Match(corners, -2.0, false)
            for (turned in listOf(false, true)) {
                for (mirrored in listOf(false, true)) {
                    val named = DoubleArray(3 * n) {
                        val place = if (turned) n - 1 - it / 3 else it / 3
                        val row = place / layout.columns
                        val column = place % layout.columns
                        val from = if (mirrored) layout.columns - 1 - column else column
                        seen[3 * (row * layout.columns + from) + it % 3]
                    }
                    val score = Agreement.of(named, expected)
                    if (score > best.score) best = Match(if (turned) from(corners, 2) else corners, score, mirrored)
                }
            }
            return best
        }

        private companion object {
            val SPAN = DoubleArray(5) { -0.2 + it * 0.1 }
        }
    }
}

/** A corner of the chart, or the part around it, does not lie in the photo. */
internal fun outside(name: String, width: Int, height: Int) = InvalidArgument(
    "A corner lies outside $name, a photo of $width × $height px.",
    "Give corners in pixels of the RAW photo, x from 0 to ${width - 1} and y from 0 to ${height - 1}: points on a " +
        "preview must be scaled to it, and turned back where the preview is turned.",
)
