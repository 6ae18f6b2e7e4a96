package org.camssf.finder

import org.camssf.photo.Homography
import kotlin.math.abs
import kotlin.math.floor
import kotlin.math.max
import kotlin.math.min

/**
 * A lattice of blobs: the homography from lattice coordinates to px, and the index of the blob at each place (u, v).
 *
 * @property u first coordinate of each place; places are sorted by u, then by v.
 * @property v second coordinate of each place.
 * @property blob index of the blob at each place.
 */
internal class BlobLattice(val map: Homography, val u: IntArray, val v: IntArray, val blob: IntArray) {
    val size: Int get() = blob.size
}

/** Finds lattices: blobs that are neighbours in two directions, and the homography that maps to them. */
internal class Lattices(private val blobs: Blobs) {
    private val limits = FinderFile.limits
    private val mostNeighbours = limits.mostNeighbours
    private val near = IntArray(mostNeighbours * blobs.x.size)
    private val far = DoubleArray(mostNeighbours * blobs.x.size)
    private val nears = IntArray(blobs.x.size)
    private val used = BooleanArray(blobs.x.size)
    private val taken = BooleanArray(blobs.x.size)
    private val queueU = IntArray(blobs.x.size)
    private val queueV = IntArray(blobs.x.size)
    private val queueBlob = IntArray(blobs.x.size)
    private val steps = DoubleArray(4 * blobs.x.size)
    private val basis = DoubleArray(4)
    private val pairs = DoubleArray(4 * blobs.x.size)
    private val shares = DoubleArray(blobs.x.size)

    /**
     * Index of the blob at each place, or -1. Place (u, v) is at (u + ORIGIN) · SIDE + v + ORIGIN, so places are
     * sorted by u, then by v.
     */
    private val places = IntArray(SIDE * SIDE)
    private val offs = DoubleArray(SIDE * SIDE)
    private val groups = IntArray(SIDE * SIDE)

    /** All lattices of the blobs, those with most blobs first. */
    fun find(): List<BlobLattice> {
        for (i in 0 until blobs.size) neighbours(i)
        used.fill(false)
        val lattices = ArrayList<BlobLattice>()
        for (seed in 0 until blobs.size) {
            if (used[seed] || !basis(seed)) continue
            val count = grow(seed)
            if (count < limits.fewest) continue
            val lattice = settle(count) ?: continue
            for (i in lattice.blob) used[i] = true
            lattices += lattice
        }
        return lattices.sortedBy { -it.size }
    }

    /**
     * Finds the nearest blobs that may be adjacent patches, by their squared distance in the blob's second moments.
     */
    private fun neighbours(i: Int) {
        val from = i * mostNeighbours
        var count = 0
        val area = blobs.area[i]
        val det = blobs.det[i]
        val xx = blobs.xx[i]
        val xy = blobs.xy[i]
        val yy = blobs.yy[i]
        val reach = limits.neighbour[1] * det
        for (j in 0 until blobs.size) {
            if (j == i || blobs.area[j] > limits.alike * area || area > limits.alike * blobs.area[j]) continue
            val dx = blobs.x[j] - blobs.x[i]
            val dy = blobs.y[j] - blobs.y[i]
            val apart = yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy
            if (!(limits.neighbour[0] * det <= apart && apart <= reach)) continue
            val distance = apart / det
            var at = count
            while (at > 0 && distance < far[from + at - 1]) at--
            if (at == mostNeighbours) continue
            for (k in min(count, mostNeighbours - 1) downTo at + 1) {
                far[from + k] = far[from + k - 1]
                near[from + k] = near[from + k - 1]
            }
            far[from + at] = distance
            near[from + at] = j
            if (count < mostNeighbours) count++
        }
        nears[i] = count
    }

