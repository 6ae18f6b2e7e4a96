package org.camssf.finder

import org.camssf.photo.Agreement
import org.camssf.photo.Homography
import kotlin.math.ceil
import kotlin.math.floor
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.min
import kotlin.math.sqrt

/**
 * A placement of a chart on a lattice.
 *
 * @property score agreement with the chart's colours, -1 to 1 (correlation).
 * @property mirrored true if the colours agree with the chart seen in a mirror.
 * @property u first lattice coordinate of the patches, in the chart's order.
 * @property v second lattice coordinate of the patches, in the chart's order.
 */
internal class Placement(
    val kind: ChartKind,
    val score: Double,
    val mirrored: Boolean,
    val u: IntArray,
    val v: IntArray,
)

/** Orients lattices by their colours: which part of a lattice is a chart, and which corner is its first patch. */
internal class Orientation(private val blobs: Blobs) {
    private val limits = FinderFile.limits

    /** [Agreement.features] of every place, or ln of its level. */
    private var features = DoubleArray(0)
    private var inside = BooleanArray(0)
    private var member = BooleanArray(0)

    /** Integral image of [member] but for its first row, which cancels: number of blobs left of and above a place. */
    private var sums = IntArray(0)
    private var pairs = DoubleArray(0)
    private var offs = DoubleArray(0)
    private var sorted = DoubleArray(0)
    private val totals = IntArray(3)
    private var stepU = IntArray(0)
    private var stepV = IntArray(0)
    private var left = 0
    private var top = 0
    private var columns = 0
    private var rows = 0

    /** The placement that agrees best with the chart's colours; null if no part of the lattice can be the chart. */
    fun orient(codes: Codes, lattice: BlobLattice, kind: ChartKind): Placement? {
        reserve(kind.columns * kind.rows)
        val span = max(kind.columns, kind.rows) - 1
        left = lattice.u.min() - span
        top = lattice.v.min() - span
        columns = lattice.u.max() + span - left + 1
        rows = lattice.v.max() + span - top + 1
        count(lattice)
        look(codes, lattice.map)
        val wanted = kind.features(codes.channels)
        val last = kind.columns * kind.rows - 1
        val fewest = fewest(kind)
        val most = limits.ring * 2 * (kind.columns + kind.rows + 2)
        var best = -2.0
        var bestPlace = 0
        var bestTurn = -1
        for (way in 0..7) {
            turn(kind, way)
            // The first and the last patch are opposite corners.
            val low = min(0, stepU[last])
            val high = max(0, stepU[last])
            val above = min(0, stepV[last])
            val below = max(0, stepV[last])
            for (v in -above until rows - below) {
                for (u in -low until columns - high) {
                    val place = v * columns + u
                    val seen = members(u + low, v + above, u + high, v + below)
                    if (seen < fewest || !whole(place, last)) continue
                    if (members(u + low - 1, v + above - 1, u + high + 1, v + below + 1) - seen > most) continue
                    val score = score(place, last, wanted)
                    if (score > best) {
                        best = score
                        bestPlace = place
                        bestTurn = way
                    }
                }
            }
        }
        if (bestTurn < 0) return null
        turn(kind, bestTurn)
        return Placement(
            kind,
            best,
            bestTurn % 2 == 1,
            IntArray(last + 1) { bestPlace % columns + stepU[it] + left },
            IntArray(last + 1) { bestPlace / columns + stepV[it] + top },
        )
    }

    /**
     * The homography from chart coordinates (column, row) to px, and the number of blobs that it was fitted to; null
     * if these are too few.
     *
     * It is fitted to all blobs, and again without outliers, such as a blob that covers half a patch or two patches.
     */
    fun fit(lattice: BlobLattice, placement: Placement): Pair<Homography, Int>? {
        val kind = placement.kind
        reserve(kind.columns * kind.rows)
        var count = 0
        for (i in 0 until lattice.size) {
            val k = placement.u.indices.indexOfFirst {
                placement.u[it] == lattice.u[i] && placement.v[it] == lattice.v[i]
            }
            if (k < 0) continue
            pairs[4 * count] = (k % kind.columns).toDouble()
            pairs[4 * count + 1] = (k / kind.columns).toDouble()
            pairs[4 * count + 2] = blobs.x[lattice.blob[i]]
            pairs[4 * count + 3] = blobs.y[lattice.blob[i]]
            count++
        }
        val back = Homography.fit(pairs, count)?.adjugate() ?: return null
        for (i in 0 until count) {
            val p = back.x(pairs[4 * i + 2], pairs[4 * i + 3]) - pairs[4 * i]
            val q = back.y(pairs[4 * i + 2], pairs[4 * i + 3]) - pairs[4 * i + 1]
            offs[i] = p * p + q * q
            sorted[i] = offs[i]
        }
        sorted.sort(0, count)
        val limit = max(limits.stray * limits.stray, limits.strayMedians * limits.strayMedians * sorted[count / 2])
        var straight = 0
        for (i in 0 until count) {
            if (offs[i] > limit) continue
            pairs.copyInto(pairs, 4 * straight, 4 * i, 4 * i + 4)
            straight++
        }
        if (straight < fewest(kind)) return null
        return Homography.fit(pairs, straight)?.to(straight)
    }

