package org.camssf.colour

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.double
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import java.io.File

/** The result of the golden case colour/named; its patches have no signals. */
internal object GoldenResult {
    private val document: JsonObject =
        Json.parseToJsonElement(File(System.getProperty("camssf.root"), "golden/cases/colour/named.json").readText())
            .jsonObject.getValue("inputs").jsonObject.getValue("result").jsonObject

    private fun JsonElement.part(name: String): JsonElement = jsonObject.getValue(name)

    val text: String = "$document"

    /** The curves, each of peak 1. */
    val curves: List<DoubleArray> = listOf("red", "green", "blue").map { channel ->
        val curve = document.part("answer").part("curves").part(channel)
        curve.jsonArray.map { it.jsonPrimitive.double }.toDoubleArray()
    }

    /** The text where the first light is unnamed; power and standard deviation if it was estimated. */
    fun unnamed(vararg light: Pair<DoubleArray, DoubleArray>): String {
        val lamp = document.part("capture").part("shots").jsonArray[0].part("lamp")
        val lights = light.map { (power, std) ->
            """{"kinds":{"daylight":1},"power":${power.toList()},"std":${std.toList()},"kelvin":5500,"kelvin_std":100}"""
        }
        return text.replace("\"lamp\":$lamp", "\"lamp\":{\"kind\":\"unnamed\",\"name\":\"auto\"}")
            .replace("\"answer\":{", "\"answer\":{\"lights\":$lights,")
    }
}
