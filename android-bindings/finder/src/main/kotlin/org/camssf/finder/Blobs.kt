package org.camssf.finder

import kotlin.math.max
import kotlin.math.min
import kotlin.math.sqrt

/**
 * Finds blobs: connected pixels that are brighter than a dark line around them and fill a parallelogram.
 *
 * The arrays hold the blobs of all passes at 0 until [size]: centre ([x], [y]) px, [area] px, second moments [xx],
 * [xy], [yy] px² and their determinant [det]. The next [find] overwrites them. Use it on one thread at a time.
 */
internal class Blobs {
    private val limits = FinderFile.limits

    var size = 0
    val x = DoubleArray(limits.mostBlobs)
    val y = DoubleArray(limits.mostBlobs)
    val area = DoubleArray(limits.mostBlobs)
    val xx = DoubleArray(limits.mostBlobs)
    val xy = DoubleArray(limits.mostBlobs)
    val yy = DoubleArray(limits.mostBlobs)
    val det = DoubleArray(limits.mostBlobs)

    private val components = Components()
    private var bright = IntArray(0)
    private var corner = IntArray(0)
    private var excess = IntArray(0)
    private var heads = IntArray(0)
    private val next = IntArray(limits.mostBlobs)

    /** Finds the blobs of a picture; of overlapping blobs, the first is kept. */
    fun find(codes: Codes) {
        val width = codes.width
        val height = codes.height
        size = 0
        prepare(codes)
        val columns = width / CELL + 1
        val lines = height / CELL + 1
        if (heads.size < columns * lines) heads = IntArray(columns * lines)
        heads.fill(-1)
        for (pass in limits.passes) {
            components.clear()
            for (row in 0 until height) scan(row, width, height, pass)
            components.each { add(it, width * height, columns, lines) }
        }
    }

    /**
     * Computes the sum of the channels and its integral image. Entries of the integral image may overflow, and its
     * first row may hold anything but in column 0; their differences are still correct.
     */
    private fun prepare(codes: Codes) {
        val size = codes.width * codes.height
        if (bright.size < size) bright = IntArray(size)
        if (excess.size < codes.width) excess = IntArray(codes.width)
        for (i in 0 until size) bright[i] = codes.values[i]
        for (c in 1 until codes.channels) for (i in 0 until size) bright[i] += codes.values[c * size + i]
        val stride = codes.width + 1
        if (corner.size < stride * (codes.height + 1)) corner = IntArray(stride * (codes.height + 1))
        for (row in 0 until codes.height) {
            var total = 0
            var at = (row + 1) * stride
            corner[at] = 0
            for (i in row * codes.width until (row + 1) * codes.width) {
                total += bright[i]
                at++
                corner[at] = corner[at - stride] + total
            }
        }
    }

    /**
     * Adds the runs of a row: pixels that exceed `pass[1]` / 16 of their window's mean; windows end at the picture's
     * edges.
     */
    private fun scan(row: Int, width: Int, height: Int, pass: IntArray) {
        compare(row, width, height, pass)
        val excess = excess
        var start = -1
        components.row(row)
        for (x in 0 until width) {
            if (excess[x] > 0) {
                if (start < 0) start = x
            } else if (start >= 0) {
                components.run(start, x - 1)
                start = -1
            }
        }
        if (start >= 0) components.run(start, width - 1)
    }

    /**
     * Computes by how much each pixel of a row exceeds `pass[1]` / 16 of its window's mean, times 16 times the
     * window's area. Where the window lies completely inside the picture, the loop has no branches, so that compilers
     * can vectorise it.
     */
    private fun compare(row: Int, width: Int, height: Int, pass: IntArray) {
        val reach = pass[0]
        val sixteenths = pass[1]
        val above = max(row - reach, 0)
        val lines = min(row + reach + 1, height) - above
        val top = above * (width + 1)
        val bottom = top + lines * (width + 1)
        val begin = row * width
        val sums = corner
        val light = bright
        val found = excess

        fun clipped(x: Int) {
            val left = max(x - reach, 0)
            val right = min(x + reach + 1, width)
            val total = sums[bottom + right] - sums[bottom + left] - sums[top + right] + sums[top + left]
            found[x] = 16 * lines * (right - left) * light[begin + x] - sixteenths * total
        }
        val whole = min(reach, width)
        val end = max(width - reach, whole)
        for (x in 0 until whole) clipped(x)
        val area = 16 * lines * (2 * reach + 1)
        for (x in whole until end) {
            val left = x - reach
            val right = x + reach + 1
            val total = sums[bottom + right] - sums[bottom + left] - sums[top + right] + sums[top + left]
            found[x] = area * light[begin + x] - sixteenths * total
        }
        for (x in end until width) clipped(x)
    }

    /** Adds component i if it looks like a patch and lies on no kept blob of similar size. */
    private fun add(i: Int, pixels: Int, columns: Int, lines: Int) {
        fun moment(k: Int) = components.moments[6 * i + k].toDouble()
        val a = moment(0)
        if (size >= limits.mostBlobs || a < limits.smallestArea || a * limits.largestShare > pixels) return
        val sx = moment(1)
        val sy = moment(2)
        // Pixels are squares, not points: each adds a variance of 1/12 along both axes.
        val mxx = (moment(3) * a - sx * sx) / (a * a) + 1.0 / 12
        val mxy = (moment(4) * a - sx * sy) / (a * a)
        val myy = (moment(5) * a - sy * sy) / (a * a) + 1.0 / 12
        val d = mxx * myy - mxy * mxy
        if (d <= 0 || (mxx + myy) * (mxx + myy) > limits.longestShape * d) return
        val full = a / (12 * sqrt(d))
        if (full < limits.full[0] || full > limits.full[1]) return
        val px = sx / a
        val py = sy / a
        if (known(px, py, a, columns, lines)) return
        val cell = py.toInt() / CELL * columns + px.toInt() / CELL
        next[size] = heads[cell]
        heads[cell] = size
        x[size] = px
        y[size] = py
        area[size] = a
        xx[size] = mxx
        xy[size] = mxy
        yy[size] = myy
        det[size] = d
        size++
    }

    /** True if a blob of area a, centred at (px, py), lies on a kept blob of similar size. */
    private fun known(px: Double, py: Double, a: Double, columns: Int, lines: Int): Boolean {
        val near = limits.overlap * a
        val reach = sqrt(near).toInt() / CELL + 1
        val row = py.toInt() / CELL
        val column = px.toInt() / CELL
        for (r in max(row - reach, 0)..min(row + reach, lines - 1)) {
            for (c in max(column - reach, 0)..min(column + reach, columns - 1)) {
                var i = heads[r * columns + c]
                while (i >= 0) {
                    val dx = px - x[i]
                    val dy = py - y[i]
                    val alike = a <= limits.sameSize * area[i] && area[i] <= limits.sameSize * a
                    if (alike && dx * dx + dy * dy < near) return true
                    i = next[i]
                }
            }
        }
        return false
    }

    private companion object {
        /** Edge of the squares that index the blobs by position, px. */
        const val CELL = 16
    }
}
