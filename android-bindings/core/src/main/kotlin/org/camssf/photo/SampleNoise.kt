package org.camssf.photo

import org.camssf.Rules
import kotlin.math.max
import kotlin.math.sqrt

/** A number and its standard error. */
internal class Estimate(val value: Double, val error: Double)

/**
 * The noise of a chart photo's samples beside their neighbours: Python's camssf.photo.neighbours.
 *
 * @property step DN, the greatest common divisor of the samples' distances.
 * @property unlike correlation of neighbours of different colours, without texture's part; null for too few pairs.
 * @property like the same of next samples of one colour.
 */
internal class SampleNoise(val step: Double, val unlike: Estimate?, val like: Estimate?)

/**
 * Neighbours in one direction in one patch.
 *
 * @property like whether they have the same colour.
 * @property count of pairs.
 * @property correlation of their noise.
 * @property texture product of their signals over that of their noise's standard deviations.
 */
internal class NeighbourPairs(val like: Boolean, val count: Double, val correlation: Double, val texture: Double)

/**
 * Gathers the neighbours of all patches of a chart photo.
 *
 * @param cells index in the 2 × 2 cell of R, the green on R's rows, the green on B's rows, B.
 * @param black (4) the file's black level at these, DN.
 */
internal class NeighbourNoise(patches: Int, private val cells: List<Int>, private val black: DoubleArray) {
    private val pairs = arrayOfNulls<List<NeighbourPairs>>(patches)
    private var step = 0L

    /** Takes the samples of one patch, of each position of the CFA cell, and which of them are kept. */
    fun put(patch: Int, places: List<Places>, samples: List<IntArray>, kept: List<BooleanArray>) {
        val boxes = places.mapNotNull { it.box }
        val top = boxes.minOf { it.top } / 2 * 2
        val left = boxes.minOf { it.left } / 2 * 2
        val window = Window(boxes.maxOf { it.bottom } - top, boxes.maxOf { it.right } - left)
        var least = -1
        places.forEachIndexed { position, own ->
            val cell = cells[position]
            own.each { i, column, row ->
                val at = window.at(2 * row + cell / 2 - top, 2 * column + cell % 2 - left)
                window.values[at] = samples[position][i].toLong()
                window.known[at] = kept[position][i]
                if (kept[position][i]) {
                    if (least < 0) least = samples[position][i]
                    step = divisor(step, Math.abs((samples[position][i] - least).toLong()))
                }
            }
        }
        pairs[patch] = window.pairs(cells, black)
    }

    /** The statistics of all patches. */
    fun result(): SampleNoise {
        val all = pairs.filterNotNull().flatten()
        return SampleNoise(max(step, 1L).toDouble(), common(all.filter { !it.like }), common(all.filter { it.like }))
    }

    private companion object {
        val SHARED get() = Rules.shipped.number("noise.shared")

        fun divisor(a: Long, b: Long): Long = if (b == 0L) a else divisor(b, a % b)

        /** The pairs' correlation at no texture: a line over it if it rises, weighted by the numbers of pairs. */
        fun common(pairs: List<NeighbourPairs>): Estimate? {
            if (pairs.isEmpty()) return null
            val total = pairs.sumOf { it.count / SHARED }
            fun mean(value: (NeighbourPairs) -> Double) = pairs.sumOf { it.count / SHARED * value(it) } / total
            var value = mean { it.correlation }
            val middle = mean { it.texture }
            var error = 1.0 / sqrt(total)
            var slope = 0.0
            val spread = total * mean { (it.texture - middle) * (it.texture - middle) }
            val rise = total * mean { (it.texture - middle) * it.correlation }
            if (spread > 0.0 && rise > 0.0) {
                slope = rise / spread
                value -= slope * middle
                error = sqrt(1.0 / total + middle * middle / spread)
            }
            val scatter = total * mean {
                val off = it.correlation - value - slope * it.texture
                off * off
            } / pairs.size
            return Estimate(value, error * sqrt(max(1.0, scatter)))
        }
    }
}

