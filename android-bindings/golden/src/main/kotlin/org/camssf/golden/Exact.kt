package org.camssf.golden

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.doubleOrNull
import org.camssf.recovery.Tensor

/** Equality of shapes and all values; 47 and 47.0 are one number. */
internal object Exact {
    fun same(found: Any?, known: JsonElement): Boolean = when (found) {
        null -> known == JsonNull
        is Tensor -> equal(nested(found), known)
        is JsonElement -> equal(found, known)
        is Number -> equal(JsonPrimitive(found), known)
        is Boolean -> equal(JsonPrimitive(found), known)
        is String -> equal(JsonPrimitive(found), known)
        else -> false
    }

    private fun equal(a: JsonElement, b: JsonElement): Boolean = when {
        a is JsonArray && b is JsonArray -> a.size == b.size && a.indices.all { equal(a[it], b[it]) }

        a is JsonObject && b is JsonObject -> a.keys == b.keys && a.all { equal(it.value, b.getValue(it.key)) }

        a is JsonPrimitive && b is JsonPrimitive -> {
            val numbers = a.doubleOrNull to b.doubleOrNull
            if (a.isString || b.isString || numbers.first == null) a == b else numbers.first == numbers.second
        }

        else -> false
    }

    private fun nested(tensor: Tensor, from: Int = 0, axis: Int = 0): JsonElement {
        if (axis == tensor.rank) return JsonPrimitive(tensor.values[from])
        val size = tensor.shape.drop(axis + 1).fold(1) { all, side -> all * side }
        return JsonArray(List(tensor.shape[axis]) { nested(tensor, from + it * size, axis + 1) })
    }
}