    /**
     * Finds the shortest two steps from the seed that are square in its second moments, in clockwise order; false if
     * there are none.
     */
    private fun basis(seed: Int): Boolean {
        val from = seed * mostNeighbours
        val det = blobs.det[seed]
        val xx = blobs.xx[seed]
        val xy = blobs.xy[seed]
        val yy = blobs.yy[seed]
        var best = Double.POSITIVE_INFINITY
        for (m in 0 until nears[seed]) {
            for (l in m + 1 until nears[seed]) {
                val first = far[from + m]
                val second = far[from + l]
                if (first + second >= best || second > limits.lengths * first) continue
                val px = blobs.x[near[from + m]] - blobs.x[seed]
                val py = blobs.y[near[from + m]] - blobs.y[seed]
                val qx = blobs.x[near[from + l]] - blobs.x[seed]
                val qy = blobs.y[near[from + l]] - blobs.y[seed]
                val dot = (yy * px * qx - xy * (px * qy + py * qx) + xx * py * qy) / det
                if (dot * dot > limits.cosine * limits.cosine * first * second) continue
                best = first + second
                val clockwise = px * qy - py * qx > 0
                basis[0] = if (clockwise) px else qx
                basis[1] = if (clockwise) py else qy
                basis[2] = if (clockwise) qx else px
                basis[3] = if (clockwise) qy else py
            }
        }
        return best < Double.POSITIVE_INFINITY
    }

    /** Places unused blobs step by step from the seed; each step predicts the next one. Returns their number. */
    private fun grow(seed: Int): Int {
        places.fill(-1)
        used.copyInto(taken)
        places[at(0, 0)] = seed
        taken[seed] = true
        queueU[0] = 0
        queueV[0] = 0
        queueBlob[0] = seed
        basis.copyInto(steps)
        var count = 1
        var at = 0
        while (at < count) {
            val i = queueBlob[at]
            for (way in 0..3) {
                val du = WAYS_U[way]
                val dv = WAYS_V[way]
                val u = queueU[at] + du
                val v = queueV[at] + dv
                if (max(abs(u), abs(v)) > limits.widest || places[at(u, v)] >= 0) continue
                val chosen = next(
                    i, du * steps[4 * at] + dv * steps[4 * at + 2],
                    du * steps[4 * at + 1] + dv * steps[4 * at + 3],
                )
                if (chosen < 0) continue
                val gx = blobs.x[chosen] - blobs.x[i]
                val gy = blobs.y[chosen] - blobs.y[i]
                steps.copyInto(steps, 4 * count, 4 * at, 4 * at + 4)
                if (du != 0) {
                    steps[4 * count] = du * gx
                    steps[4 * count + 1] = du * gy
                } else {
                    steps[4 * count + 2] = dv * gx
                    steps[4 * count + 3] = dv * gy
                }
                places[at(u, v)] = chosen
                taken[chosen] = true
                queueU[count] = u
                queueV[count] = v
                queueBlob[count++] = chosen
            }
            at++
        }
        return count
    }

    /** The unused neighbour of blob i that is nearest to the position that this step predicts, or -1. */
    private fun next(i: Int, sx: Double, sy: Double): Int {
        val x = blobs.x[i] + sx
        val y = blobs.y[i] + sy
        var best = limits.step * limits.step * (sx * sx + sy * sy)
        var chosen = -1
        for (k in i * mostNeighbours until i * mostNeighbours + nears[i]) {
            val j = near[k]
            val ex = blobs.x[j] - x
            val ey = blobs.y[j] - y
            if (!taken[j] && ex * ex + ey * ey < best) {
                best = ex * ex + ey * ey
                chosen = j
            }
        }
        return chosen
    }

    /**
     * Fits one homography to all blobs; each round adds blobs at its places, drops others, and fits again. Null if it
     * fails.
     */
    private fun settle(grown: Int): BlobLattice? {
        var left = 0
        var right = 0
        var top = 0
        var bottom = 0
        for (i in 0 until grown) {
            left = min(left, queueU[i])
            right = max(right, queueU[i])
            top = min(top, queueV[i])
            bottom = max(bottom, queueV[i])
        }
        val bounds = intArrayOf(left - limits.far, top - limits.far, right + limits.far, bottom + limits.far)
        var count = gather()
        for (place in limits.place) {
            val map = Homography.fit(pairs, count) ?: return null
            for (i in 0 until count) {
                val blob = places[at(pairs[4 * i].toInt(), pairs[4 * i + 1].toInt())]
                shares[i] = blobs.area[blob] / map.area(pairs[4 * i], pairs[4 * i + 1])
            }
            shares.sort(0, count)
            inPlace(map, shares[count / 2], place, bounds)
            count = gather()
            if (count < limits.fewest) return null
        }
        val map = Homography.fit(pairs, count) ?: return null
        val u = IntArray(count) { pairs[4 * it].toInt() }
        val v = IntArray(count) { pairs[4 * it + 1].toInt() }
        return BlobLattice(map, u, v, IntArray(count) { places[at(u[it], v[it])] })
    }

