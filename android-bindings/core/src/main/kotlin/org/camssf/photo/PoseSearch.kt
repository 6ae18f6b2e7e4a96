package org.camssf.photo

import org.camssf.InvalidArgument
import org.camssf.Refusal
import org.camssf.Rules
import org.camssf.spectra.ChartLayout
import kotlin.math.abs
import kotlin.math.hypot
import kotlin.math.max
import kotlin.math.sqrt

/** The orientation of a lattice that fits the patch colours best, and its score. */
private class Match(val corners: DoubleArray, val score: Double, val mirrored: Boolean)

/**
 * Computes the pose from four rough corners: the colours give the orientation, the printed borders the exact
 * position.
 *
 * @param expected (n, 3) signals that [Agreement] predicts for the table.
 * @param corners (4, 2) px, convex and inside the photo.
 */
internal class PoseSearch(
    private val photo: Reading,
    private val layout: ChartLayout,
    private val expected: DoubleArray,
    private val corners: DoubleArray,
) {
    private val view = ChartView.of(
        photo,
        Rules.shipped.whole("pose.patch_pixels") * max(layout.columns, layout.rows),
        photo.facts.clipped(ChartPose.region(Corners.of(*corners))),
    )

    fun pose(): ChartPose {
        // Make the corners clockwise as seen, so that only a chart that is really mirrored counts as mirrored.
        val around = if (Lattice.area(corners) > 0) corners else DoubleArray(8) { corners[6 - it + 2 * (it % 2)] }
        val start = starts(around).map { name(lattice(view.fromMosaic(it))) }.reduce { best, next ->
            if (next.score > best.score) next else best
        }
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
        if (found.score < ACCEPT_BY_HAND) {
            throw Refusal.of(
                "chart_not_found.by_hand", "file" to photo.facts.name, value = found.score,
                threshold = ACCEPT_BY_HAND,
            )
        }
        if (found.mirrored) {
            throw Refusal.of("chart_not_found.mirrored", "file" to photo.facts.name, "score" to found.score)
        }
        return finished(view.toMosaic(found.corners), lattice.side, found.score, notes)
    }

    /**
     * Corners (4, 2) of the block of patches that the four points may mean, clockwise: either side may run along the
     * columns, and where the layout has fiducials, the points may be these, from any of them.
     */
    private fun starts(around: DoubleArray): List<DoubleArray> {
        val corners = listOf(0, 1).map { from(around, it) }
        if (layout.fiducials.isEmpty()) return corners
        val block = Lattice.block(layout, doubleArrayOf(layout.sideX, layout.sideY))
        return corners + (0..3).mapNotNull { Homography.of(layout.fiducials, from(around, it))?.map(block) }
    }

    private fun finished(corners: DoubleArray, side: DoubleArray, score: Double, notes: List<String>): ChartPose {
        val map = Homography.of(Lattice.block(layout, side), corners)!!
        return ChartPose(
            layout.name,
            corners,
            Lattice(layout, map, side, 0.0).quads(),
            Corners.of(*corners).quarterTurns,
            "by hand",
            score.coerceIn(0.0, 1.0),
            notes,
        )
    }

    private fun lattice(corners: DoubleArray): Lattice = Lattice.of(layout, corners)
        ?: throw InvalidArgument("The corners do not go around a convex quadrilateral.", Corners.ADVICE)

    /** Largest displacement of a corner, in patch pitches of the lattice before. */
    private fun moved(now: DoubleArray, before: DoubleArray): Double {
        val pitch = sqrt(abs(Lattice.area(before)) / (layout.columns * layout.rows))
        return (0..3).maxOf { hypot(now[2 * it] - before[2 * it], now[2 * it + 1] - before[2 * it + 1]) } / pitch
    }

    /**
     * Determines from the colours whether the lattice is upside down or mirrored. For quarter turns the caller tries
     * two lattices.
     */
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
        val ACCEPT_BY_HAND get() = Rules.shipped.number("pose.accept")
        val NEAR get() = Rules.shipped.number("pose.near")
        val LOCKED get() = Rules.shipped.number("pose.locked")
        val SPAN = DoubleArray(Rules.shipped.whole("pose.spots")).also { places ->
            val step = Rules.shipped.number("pose.spot_step")
            for (i in places.indices) places[i] = -(places.size / 2) * step + i * step
        }

        /** `points` (4, 2), starting with the one at `first`. */
        fun from(points: DoubleArray, first: Int): DoubleArray = DoubleArray(8) { points[(it + 2 * first) % 8] }
    }
}
