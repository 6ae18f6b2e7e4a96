package org.camssf.golden

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.booleanOrNull
import kotlinx.serialization.json.doubleOrNull
import org.camssf.recovery.Tensor

/** Equality of shapes and all values; 47 and 47.0 are one number. */
internal object Exact {
    fun same(found: Any?, known: JsonElement): Boolean = when (found) {
        null -> known == JsonNull

        is Tensor -> same(nested(found), known)

        is DoubleArray -> same(found.toList(), known)

        is List<*> ->
            known is JsonArray && known.size == found.size &&
                found.indices.all { same(found[it], known[it]) }

        is Map<*, *> -> known is JsonObject && known.keys == found.keys && known.all { same(found[it.key], it.value) }

        else -> known is JsonPrimitive && when (found) {
            is Number -> !known.isString && known.doubleOrNull == found.toDouble()
            is Boolean -> !known.isString && known.booleanOrNull == found
            else -> known.isString && known.content == found
        }
    }

    private fun nested(tensor: Tensor): Any =
        tensor.shape.drop(1).reversed().fold(tensor.values.toList() as List<Any>) { all, side -> all.chunked(side) }
            .let { if (tensor.rank == 0) it.single() else it }
}

/** Numbers in lists of any depth as an array; null where there is something else. */
internal fun tensorOf(found: Any?): Tensor? = when (found) {
    is Tensor -> found

    is Number -> Tensor.scalar(found.toDouble())

    is DoubleArray -> Tensor(found, found.size)

    is List<*> -> if (found.isEmpty()) {
        Tensor(DoubleArray(0), 0)
    } else {
        Tensor.stack(
            found.map {
                tensorOf(it)
                    ?: return null
            },
        )
    }

    else -> null
}