    /** Writes the places and the centres of their blobs to `pairs`, sorted by u, then by v; returns their number. */
    private fun gather(): Int {
        var count = 0
        for (u in -ORIGIN until ORIGIN) {
            for (v in -ORIGIN until ORIGIN) {
                val i = places[at(u, v)]
                if (i < 0) continue
                pairs[4 * count] = u.toDouble()
                pairs[4 * count + 1] = v.toDouble()
                pairs[4 * count + 2] = blobs.x[i]
                pairs[4 * count + 3] = blobs.y[i]
                count++
            }
        }
        return count
    }

    /**
     * Assigns to each place of the lattice the nearest blob whose size agrees with the lattice.
     *
     * @param usual usual share of a cell's area that a blob fills.
     * @param place largest distance of a blob from its place, in pitches.
     * @param bounds smallest u and v, largest u and v.
     */
    private fun inPlace(map: Homography, usual: Double, place: Double, bounds: IntArray) {
        val back = map.adjugate()
        places.fill(-1)
        for (i in 0 until blobs.size) {
            val x = blobs.x[i]
            val y = blobs.y[i]
            val u = back.x(x, y)
            val v = back.y(x, y)
            if (!(bounds[0] <= u && u <= bounds[2] && bounds[1] <= v && v <= bounds[3])) continue
            if (map.depth(u, v) <= 0.0) continue // behind the camera
            val p = floor(u + 0.5)
            val q = floor(v + 0.5)
            val off = (u - p) * (u - p) + (v - q) * (v - q)
            if (off > place * place) continue
            val share = blobs.area[i] / (usual * map.area(p, q))
            if (!(limits.sizes[0] <= share && share <= limits.sizes[1])) continue
            val spot = at(p.toInt(), q.toInt())
            if (places[spot] < 0 || off < offs[spot]) {
                offs[spot] = off
                places[spot] = i
            }
        }
        together(bounds)
    }

    /**
     * Keeps the connected places, by steps of at most `bridge`, that hold most of the blobs that grew from the seed.
     * Other blobs are there by chance, or belong to another lattice.
     */
    private fun together(bounds: IntArray) {
        groups.fill(0)
        var group = 0
        var most = 0
        var largest = 0
        for (u in bounds[0]..bounds[2]) {
            for (v in bounds[1]..bounds[3]) {
                if (places[at(u, v)] < 0 || groups[at(u, v)] != 0) continue
                group++
                val count = spread(at(u, v), group)
                if (count > largest) {
                    largest = count
                    most = group
                }
            }
        }
        for (spot in places.indices) if (groups[spot] != most) places[spot] = -1
    }

    /** Marks all places that are connected with this one; returns how many of their blobs grew from the seed. */
    private fun spread(start: Int, group: Int): Int {
        groups[start] = group
        queueU[0] = start
        var count = 1
        var next = 0
        var grown = 0
        while (next < count) {
            val spot = queueU[next++]
            if (taken[places[spot]] && !used[places[spot]]) grown++
            for (du in -limits.bridge..limits.bridge) {
                for (dv in -limits.bridge..limits.bridge) {
                    val other = spot + du * SIDE + dv
                    if (places[other] < 0 || groups[other] != 0) continue
                    groups[other] = group
                    queueU[count++] = other
                }
            }
        }
        return grown
    }

    private companion object {
        /** Of [places]: `widest`, `far` and `bridge` must fit between the seed and its edge. */
        const val SIDE = 128
        const val ORIGIN = 64
        val WAYS_U = intArrayOf(1, 0, -1, 0)
        val WAYS_V = intArrayOf(0, 1, 0, -1)

        fun at(u: Int, v: Int): Int = (u + ORIGIN) * SIDE + v + ORIGIN
    }
}
