package org.camssf.photo

import org.camssf.LeastSquares
import org.camssf.Rules
import org.camssf.flatten
import org.camssf.json.number
import org.camssf.median
import org.camssf.spectra.Bundled
import org.camssf.spectra.ChartLayout
import kotlin.math.abs
import kotlin.math.max
import kotlin.math.min
import kotlin.math.sqrt

/**
 * The lattice of a chart's patches in a picture. The centre of patch (column i, row j) has the lattice coordinates
 * (i, j); its borders are sx/2 and sy/2 away.
 *
 * @property map maps lattice coordinates to px.
 * @property side patch edge (sx, sy) in pitches.
 * @property locked share of borders found near their expected position, 0 to 1.
 */
internal class Lattice(val layout: ChartLayout, val map: Homography, val side: DoubleArray, val locked: Double) {
    /** (4, 2) outer corners of the block of patches, px. */
    fun corners(): DoubleArray = map.map(block(layout, side))

    /** (n, 4, 2) px corners of every patch. */
    fun quads(): DoubleArray = List(layout.columns * layout.rows) { i ->
        map.map(
            DoubleArray(8) {
                val centre = if (it % 2 == 0) i % layout.columns else i / layout.columns
                centre + SQUARE[it] * side[it % 2] / 2
            },
        )
    }.flatten()

    /**
     * Fits the lattice to the printed borders by the numbered rules of Python's `refine_corners`; null if the fit
     * fails.
     *
     * @param image (height, width) brightness on which the patches are brighter than the gaps.
     */
    fun refine(image: DoubleArray, width: Int, height: Int): Lattice? {
        var found = this
        for (window in BorderRules.windows) {
            found = found.step(Picture(image, width, height), window) ?: return null
            val moved = found.corners()
            if (!moved.all { it.isFinite() } || !convex(moved)) return null
        }
        return found
    }

    private fun step(picture: Picture, window: Double): Lattice? {
        val borders = borders(picture, window)
        if (borders.count { it.weight != 0.0 } < UNKNOWNS) return null
        val robust = DoubleArray(borders.size) { 1.0 }
        val rows = Array(borders.size) { borders[it].row() }
        var solution = DoubleArray(UNKNOWNS)
        var residual = DoubleArray(borders.size)
        val narrowest = Bundled.limits.number("narrowest")
        val widest = BorderRules.number("widest")
        val far = BorderRules.number("fit_far")
        val leastSpread = BorderRules.number("least_spread")
        repeat(BorderRules.whole("fit_rounds")) {
            val root = DoubleArray(borders.size) { sqrt(borders[it].weight * robust[it]) }
            solution = LeastSquares.solve(
                Array(borders.size) { i -> DoubleArray(UNKNOWNS) { rows[i][it] * root[i] } },
                DoubleArray(borders.size) { borders[it].right * root[it] },
            ) ?: return null
            for (j in 8..9) solution[j] = solution[j].coerceIn(narrowest, widest)
            residual = DoubleArray(borders.size) { i ->
                abs((0 until UNKNOWNS).sumOf { rows[i][it] * solution[it] } - borders[i].right)
            }
            val seen = residual.filterIndexed { i, _ -> borders[i].weight > 0 }
            val spread = max(leastSpread, 1.4826 * median(seen.toDoubleArray()))
            for (i in robust.indices) {
                val part = max(0.0, 1 - (residual[i] / (far * spread)) * (residual[i] / (far * spread)))
                robust[i] = part * part
            }
        }
        val s = solution
        val correction = Homography(doubleArrayOf(1 + s[1], s[2], s[0], s[4], 1 + s[5], s[3], s[6], s[7], 1.0))
        val back = correction.inverse() ?: return null
        val near = BorderRules.number("in_place")
        val inPlace = residual.indices.count { residual[it] < near && borders[it].weight > 0 }
        return Lattice(layout, map * back, doubleArrayOf(s[8], s[9]), inPlace.toDouble() / borders.size)
    }

    /**
     * A detected border at (u, v) in lattice coordinates. `axis` is 0 for a vertical border, `index` is its patch's
     * index along that axis, `sign` is its side, -1 or 1.
     */
    private class Border(
        val u: Double,
        val v: Double,
        val axis: Int,
        val index: Int,
        val sign: Int,
        val weight: Double,
    ) {
        private val along get() = if (axis == 0) u else v
        val right: Double get() = index - along

        fun row(): DoubleArray {
            val row = DoubleArray(UNKNOWNS)
            row[3 * axis] = 1.0
            row[3 * axis + 1] = u
            row[3 * axis + 2] = v
            row[6] = -along * u
            row[7] = -along * v
            row[8 + axis] = -sign / 2.0
            return row
        }
    }

    private class Picture(val image: DoubleArray, val width: Int, val height: Int) {
        /** Bilinear interpolation; NaN outside the picture. */
        fun at(x: Double, y: Double): Double {
            if (!(x >= 0 && x <= width - 1 && y >= 0 && y <= height - 1)) return Double.NaN
            val i = min(y.toInt(), height - 2)
            val j = min(x.toInt(), width - 2)
            val q = y - i
            val p = x - j
            val from = i * width + j
            val top = image[from] * (1 - p) + image[from + 1] * p
            val bottom = image[from + width] * (1 - p) + image[from + width + 1] * p
            return top * (1 - q) + bottom * q
        }
    }