/** Samples around a patch, from an even row and column on. */
private class Window(val height: Int, val width: Int) {
    val values = LongArray(height * width)
    val known = BooleanArray(height * width)

    fun at(y: Int, x: Int): Int = y * width + x

    fun transposed(): Window = Window(width, height).also { other ->
        for (y in 0 until height) {
            for (x in 0 until width) {
                other.values[other.at(x, y)] = values[at(y, x)]
                other.known[other.at(x, y)] = known[at(y, x)]
            }
        }
    }

    fun pairs(cells: List<Int>, black: DoubleArray): List<NeighbourPairs> {
        val means = cells.mapIndexed { i, cell ->
            var sum = 0L
            var count = 0
            each(cell) {
                if (known[it]) {
                    sum += values[it]
                    count++
                }
            }
            max(sum.toDouble() / max(count, 1) - black[i], 0.0)
        }
        return listOf(true, false).flatMap { horizontal ->
            val noise = if (horizontal) differences() else transposed().differences().transposed()
            val variances = cells.map { noise.meanSquare(it) }
            STEPS.flatMap { (across, along) ->
                val offset = if (horizontal) across to along else along to across
                noise.inDirection(offset, cells, variances, means)
            }
        }
    }

    /** Second difference along a row minus that of the row `across` below, and where all six samples are kept. */
    private fun differences(): Window {
        val noise = Window(height, width)
        val along = Rules.shipped.whole("noise.along")
        val across = Rules.shipped.whole("noise.across")
        for (y in 0 until height - across) {
            for (x in along until width - along) {
                val both = intArrayOf(at(y, x), at(y + across, x))
                noise.known[at(y, x)] = both.all { known[it] && known[it - along] && known[it + along] }
                val (first, second) = both.map { 2 * values[it] - values[it - along] - values[it + along] }
                noise.values[at(y, x)] = first - second
            }
        }
        return noise
    }

    private fun meanSquare(cell: Int): Double {
        var sum = 0L
        var count = 0
        each(cell) {
            if (known[it]) {
                sum += values[it] * values[it]
                count++
            }
        }
        return if (count > 0) sum.toDouble() / count else 0.0
    }

    /** The neighbours of each cell's samples at an offset (rows, columns). */
    private fun inDirection(
        offset: Pair<Int, Int>,
        cells: List<Int>,
        variances: List<Double>,
        means: List<Double>,
    ): List<NeighbourPairs> {
        val (dy, dx) = if (offset.first < 0) -offset.first to -offset.second else offset
        return cells.indices.mapNotNull { i ->
            val (row, column) = cells[i] / 2 to cells[i] % 2
            val j = cells.indexOf(Math.floorMod(row + dy, 2) * 2 + Math.floorMod(column + dx, 2))
            if (setOf(i, j) == setOf(1, 2)) return@mapNotNull null // two greens have one colour, and are not next
            var sum = 0L
            var count = 0
            for (y in row until height - dy step 2) {
                for (x in column until width step 2) {
                    if (x + dx !in 0 until width) continue
                    val (here, there) = at(y, x) to at(y + dy, x + dx)
                    if (known[here] && known[there]) {
                        sum += values[here] * values[there]
                        count++
                    }
                }
            }
            if (count < FEWEST_PAIRS || !(variances[i] > 0.0) || !(variances[j] > 0.0)) return@mapNotNull null
            val deviation = sqrt(variances[i] * variances[j])
            val weight = count / (if (dy != 0 && dx != 0) 2.0 else 1.0)
            NeighbourPairs(i == j, weight, sum.toDouble() / count / deviation, 12.0 * means[i] * means[j] / deviation)
        }
    }

    private inline fun each(cell: Int, each: (Int) -> Unit) {
        for (y in cell / 2 until height step 2) for (x in cell % 2 until width step 2) each(at(y, x))
    }

    private companion object {
        val FEWEST_PAIRS get() = Rules.shipped.whole("noise.fewest_pairs")

        /** Neighbours (across, along) whose noise is compared. */
        val STEPS = listOf(0 to 1, 1 to 1, 1 to -1, 2 to 0)
    }
}
