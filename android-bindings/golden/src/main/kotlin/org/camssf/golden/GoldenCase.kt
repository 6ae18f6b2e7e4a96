package org.camssf.golden

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.boolean
import kotlinx.serialization.json.contentOrNull
import kotlinx.serialization.json.double
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.recovery.Tensor

/** A golden file breaks its format. */
public class GoldenError(message: String) : RuntimeException(message)

/** One limit of a case: the value, what it is held against, how, and how closely. */
internal class Limit(entry: JsonObject) {
    val value: String = entry.text("value")
    val against: String = entry.text("against")
    val metric: String = entry.text("metric")
    val bound: Double = entry.getValue("bound").jsonObject.getValue("float64").jsonPrimitive.double
    val requires: List<String> = entry.words("requires")
}

/**
 * A golden case (golden/format.md, format 1). It notes which of its inputs were read: one that nobody reads is an error,
 * since the answer does not depend on what the case says.
 */
internal class GoldenCase(private val json: JsonObject, private val forms: Forms) {
    val name: String = json.text("case")
    val stage: String = json.text("stage")
    val expect: String = json.text("expect")
    val requires: List<String> = json.words("requires")
    val basisHash: String? = json.getValue("basis_sha256").jsonPrimitive.contentOrNull
    val outputs: JsonObject? = json.getValue("outputs") as? JsonObject
    val limits: List<Limit> = json.getValue("limits").jsonArray.map { Limit(it.jsonObject) }
    private val inputs = json.getValue("inputs").jsonObject
    private val read = HashSet<String>()

    init {
        if (json.text("format") != "1") throw GoldenError("$name: not format 1")
    }

    /** What a limit is held against. */
    fun known(limit: Limit): JsonElement = json.getValue(limit.against).jsonObject.getValue(limit.value)

    /** An input; null where the case has none, or null. */
    fun find(name: String): JsonElement? {
        read += name
        return inputs[name]?.takeIf { it !is JsonPrimitive || it.contentOrNull != null }
    }

    operator fun get(name: String): JsonElement = find(name) ?: throw GoldenError("${this.name}: has no input $name")

    fun has(name: String): Boolean = find(name) != null

    fun text(name: String): String = get(name).jsonPrimitive.content

    fun number(name: String): Double? = find(name)?.let(::number)

    fun flag(name: String): Boolean? = find(name)?.jsonPrimitive?.boolean

    fun list(name: String): List<JsonElement> = (find(name) as? JsonArray).orEmpty()

    fun tensor(name: String): Tensor = forms.resolve(get(name))

    fun values(name: String): DoubleArray = tensor(name).values

    /** The inputs that were not read. */
    fun unread(): Set<String> = inputs.keys - read
}

internal fun JsonObject.text(name: String): String = getValue(name).jsonPrimitive.content

internal fun JsonObject.words(name: String): List<String> = getValue(name).jsonArray.map { it.jsonPrimitive.content }

/** A number, or null; JSON lacks NaN: it is written as a word. */
internal fun number(element: JsonElement): Double? = (element as JsonPrimitive).contentOrNull?.toDouble()

internal fun numbers(list: JsonElement): DoubleArray = list.jsonArray.map { number(it)!! }.toDoubleArray()