    /** Makes room for so many patches; what is stored is not kept. */
    private fun reserve(patches: Int) {
        if (offs.size >= patches) return
        pairs = DoubleArray(4 * patches)
        offs = DoubleArray(patches)
        sorted = DoubleArray(patches)
        stepU = IntArray(patches)
        stepV = IntArray(patches)
    }

    /** Computes [sums], the numbers of the lattice's blobs. */
    private fun count(lattice: BlobLattice) {
        val size = columns * rows
        if (member.size < size) member = BooleanArray(size)
        if (sums.size < (columns + 1) * (rows + 1)) sums = IntArray((columns + 1) * (rows + 1))
        member.fill(false, 0, size)
        for (i in 0 until lattice.size) member[(lattice.v[i] - top) * columns + lattice.u[i] - left] = true
        for (row in 0 until rows) {
            var count = 0
            sums[(row + 1) * (columns + 1)] = 0
            for (column in 0 until columns) {
                if (member[row * columns + column]) count++
                val at = (row + 1) * (columns + 1) + column + 1
                sums[at] = sums[at - columns - 1] + count
            }
        }
    }

    /** Computes the [features] of every place, and whether it is in view. */
    private fun look(codes: Codes, map: Homography) {
        val size = columns * rows
        if (inside.size < size) inside = BooleanArray(size)
        if (features.size < size * 4) features = DoubleArray(size * 4)
        for (place in 0 until size) {
            inside[place] = sample(codes, map, place % columns + left, place / columns + top)
            if (!inside[place]) continue
            if (codes.channels == 1) {
                features[place] = log(totals[0])
                continue
            }
            val r = log(totals[0])
            val g = log(totals[1])
            val b = log(totals[2])
            val lightness = (r + g + b) / 3.0
            features[4 * place] = lightness
            features[4 * place + 1] = Agreement.CHROMA * (r - lightness)
            features[4 * place + 2] = Agreement.CHROMA * (g - lightness)
            features[4 * place + 3] = Agreement.CHROMA * (b - lightness)
        }
    }

    /** Sums the codes at the spots around a place in [totals]; false if a spot is not in view. */
    private fun sample(codes: Codes, map: Homography, u: Int, v: Int): Boolean {
        totals.fill(0)
        for (dv in limits.spots) {
            for (du in limits.spots) {
                val x = Math.rint(map.x(u + du, v + dv))
                val y = Math.rint(map.y(u + du, v + dv))
                val ahead = map.depth(u + du, v + dv) > 0.0
                if (!(ahead && x >= 0 && x <= codes.width - 1 && y >= 0 && y <= codes.height - 1)) return false
                for (c in 0 until codes.channels) {
                    totals[c] += codes.values[(c * codes.height + y.toInt()) * codes.width + x.toInt()]
                }
            }
        }
        return true
    }

    private fun log(total: Int): Double {
        val spots = limits.spots.size
        return ln(total / (spots * spots).toDouble() + limits.floor)
    }

    /** Computes the lattice steps from the first patch to each; `way` is 2 · quarter turns, plus 1 if mirrored. */
    private fun turn(kind: ChartKind, way: Int) {
        for (k in 0 until kind.columns * kind.rows) {
            var u = if (way % 2 == 1) -(k % kind.columns) else k % kind.columns
            var v = k / kind.columns
            repeat(way / 2) {
                val turned = -v
                v = u
                u = turned
            }
            stepU[k] = u
            stepV[k] = v
        }
    }

    /** Number of blobs in a rectangle of places, both ends included. */
    private fun members(left: Int, top: Int, right: Int, bottom: Int): Int {
        val stride = columns + 1
        val from = max(left, 0)
        val to = min(right, columns - 1) + 1
        val above = max(top, 0) * stride
        val below = (min(bottom, rows - 1) + 1) * stride
        return sums[below + to] - sums[below + from] - sums[above + to] + sums[above + from]
    }

    /** Place of patch k if the first one lies at `place`. */
    private fun at(place: Int, k: Int): Int = place + stepV[k] * columns + stepU[k]

    private fun whole(place: Int, last: Int): Boolean {
        for (k in 0..last) if (!inside[at(place, k)]) return false
        return true
    }

    /**
     * Correlation with the chart's colours, rounded to nine digits: differences of logarithms between libraries must
     * not decide between equal scores.
     */
    private fun score(place: Int, last: Int, wanted: DoubleArray): Double {
        val size = wanted.size / (last + 1)
        var xy = 0.0
        var xx = 0.0
        for (f in 0 until size) {
            var mean = 0.0
            for (k in 0..last) mean += features[size * at(place, k) + f]
            mean /= last + 1
            for (k in 0..last) {
                val x = features[size * at(place, k) + f] - mean
                xy += x * wanted[size * k + f]
                xx += x * x
            }
        }
        return floor((if (xx > 0) xy / sqrt(xx) else 0.0) * 1e9 + 0.5) / 1e9
    }

    private fun fewest(kind: ChartKind): Int = ceil(limits.seen * (kind.columns * kind.rows)).toInt()
}
