package org.camssf.finder

import org.camssf.finder.Maps.x
import org.camssf.finder.Maps.y
import kotlin.math.ceil
import kotlin.math.floor
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.min
import kotlin.math.sqrt

/**
 * A part of a lattice, oriented as a chart.
 *
 * @property score agreement with the chart's colours, -1 to 1 (correlation).
 * @property mirrored true if the colours agree with the chart seen in a mirror.
 * @property u first lattice coordinate of the patches, in the chart's order.
 * @property v second lattice coordinate of the patches, in the chart's order.
 */
internal class OrientedGrid(
    val kind: ChartKind,
    val score: Double,
    val mirrored: Boolean,
    val u: IntArray,
    val v: IntArray,
)

/** Orients lattices by their colours: which part of a lattice is a chart, and which corner is its first patch. */
internal class Orientation(private val blobs: Blobs) {
    private val limits = FinderFile.limits
    private var logs = DoubleArray(0)
    private var inside = BooleanArray(0)
    private var member = BooleanArray(0)

    /** Integral image of [member]: number of blobs left of and above a place. */
    private var sums = IntArray(0)
    private val pairs = DoubleArray(4 * MOST_PATCHES)
    private val offs = DoubleArray(MOST_PATCHES)
    private val sorted = DoubleArray(MOST_PATCHES)
    private val means = DoubleArray(3)
    private val stepU = IntArray(MOST_PATCHES)
    private val stepV = IntArray(MOST_PATCHES)
    private var left = 0
    private var top = 0
    private var columns = 0
    private var rows = 0
    private var channels = 0

    /** The part of the lattice that agrees best with the chart's colours; null if no part can be the chart. */
    fun orient(codes: Codes, grid: Grid, kind: ChartKind): OrientedGrid? {
        val span = max(kind.columns, kind.rows) - 1
        channels = codes.channels
        left = grid.u.min() - span
        top = grid.v.min() - span
        columns = grid.u.max() + span - left + 1
        rows = grid.v.max() + span - top + 1
        look(codes, grid)
        val wanted = kind.features(channels)
        val patches = kind.columns * kind.rows
        val fewest = fewest(kind)
        val most = limits.ring * 2 * (kind.columns + kind.rows + 2)
        var best = -2.0
        var bestU = 0
        var bestV = 0
        var bestTurn = -1
        for (way in 0..7) {
            turn(kind, way)
            var low = 0
            var high = 0
            var above = 0
            var below = 0
            for (k in 0 until patches) {
                low = min(low, stepU[k])
                high = max(high, stepU[k])
                above = min(above, stepV[k])
                below = max(below, stepV[k])
            }
            for (v in -above until rows - below) {
                for (u in -low until columns - high) {
                    val seen = members(u + low, v + above, u + high, v + below)
                    if (seen < fewest || !whole(u, v, patches)) continue
                    if (members(u + low - 1, v + above - 1, u + high + 1, v + below + 1) - seen > most) continue
                    val score = score(u, v, patches, wanted)
                    if (score > best) {
                        best = score
                        bestU = u
                        bestV = v
                        bestTurn = way
                    }
                }
            }
        }
        if (bestTurn < 0) return null
        turn(kind, bestTurn)
        return OrientedGrid(
            kind,
            best,
            bestTurn % 2 == 1,
            IntArray(patches) { bestU + stepU[it] + left },
            IntArray(patches) { bestV + stepV[it] + top },
        )
    }

    /**
     * The homography from chart coordinates (column, row) to px, and the number of blobs that it was fitted to; null
     * if these are too few.
     *
     * It is fitted to all blobs, and again without outliers, such as a blob that covers half a patch or two patches.
     */
    fun placed(grid: Grid, found: OrientedGrid): Pair<DoubleArray, Int>? {
        var count = 0
        for (i in 0 until grid.size) {
            val k = found.u.indices.firstOrNull { found.u[it] == grid.u[i] && found.v[it] == grid.v[i] } ?: continue
            pairs[4 * count] = (k % found.kind.columns).toDouble()
            pairs[4 * count + 1] = (k / found.kind.columns).toDouble()
            pairs[4 * count + 2] = blobs.x[grid.blob[i]]
            pairs[4 * count + 3] = blobs.y[grid.blob[i]]
            count++
        }
        val back = Maps.inverse(Maps.fitted(pairs, count) ?: return null)
        for (i in 0 until count) {
            val p = x(back, pairs[4 * i + 2], pairs[4 * i + 3]) - pairs[4 * i]
            val q = y(back, pairs[4 * i + 2], pairs[4 * i + 3]) - pairs[4 * i + 1]
            offs[i] = p * p + q * q
            sorted[i] = offs[i]
        }
        sorted.sort(0, count)
        val limit = max(limits.stray * limits.stray, 9.0 * sorted[count / 2])
        var straight = 0
        for (i in 0 until count) {
            if (offs[i] > limit) continue
            pairs.copyInto(pairs, 4 * straight, 4 * i, 4 * i + 4)
            straight++
        }
        if (straight < fewest(found.kind)) return null
        val h = Maps.fitted(pairs, straight) ?: return null
        return h to straight
    }