    /** Finds the borders of all patches: rules 1 and 2. */
    private fun borders(picture: Picture, window: Double): List<Border> {
        val across = window + BorderRules.fall * BorderRules.step
        val reach = Math.rint(across / BorderRules.step).toInt() // halves to even, as Python rounds
        val offsets = DoubleArray(2 * reach + 1) { BorderRules.step * (it - reach) }
        class Found(val i: Int, val axis: Int, val sign: Int, val place: Double, val height: Double)
        val found = ArrayList<Found>()
        for (axis in 0..1) {
            for (sign in intArrayOf(-1, 1)) {
                for (i in 0 until layout.columns * layout.rows) {
                    val profile = DoubleArray(offsets.size) { profile(picture, i, axis, sign, offsets[it]) }
                    val (place, height) = border(profile, offsets, window)
                    found += Found(i, axis, sign, place, height)
                }
            }
        }
        val heights = found.map { it.height }.filter { it.isFinite() && it > 0 }
        val usual = if (heights.isEmpty()) 1.0 else median(heights.toDoubleArray())
        return found.map {
            val weight = if (it.height.isFinite() && it.height > 0) it.height / (it.height + usual) else 0.0
            val column = (it.i % layout.columns).toDouble()
            val row = (it.i / layout.columns).toDouble()
            val moved = it.sign * (side[it.axis] / 2 + it.place)
            if (it.axis == 0) {
                Border(column + moved, row, 0, it.i % layout.columns, it.sign, weight)
            } else {
                Border(column, row + moved, 1, it.i / layout.columns, it.sign, weight)
            }
        }
    }

    /** Mean over points parallel to a border of patch i, `offset` pitches outwards from it. */
    private fun profile(picture: Picture, i: Int, axis: Int, sign: Int, offset: Double): Double {
        var total = 0.0
        for (place in BorderRules.along) {
            val across = sign * (side[axis] / 2 + offset)
            val along = place * side[1 - axis]
            val u = i % layout.columns + if (axis == 0) across else along
            val v = i / layout.columns + if (axis == 0) along else across
            total += picture.at(map.x(u, v), map.y(u, v))
        }
        return total / BorderRules.along.size
    }

    /**
     * Position of the steepest fall of a profile, and its height, which is not finite if no samples were available.
     */
    private fun border(profile: DoubleArray, offsets: DoubleArray, window: Double): Pair<Double, Double> {
        val sums = DoubleArray(profile.size + 1)
        for (i in profile.indices) sums[i + 1] = sums[i] + profile[i]
        val span = BorderRules.fall
        val favour = BorderRules.number("near_favour")
        val fall = DoubleArray(profile.size - 2 * span) {
            val m = it + span
            val found = (sums[m] - sums[m - span] - sums[m + span + 1] + sums[m + 1]) / span
            if (found.isFinite()) found else Double.NEGATIVE_INFINITY
        }
        var peak = 0
        var best = Double.NEGATIVE_INFINITY
        for (k in fall.indices) {
            val t = offsets[k + span]
            val value = fall[k] * (1 - favour * (t / window) * (t / window))
            if (value > best) {
                best = value
                peak = k
            }
        }
        val height = fall[peak]
        val left = fall[max(peak - 1, 0)]
        val right = fall[min(peak + 1, fall.size - 1)]
        val bend = left - 2 * height + right
        val step = if (bend.isFinite() && bend < 0) 0.5 * (left - right) / bend else 0.0
        return offsets[peak + span] + BorderRules.step * step.coerceIn(-1.0, 1.0) to height
    }

    companion object {
        private val SQUARE = doubleArrayOf(-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0)
        private const val UNKNOWNS = 10

        /** (4, 2) outer corners of the block of patches with edges `side`, in lattice coordinates. */
        fun block(layout: ChartLayout, side: DoubleArray): DoubleArray = DoubleArray(8) {
            val last = if (it % 2 == 0) layout.columns - 1 else layout.rows - 1
            SQUARE[it] * side[it % 2] / 2 + if (SQUARE[it] > 0) last else 0
        }

        /**
         * The lattice whose block has these corners (4, 2), px, and the layout's gaps; null if they are degenerate.
         */
        fun of(layout: ChartLayout, corners: DoubleArray): Lattice? {
            val side = doubleArrayOf(layout.sideX, layout.sideY)
            val map = Homography.of(block(layout, side), corners) ?: return null
            return Lattice(layout, map, side, 0.0)
        }

        fun convex(quad: DoubleArray): Boolean {
            val turns = DoubleArray(4) { i ->
                val j = (i + 1) % 4
                val k = (i + 2) % 4
                (quad[2 * j] - quad[2 * i]) * (quad[2 * k + 1] - quad[2 * j + 1]) -
                    (quad[2 * j + 1] - quad[2 * i + 1]) * (quad[2 * k] - quad[2 * j])
            }
            return turns.all { it > 0 } || turns.all { it < 0 }
        }

        /** Signed area; positive if the corners run clockwise as seen (y down). */
        fun area(quad: DoubleArray): Double = (0..3).sumOf { i ->
            val j = (i + 1) % 4
            quad[2 * i] * quad[2 * j + 1] - quad[2 * j] * quad[2 * i + 1]
        } / 2
    }
}

/** The rules of the search for printed borders, by the names of Python's `camssf.photo.find.geometry`. */
private object BorderRules {
    fun number(name: String) = Rules.shipped.number("pose.$name")

    fun whole(name: String) = Rules.shipped.whole("pose.$name")

    /** Search distance from the expected border in each round, in pitches. */
    val windows = listOf("first", "second", "third", "last", "last").map { number("${it}_window") }

    /** Places along a border, in parts of its length. */
    val along = DoubleArray(whole("profile_places")).also { places ->
        val reach = number("profile_reach")
        for (i in places.indices) places[i] = -reach + 2 * reach * i / places.lastIndex
    }
    val step = number("profile_step")
    val fall = whole("fall_steps")
}
