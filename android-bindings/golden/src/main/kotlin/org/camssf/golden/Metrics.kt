package org.camssf.golden

import org.camssf.Grid
import org.camssf.recovery.Tensor
import kotlin.math.abs
import kotlin.math.sqrt

/** The metrics of the golden vectors, as golden/format.md and golden/compare.py define them. */
internal object Metrics {
    /** Of a flat array as many numbers are asked as are known. */
    fun measure(metric: String, found: Any?, known: Tensor): Double {
        val flat = (found as? DoubleArray)?.takeIf { it.size == known.values.size }
        val tensor = if (flat == null) tensorOf(found) else Tensor(flat, *known.shape)
        return if (tensor == null) WRONG else measure(metric, tensor, known)
    }

    private fun measure(metric: String, a: Tensor, b: Tensor): Double = when (metric) {
        "norm" -> norm(a, b)
        "difference" -> worst(a, b) { 1.0 }
        "relative" -> relative(a, b)
        "at_most" -> if (a.values.all { it.isFinite() }) a.values.maxOrNull() ?: 0.0 else WRONG
        "peak" -> peak(a, b)
        "rmse" -> rmse(a, b)
        else -> throw GoldenError("there is no metric $metric of numbers")
    }

    private fun comparable(a: Tensor, b: Tensor): Boolean =
        a.shape.contentEquals(b.shape) && a.values.all { it.isFinite() }

    private fun norm(a: Tensor, b: Tensor): Double {
        val size = b.values.maxOfOrNull { abs(it) } ?: 0.0
        return worst(a, b) { size }
    }

    private fun relative(a: Tensor, b: Tensor): Double = worst(a, b) { abs(it) }

    /** The largest difference in parts of the size, of which 0 stands for 1. */
    private fun worst(a: Tensor, b: Tensor, size: (Double) -> Double): Double {
        if (!comparable(a, b)) return WRONG
        return a.values.indices.maxOfOrNull { i ->
            val part = size(b.values[i])
            abs(a.values[i] - b.values[i]) / if (part == 0.0) 1.0 else part
        } ?: 0.0
    }

    /** Curves (681, 3), each divided by its own peak, against the 5-nm nodes (69, 3) of curves at peak 1. */
    private fun peak(a: Tensor, b: Tensor): Double {
        val peaks = peaks(a) ?: return WRONG
        if (!a.hasShape(Grid.SIZE, 3) || !b.hasShape(NODES, 3)) return WRONG
        return b.values.indices.maxOf { abs(a.values[30 * (it / 3) + it % 3] / peaks[it % 3] - b.values[it]) }
    }

    private fun rmse(a: Tensor, b: Tensor): Double {
        if (!a.hasShape(Grid.SIZE, 3) || !b.hasShape(Grid.SIZE, 3)) return WRONG
        val ours = peaks(a) ?: return WRONG
        val theirs = peaks(b) ?: return WRONG
        return (0..2).sumOf { c ->
            val square = (40..640).sumOf {
                val off = a.values[3 * it + c] / ours[c] - b.values[3 * it + c] / theirs[c]
                off * off
            }
            sqrt(square / 601)
        } / 3
    }

    private fun peaks(curves: Tensor): DoubleArray? {
        if (curves.rank != 2 || !curves.values.all { it.isFinite() }) return null
        val peaks = DoubleArray(3) { c -> (0 until curves.shape[0]).maxOf { curves.values[3 * it + c] } }
        return peaks.takeIf { all -> all.all { it > 0 } }
    }

    const val WRONG = Double.POSITIVE_INFINITY
}