    /** Computes the logarithms of the mean colours at every place, which places are in view, and which hold blobs. */
    private fun look(codes: Codes, grid: Grid) {
        val size = columns * rows
        if (inside.size < size) {
            inside = BooleanArray(size)
            member = BooleanArray(size)
        }
        if (sums.size < (columns + 1) * (rows + 1)) sums = IntArray((columns + 1) * (rows + 1))
        if (logs.size < size * channels) logs = DoubleArray(size * channels)
        member.fill(false, 0, size)
        for (i in 0 until grid.size) member[(grid.v[i] - top) * columns + grid.u[i] - left] = true
        sums.fill(0, 0, columns + 1)
        for (row in 0 until rows) {
            var count = 0
            sums[(row + 1) * (columns + 1)] = 0
            for (column in 0 until columns) {
                if (member[row * columns + column]) count++
                val at = (row + 1) * (columns + 1) + column + 1
                sums[at] = sums[at - columns - 1] + count
            }
        }
        val h = grid.map
        val pixels = codes.width * codes.height
        for (row in 0 until rows) {
            for (column in 0 until columns) {
                var good = true
                var first = 0
                var second = 0
                var third = 0
                for (dv in limits.spots) {
                    val q = (row + top) + dv
                    for (du in limits.spots) {
                        if (!good) continue
                        val p = (column + left) + du
                        val w = h[6] * p + h[7] * q + h[8]
                        val x = Math.rint((h[0] * p + h[1] * q + h[2]) / w)
                        val y = Math.rint((h[3] * p + h[4] * q + h[5]) / w)
                        good = w > 0.0 && x >= 0 && x <= codes.width - 1 && y >= 0 && y <= codes.height - 1
                        if (!good) continue
                        val at = y.toInt() * codes.width + x.toInt()
                        first += codes.values[at]
                        if (channels == 3) {
                            second += codes.values[at + pixels]
                            third += codes.values[at + 2 * pixels]
                        }
                    }
                }
                val place = row * columns + column
                inside[place] = good
                if (!good) continue
                logs[place * channels] = log(first)
                if (channels == 3) {
                    logs[place * channels + 1] = log(second)
                    logs[place * channels + 2] = log(third)
                }
            }
        }
    }

    /** Computes the lattice steps from the first patch to each; `way` is 2 · quarter turns, plus 1 if mirrored. */
    private fun turn(kind: ChartKind, way: Int) {
        for (k in 0 until kind.columns * kind.rows) {
            val i = if (way % 2 == 1) -(k % kind.columns) else k % kind.columns
            val j = k / kind.columns
            when (way / 2) {
                0 -> set(k, i, j)
                1 -> set(k, -j, i)
                2 -> set(k, -i, -j)
                else -> set(k, j, -i)
            }
        }
    }

    private fun set(k: Int, u: Int, v: Int) {
        stepU[k] = u
        stepV[k] = v
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

    private fun whole(u: Int, v: Int, patches: Int): Boolean {
        for (k in 0 until patches) if (!inside[(v + stepV[k]) * columns + u + stepU[k]]) return false
        return true
    }

    /**
     * Correlation with the chart's colours, rounded to nine digits: differences of logarithms between libraries must
     * not decide between equal scores.
     */
    private fun score(u: Int, v: Int, patches: Int, wanted: DoubleArray): Double {
        means.fill(0.0)
        for (k in 0 until patches) {
            val at = ((v + stepV[k]) * columns + u + stepU[k]) * channels
            for (c in 0 until channels) means[c] += logs[at + c]
        }
        for (c in 0 until channels) means[c] /= patches
        var xy = 0.0
        var xx = 0.0
        var yy = 0.0
        for (k in 0 until patches) {
            val at = ((v + stepV[k]) * columns + u + stepU[k]) * channels
            if (channels == 1) {
                val x = logs[at] - means[0]
                xy += x * wanted[k]
                xx += x * x
                yy += wanted[k] * wanted[k]
                continue
            }
            val r = logs[at] - means[0]
            val g = logs[at + 1] - means[1]
            val b = logs[at + 2] - means[2]
            val lightness = (r + g + b) / 3.0
            for (f in 0..3) {
                val x = when (f) {
                    0 -> lightness
                    1 -> 2.0 * (r - lightness)
                    2 -> 2.0 * (g - lightness)
                    else -> 2.0 * (b - lightness)
                }
                val y = wanted[4 * k + f]
                xy += x * y
                xx += x * x
                yy += y * y
            }
        }
        val size = sqrt(xx * yy)
        return floor((if (size > 0) xy / size else 0.0) * 1e9 + 0.5) / 1e9
    }

    private fun fewest(kind: ChartKind): Int = ceil(limits.seen * (kind.columns * kind.rows)).toInt()

    private fun log(total: Int): Double {
        val spots = limits.spots.size
        return ln(total / (spots * spots).toDouble() + limits.floor)
    }

    companion object {
        /** Largest number of patches of a chart. */
        private const val MOST_PATCHES = 300

        /**
         * A chart's colours (n, 3) in the form that [score] compares: lightness, and doubled chroma if there is
         * colour.
         */
        fun features(colours: DoubleArray, channels: Int): DoubleArray {
            val n = colours.size / 3
            val means = DoubleArray(3)
            for (k in 0 until n) for (c in 0..2) means[c] += ln(colours[3 * k + c])
            for (c in 0..2) means[c] /= n.toDouble()
            if (channels == 1) return DoubleArray(n) { ln(colours[3 * it + 1]) - means[1] }
            val all = DoubleArray(4 * n)
            for (k in 0 until n) {
                val r = ln(colours[3 * k]) - means[0]
                val g = ln(colours[3 * k + 1]) - means[1]
                val b = ln(colours[3 * k + 2]) - means[2]
                val lightness = (r + g + b) / 3.0
                all[4 * k] = lightness
                all[4 * k + 1] = 2.0 * (r - lightness)
                all[4 * k + 2] = 2.0 * (g - lightness)
                all[4 * k + 3] = 2.0 * (b - lightness)
            }
            return all
        }
    }
}
