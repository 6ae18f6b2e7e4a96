package org.camssf.documents

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonObjectBuilder
import kotlinx.serialization.json.JsonPrimitive

/** The numbers as a JSON array, unrounded; matrices row by row. */
internal fun array(values: DoubleArray): JsonArray = JsonArray(values.map { JsonPrimitive(it) })

internal fun JsonObjectBuilder.text(name: String, value: String) {
    put(name, JsonPrimitive(value))
}
