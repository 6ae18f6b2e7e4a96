package org.camssf.guide

import kotlin.math.roundToInt

/**
 * The light of the patches of one chart in one frame: the central 0.6 × 0.6 pitches of each patch, in 3 × 3 cells.
 *
 * The arrays are reused from frame to frame.
 */
internal class PatchLight(val columns: Int, val rows: Int) {
    val count = columns * rows

    /** (n, 9) mean luminance of the cells, row by row in the chart's orientation. */
    val cells = DoubleArray(9 * count)

    /** (n) mean luminance. */
    val level = DoubleArray(count)

    /** (n, 3) mean of red, green, blue. */
    val colour = DoubleArray(3 * count)

    /** (n) share of pixels that are at the ceiling in any channel. */
    val clipped = DoubleArray(count)

    /** (n) mean luminance of the brightest twentieth of the pixels, and median luminance. */
    val top = DoubleArray(count)
    val middle = DoubleArray(count)

    private val sorted = DoubleArray(MOST * MOST)

    fun read(pixels: Pixels, plane: ChartPlane) {
        // About one sample per pixel; the number along a side is a multiple of three.
        val side = (2 * REACH * plane.pitch / 3).roundToInt().coerceIn(2, MOST / 3) * 3
        cells.fill(0.0)
        colour.fill(0.0)
        clipped.fill(0.0)
        for (patch in 0 until count) patch(pixels, plane, patch, side)
    }

    private fun patch(pixels: Pixels, plane: ChartPlane, patch: Int, side: Int) {
        val total = side * side
        for (j in 0 until side) {
            for (i in 0 until side) {
                val u = patch % columns + REACH * ((2 * i + 1.0) / side - 1)
                val v = patch / columns + REACH * ((2 * j + 1.0) / side - 1)
                pixels.read(plane.x(u, v).roundToInt(), plane.y(u, v).roundToInt())
                cells[9 * patch + 3 * (3 * j / side) + 3 * i / side] += pixels.luma
                colour[3 * patch] += pixels.red
                colour[3 * patch + 1] += pixels.green
                colour[3 * patch + 2] += pixels.blue
                if (pixels.peak >= Limits.CEILING) clipped[patch]++
                sorted[j * side + i] = pixels.luma
            }
        }
        for (cell in 9 * patch until 9 * patch + 9) cells[cell] /= total / 9.0
        for (channel in 3 * patch until 3 * patch + 3) colour[channel] /= total.toDouble()
        clipped[patch] /= total.toDouble()
        sorted.sort(0, total)
        middle[patch] = sorted[total / 2]
        val few = total / 20 + 1
        var sum = 0.0
        var best = 0.0
        for (i in 0 until total) {
            sum += sorted[i]
            if (i >= total - few) best += sorted[i]
        }
        level[patch] = sum / total
        top[patch] = best / few
    }

    companion object {
        /**
         * Half the side of the area that is read, pitches: it excludes borders that are blurred or misplaced by a
         * tenth.
         */
        const val REACH = 0.3
        private const val MOST = 18
    }
}
