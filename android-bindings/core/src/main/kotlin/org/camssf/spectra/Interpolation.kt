package org.camssf.spectra

import org.camssf.Grid
import org.camssf.json.number
import kotlin.math.abs
import kotlin.math.max
import kotlin.math.min

/** Interpolations to the grid, (681) each, constant outside the nodes. docs/tables.md gives the formulas. */
internal object Interpolation {
    private val OUTER = arrayOf(
        doubleArrayOf(884.0, -1960.0, 3033.0, -2648.0, 1080.0, -180.0),
        doubleArrayOf(508.0, -540.0, 488.0, -367.0, 144.0, -24.0),
    )
    private val INNER = arrayOf(
        doubleArrayOf(2.0, -16.0, 0.0, 16.0, -2.0, 0.0),
        doubleArrayOf(-1.0, 16.0, -30.0, 16.0, -1.0, 0.0),
        doubleArrayOf(-9.0, 39.0, -70.0, 66.0, -33.0, 7.0),
        doubleArrayOf(13.0, -64.0, 126.0, -124.0, 61.0, -12.0),
        doubleArrayOf(-5.0, 25.0, -50.0, 50.0, -25.0, 5.0),
    )

    /** Evenly spaced nodes from `start` every `step` nm. */
    fun nodes(start: Double, step: Double, count: Int): DoubleArray = DoubleArray(count) { start + step * it }

    /** Linear interpolation between increasing nodes. */
    fun linear(nodes: DoubleArray, values: DoubleArray): DoubleArray {
        var i = 0
        return onGrid { x ->
            while (i < nodes.size - 2 && nodes[i + 1] <= x) i++
            at(nodes, values, i, x)
        }
    }

    private fun at(nodes: DoubleArray, values: DoubleArray, i: Int, x: Double): Double = when {
        x <= nodes[0] -> values[0]
        x >= nodes.last() -> values.last()
        else -> (values[i + 1] - values[i]) / (nodes[i + 1] - nodes[i]) * (x - nodes[i]) + values[i]
    }

    /** Sprague's polynomials (CIE 167:2005) for at least six evenly spaced nodes. */
    fun sprague(start: Double, step: Double, values: DoubleArray): DoubleArray {
        val last = values.size - 1
        val r = DoubleArray(values.size + 4) // node i is at index i + 2
        values.copyInto(r, 2)
        for ((row, at) in OUTER.withIndex().map { it.value to it.index }) {
            r[at] = weighted(row) { values[it] } / 209.0
            r[r.size - 1 - at] = weighted(row) { values[last - it] } / 209.0
        }
        return onGrid { wavelength ->
            val x = wavelength.coerceIn(start, start + step * last)
            val i = min(((x - start) / step).toInt(), last - 1)
            val u = (x - (start + step * i)) / step
            var total = 0.0
            for (row in INNER.reversed()) total = u * (weighted(row) { r[i + it] } / 24.0 + total)
            r[i + 2] + total
        }
    }

    private inline fun weighted(weights: DoubleArray, point: (Int) -> Double): Double {
        var total = weights[0] * point(0)
        for (k in 1 until weights.size) total += weights[k] * point(k)
        return total
    }

    /** Sprague's method if the nodes are evenly spaced; otherwise a cubic spline (not-a-knot). */
    fun smooth(nodes: DoubleArray, values: DoubleArray): DoubleArray {
        val step = (nodes.last() - nodes[0]) / (nodes.size - 1)
        val least = Bundled.limits.number("smallest_step")
        val even = nodes.indices.all { abs(nodes[it] - (nodes[0] + step * it)) <= least }
        return if (even) sprague(nodes[0], step, values) else spline(nodes, values)
    }

    /**
     * Not-a-knot cubic spline through at least four nodes: its third derivative is continuous at the second and the
     * last but one node.
     */
    fun spline(nodes: DoubleArray, values: DoubleArray): DoubleArray {
        val n = nodes.size
        val h = DoubleArray(n - 1) { nodes[it + 1] - nodes[it] }
        val slope = DoubleArray(n - 1) { (values[it + 1] - values[it]) / h[it] }
        // Second derivatives M: h[i-1] M[i-1] + 2 (h[i-1] + h[i]) M[i] + h[i] M[i+1] = 6 (slope[i] - slope[i-1]).
        val below = DoubleArray(n) { if (it in 1..n - 2) h[it - 1] else 0.0 }
        val middle = DoubleArray(n) { if (it in 1..n - 2) 2 * (h[it - 1] + h[it]) else 1.0 }
        val above = DoubleArray(n) { if (it in 1..n - 2) h[it] else 0.0 }
        val right = DoubleArray(n) { if (it in 1..n - 2) 6 * (slope[it] - slope[it - 1]) else 0.0 }
        val first = h[0] / h[1]
        middle[1] += h[0] * (1 + first)
        above[1] -= h[0] * first
        val end = h[n - 2] / h[n - 3]
        middle[n - 2] += h[n - 2] * (1 + end)
        below[n - 2] -= h[n - 2] * end
        for (i in 2..n - 2) {
            val factor = below[i] / middle[i - 1]
            middle[i] -= factor * above[i - 1]
            right[i] -= factor * right[i - 1]
        }
        val bend = DoubleArray(n)
        for (i in n - 2 downTo 1) {
            bend[i] = (right[i] - if (i < n - 2) above[i] * bend[i + 1] else 0.0) / middle[i]
        }
        bend[0] = (1 + first) * bend[1] - first * bend[2]
        bend[n - 1] = (1 + end) * bend[n - 2] - end * bend[n - 3]
        var i = 0
        return onGrid { wavelength ->
            val x = wavelength.coerceIn(nodes[0], nodes[n - 1])
            while (i < n - 2 && nodes[i + 1] <= x) i++
            val a = nodes[i + 1] - x
            val b = x - nodes[i]
            (bend[i] * a * a * a + bend[i + 1] * b * b * b) / (6 * h[i]) +
                (values[i] / h[i] - bend[i] * h[i] / 6) * a + (values[i + 1] / h[i] - bend[i + 1] * h[i] / 6) * b
        }
    }

    /** Mean over each step of the grid, by exact integration of the linear interpolant of the nodes. */
    fun stepMeans(nodes: DoubleArray, values: DoubleArray): DoubleArray {
        val grid = Grid.wavelengths
        val edges = DoubleArray(Grid.SIZE + 1) {
            if (it <
                Grid.SIZE
            ) {
                grid[it] - Grid.STEP / 2
            } else {
                grid[it - 1] + Grid.STEP / 2
            }
        }
        val knots = (nodes + edges).toSortedSet().toDoubleArray()
        var i = 0
        val heights = DoubleArray(knots.size) {
            while (i < nodes.size - 2 && nodes[i + 1] <= knots[it]) i++
            at(nodes, values, i, knots[it])
        }
        val area = DoubleArray(knots.size)
        for (k in 1 until knots.size) {
            area[k] = area[k - 1] + (knots[k] - knots[k - 1]) * (heights[k] + heights[k - 1]) / 2
        }
        val at = DoubleArray(edges.size) { area[knots.binarySearch(edges[it])] }
        return DoubleArray(Grid.SIZE) {
            max(0.0, (at[it + 1] - at[it]) / Grid.STEP)
        } // rounding may give a difference below zero
    }

    private inline fun onGrid(value: (Double) -> Double): DoubleArray {
        val grid = Grid.wavelengths
        return DoubleArray(Grid.SIZE) { value(grid[it]) }
    }
}
