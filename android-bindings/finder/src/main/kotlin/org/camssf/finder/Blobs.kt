package org.camssf.finder

import kotlin.math.max
import kotlin.math.min
import kotlin.math.sqrt

/** Connected pixels that are brighter than a dark line around them and fill a parallelogram; of all passes. */
internal class Blobs {
    var size = 0
        private set
    val x = DoubleArray(MOST)
    val y = DoubleArray(MOST)
    val area = DoubleArray(MOST)
    val xx = DoubleArray(MOST)
    val xy = DoubleArray(MOST)
    val yy = DoubleArray(MOST)
    val det = DoubleArray(MOST)

    private val components = Components()
    private var bright = IntArray(0)
    private var corner = IntArray(0)
    private var excess = IntArray(0)
    private var heads = IntArray(0)
    private val next = IntArray(MOST)

    /** Of those that lie on each other the first is kept. */
    fun find(codes: Codes) {
        val width = codes.width
        val height = codes.height
        size = 0
        prepare(codes)
        val columns = width / CELL + 1
        val lines = height / CELL + 1
        if (heads.size < columns * lines) heads = IntArray(columns * lines)
        heads.fill(-1)
        for (pass in PASSES) {
            components.clear()
            for (row in 0 until height) scan(row, width, height, pass)
            components.each { add(it, width * height, columns, lines) }
        }
    }

    /** The sum of the channels, and its sums from the picture's corner on; these may run over, their differences do not. */
    private fun prepare(codes: Codes) {
        val size = codes.width * codes.height
        if (bright.size < size) bright = IntArray(size)
        if (excess.size < codes.width) excess = IntArray(codes.width)
        for (i in 0 until size) bright[i] = codes.values[i]
        for (c in 1 until codes.channels) for (i in 0 until size) bright[i] += codes.values[c * size + i]
        val stride = codes.width + 1
        if (corner.size < stride * (codes.height + 1)) corner = IntArray(stride * (codes.height + 1))
        corner.fill(0, 0, stride)
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

    /** A row's runs of pixels that exceed so many sixteenths of their window's mean; the window ends with the picture. */
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
     * By how much each pixel of a row exceeds so many sixteenths of its window's mean, times the window's area. Where the
     * window is whole that is a loop without branches, which compilers do several pixels at a time.
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

    /** Adds component i if it looks like a patch and is new. */
    private fun add(i: Int, pixels: Int, columns: Int, lines: Int) {
        val count = components.count[i]
        if (size >= MOST || count < SMALLEST_AREA || count * LARGEST_SHARE > pixels) return
        val a = count.toDouble()
        val sx = components.x[i].toDouble()
        val sy = components.y[i].toDouble()
        // Pixels are squares, not points: a twelfth each way.
        val mxx = (components.xx[i].toDouble() * a - sx * sx) / (a * a) + 1.0 / 12
        val myy = (components.yy[i].toDouble() * a - sy * sy) / (a * a) + 1.0 / 12
        val mxy = (components.xy[i].toDouble() * a - sx * sy) / (a * a)
        val d = mxx * myy - mxy * mxy
        if (d <= 0 || (mxx + myy) * (mxx + myy) > LONGEST_SHAPE * d) return
        val full = a / (12 * sqrt(d))
        if (full < FULL_LEAST || full > FULL_MOST) return
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

    /** Does it lie on another of about its size? */
    private fun known(px: Double, py: Double, a: Double, columns: Int, lines: Int): Boolean {
        val near = 0.1 * a
        val reach = sqrt(near).toInt() / CELL + 1
        val row = py.toInt() / CELL
        val column = px.toInt() / CELL
        for (r in max(row - reach, 0)..min(row + reach, lines - 1)) {
            for (c in max(column - reach, 0)..min(column + reach, columns - 1)) {
                var i = heads[r * columns + c]
                while (i >= 0) {
                    val dx = px - x[i]
                    val dy = py - y[i]
                    if (0.5 * a <= area[i] && area[i] <= 2 * a && dx * dx + dy * dy < near) return true
                    i = next[i]
                }
            }
        }
        return false
    }

    private companion object {
        /** What is bright: window's reach, px, and how many sixteenths of its mean a pixel must exceed. */
        val PASSES =
            arrayOf(intArrayOf(5, 15), intArrayOf(5, 13), intArrayOf(13, 15), intArrayOf(13, 13), intArrayOf(24, 12))

        /** Blobs of a picture: what comes after is left out, for the time that it takes. */
        const val MOST = 1500

        /** Edge of the squares in which blobs are kept for looking them up, px. */
        const val CELL = 16

        /** Pixels of a blob at least, and into how many such parts the picture would fall at most. */
        const val SMALLEST_AREA = 16
        const val LARGEST_SHARE = 20

        /** Area by pixel count over area by second moments, 12 √det: 1 for every parallelogram. */
        const val FULL_LEAST = 0.82
        const val FULL_MOST = 1.12

        /** (trace)² / det of the second moments at most: 4 for a square, 12 for one ten times as long as wide (variance). */
        const val LONGEST_SHAPE = 14.0
    }
}
