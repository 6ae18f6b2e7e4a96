package org.camssf.golden

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.booleanOrNull
import kotlinx.serialization.json.doubleOrNull
import org.camssf.Grid
import org.camssf.recovery.Tensor
import kotlin.math.abs
import kotlin.math.pow
import kotlin.math.sqrt

/** The metrics of the golden vectors, as golden/format.md and golden/compare.py define them. */
internal object Metrics {
    /** How far an output is from numbers that are stored; infinite where the two cannot be compared. */
    fun measure(metric: String, output: Any?, b: Tensor): Double {
        val flat = (output as? DoubleArray)?.takeIf { it.size == b.values.size }
        val a = flat?.let { Tensor(it, *b.shape) } ?: tensorOf(output)
        if (a == null || !a.values.all { it.isFinite() }) return WRONG
        return when (metric) {
            "norm" -> (b.values.maxOfOrNull { abs(it) } ?: 0.0).let { size -> largest(a, b) { size } }
            "difference" -> largest(a, b) { 1.0 }
            "relative" -> largest(a, b) { abs(it) }
            "at_most" -> a.values.maxOrNull() ?: 0.0
            "peak" -> peak(a, b)
            "rmse" -> rmse(a, b)
            else -> throw GoldenError("there is no metric $metric of numbers")
        }
    }

    /** The largest difference in parts of the size, of which 0 stands for 1. */
    private fun largest(a: Tensor, b: Tensor, size: (Double) -> Double): Double {
        if (!a.hasShape(*b.shape)) return WRONG
        return a.values.indices.maxOfOrNull { i ->
            val part = size(b.values[i])
            abs(a.values[i] - b.values[i]) / if (part == 0.0) 1.0 else part
        } ?: 0.0
    }

    /** Curves against the 5-nm nodes (69, 3) of curves at peak 1. */
    private fun peak(a: Tensor, b: Tensor): Double {
        val ours = atPeak(a)
        if (ours == null || !b.hasShape(69, 3)) return WRONG
        return b.values.indices.maxOf { abs(ours[30 * (it / 3) + it % 3] - b.values[it]) }
    }

    private fun rmse(a: Tensor, b: Tensor): Double {
        val (ours, theirs) = listOf(a, b).map { atPeak(it) ?: return WRONG }
        return (0..2).sumOf { c ->
            sqrt((40..640).sumOf { (ours[3 * it + c] - theirs[3 * it + c]).pow(2) } / 601)
        } / 3
    }

    /** Curves (681, 3), each divided by its own peak; null for others, and without a positive peak. */
    private fun atPeak(curves: Tensor): DoubleArray? {
        if (!curves.hasShape(Grid.SIZE, 3)) return null
        val peaks = List(3) { c -> (0 until Grid.SIZE).maxOf { curves.values[3 * it + c] } }
        return DoubleArray(3 * Grid.SIZE) { curves.values[it] / peaks[it % 3] }.takeIf { peaks.min() > 0 }
    }

    private const val WRONG = Double.POSITIVE_INFINITY
}

/** Whether shapes and all values are those that are stored; 47 and 47.0 are one number. */
internal fun same(output: Any?, stored: JsonElement): Boolean = when (output) {
    null -> stored == JsonNull

    is Tensor -> same(nested(output), stored)

    is DoubleArray -> same(output.asList(), stored)

    is List<*> -> stored is JsonArray && sameAll(output, stored)

    is Map<*, *> ->
        stored is JsonObject && stored.keys == output.keys &&
            stored.all { same(output[it.key], it.value) }

    is Number -> stored is JsonPrimitive && !stored.isString && stored.doubleOrNull == output.toDouble()

    is Boolean -> stored is JsonPrimitive && !stored.isString && stored.booleanOrNull == output

    else -> stored is JsonPrimitive && stored.isString && stored.content == output
}

private fun sameAll(output: List<*>, stored: List<JsonElement>) =
    output.size == stored.size && output.indices.all { same(output[it], stored[it]) }

private fun nested(tensor: Tensor): Any =
    tensor.shape.drop(1).reversed().fold(tensor.values.asList() as List<Any>) { all, side -> all.chunked(side) }
        .let { if (tensor.rank == 0) it.single() else it }

/** Numbers in lists of any depth, of the library's or of JSON, as an array; null where there is something else. */
internal fun tensorOf(of: Any?): Tensor? = when (of) {
    is Tensor -> of
    is Number -> Tensor.scalar(of.toDouble())
    is JsonPrimitive -> if (of == JsonNull) null else Tensor.scalar(number(of))
    is DoubleArray -> Tensor(of, of.size)
    is List<*> -> stack(of.map { tensorOf(it) ?: return null })
    else -> null
}

private fun stack(parts: List<Tensor>) = if (parts.isEmpty()) Tensor(DoubleArray(0), 0) else Tensor.stack(parts)
