package org.camssf.golden

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.boolean
import kotlinx.serialization.json.contentOrNull
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.Grid
import org.camssf.recovery.Tensor
import kotlin.math.abs
import kotlin.math.exp
import kotlin.math.max
import kotlin.math.pow

/** A golden file breaks its format. */
public class GoldenError(message: String) : RuntimeException(message)

/** One limit of a case: the value, what it is held against, how, and how closely. */
internal class Limit(entry: Fields) {
    val value: String = entry.text("value")
    val against: String = entry.text("against")
    val metric: String = entry.text("metric")
    val bound: Double = entry.part("bound")!!.number("float64")
    val requires: List<String> = entry.words("requires")

    override fun toString(): String = "$value against $against, $metric"
}

/** A golden case (golden/format.md, format 1): its inputs, and what must come of them. */
internal class GoldenCase(private val json: Fields) :
    Fields(json["inputs"].jsonObject, json.forms, json.text("case")) {
    val name: String = json.text("case")
    val stage: String = json.text("stage")
    val expect: String = json.text("expect")
    val basisHash: String? = json.findText("basis_sha256")
    val limits: List<Limit> = json.parts("limits").map { Limit(it) }

    /** The outputs that are null. */
    val absent: Set<String> = json.find("outputs")?.jsonObject.orEmpty().filterValues { it == JsonNull }.keys

    init {
        if (json.text("format") != "1") throw GoldenError("$name: not format 1")
    }

    /** What a limit is held against. */
    fun stored(limit: Limit): JsonElement = json.part(limit.against)!![limit.value]
}

/** An object of a golden file; it notes which keys were read, since the answer does not depend on the others. */
internal open class Fields(private val json: JsonObject, val forms: Forms, private val where: String) {
    private val read = HashSet<String>()
    private val parts = ArrayList<Fields>()

    /** A value; null where there is none, or null. */
    fun find(name: String): JsonElement? {
        read += name
        return json[name]?.takeIf { it != JsonNull }
    }

    operator fun get(name: String): JsonElement = find(name) ?: throw GoldenError("$where: there is no $name")

    fun has(name: String): Boolean = find(name) != null

    fun text(name: String): String = get(name).jsonPrimitive.content

    fun findText(name: String): String? = find(name)?.jsonPrimitive?.content

    fun number(name: String): Double = findNumber(name) ?: throw GoldenError("$where: there is no $name")

    fun findNumber(name: String): Double? = find(name)?.let { number(it) }

    fun flag(name: String): Boolean? = find(name)?.jsonPrimitive?.boolean

    fun list(name: String): List<JsonElement> = (find(name) as? JsonArray).orEmpty()

    fun words(name: String): List<String> = list(name).map { it.jsonPrimitive.content }

    fun integers(name: String): IntArray = list(name).map { number(it).toInt() }.toIntArray()

    fun rows(name: String): List<DoubleArray> = list(name).map { numbers(it) }

    fun tensor(name: String): Tensor = forms.resolve(get(name))

    fun values(name: String): DoubleArray = tensor(name).values

    fun findValues(name: String): DoubleArray? = find(name)?.let { forms.resolve(it).values }

    /** An object in this one; null where there is none. */
    fun part(name: String): Fields? = find(name)?.let { part(it, name) }

    fun parts(name: String): List<Fields> = list(name).map { part(it, name) }

    private fun part(json: JsonElement, name: String) =
        Fields(json.jsonObject, forms, "$where, $name").also { parts += it }

    /** The keys that were not read, in this object and its parts. */
    fun unread(): Set<String> = (json.keys - read) + parts.flatMap { it.unread() }
}

/** A number; JSON lacks NaN: it is written as a word. */
internal fun number(element: JsonElement): Double = element.jsonPrimitive.content.toDouble()

internal fun numbers(list: JsonElement): DoubleArray = list.jsonArray.map { number(it) }.toDoubleArray()

/** Curves (points, 3) of three channels, every `step`-th point of the grid. */
internal fun curves(step: Int, of: (Int) -> DoubleArray): Tensor {
    val channels = List(3) { of(it) }
    val points = (Grid.SIZE + step - 1) / step
    return Tensor(DoubleArray(3 * points) { channels[it % 3][step * (it / 3)] }, points, 3)
}

/** What an input stands for (golden/format.md, Input forms). */
internal class Forms(private val files: GoldenFiles) {
    private val known = HashMap<String, Fields>()

    /** A case by its name. */
    fun case(name: String): GoldenCase = GoldenCase(parsed("cases/$name.json"))

    private fun parsed(path: String) =
        Fields(Json.parseToJsonElement(files.read(path).decodeToString()).jsonObject, this, path)

    /** The numbers of an input, or of a stored output. */
    fun resolve(value: JsonElement): Tensor =
        (value as? JsonObject)?.let { form(Fields(it, this, "an input form"), it.keys) } ?: tensorOf(value)!!

    private fun form(form: Fields, keys: Set<String>): Tensor = when (keys) {
        setOf("chart", "patches") -> patches(spectra("charts").rows(form.text("chart")), form.integers("patches"))
        setOf("lamps") -> tensorOf(form.words("lamps").map { lamp(it) })!!
        setOf("constant", "shape") -> Tensor.full(form.number("constant"), *form.integers("shape"))
        setOf("polynomials") -> modes(form.list("polynomials").map { shot -> shot.jsonArray.map { polynomial(it) } })
        setOf("modes") -> modes(form.list("modes").map { kind(it) })
        setOf("camera") -> camera(spectra("cameras").rows(form.text("camera")))
        setOf("bells") -> curves(1) { c -> bells(form.list("bells")[c].jsonArray.map { numbers(it) }) }
        else -> throw GoldenError("there is no input form with the keys ${keys.sorted()}")
    }

    private fun spectra(file: String) = known.getOrPut(file) { parsed("spectra/$file.json").part("values")!! }

    private fun patches(chart: List<DoubleArray>, patches: IntArray) = tensorOf(patches.map { chart[it - 1] })!!

    private fun lamp(name: String): DoubleArray =
        if (name == "equal-energy") DoubleArray(Grid.SIZE) { 1.0 } else spectra("lamps").values(name)

    /** Modes of a kind of lamp; none of no kind. */
    private fun kind(name: JsonElement): List<DoubleArray> =
        name.jsonPrimitive.contentOrNull?.let {
            spectra("modes").rows(it).map { mode -> straight(mode.asList()) }
        }.orEmpty()

    /** (k, q, points) modes of each shot, zeros where it has fewer than another. */
    private fun modes(shots: List<List<DoubleArray>>): Tensor {
        val q = shots.maxOf { it.size }
        val values = shots.flatMap { own -> List(q) { own.getOrNull(it) ?: DoubleArray(Grid.SIZE) } }
        return Tensor(values.flatMap { it.asList() }.toDoubleArray(), shots.size, q, Grid.SIZE)
    }

    private fun polynomial(of: JsonElement): DoubleArray {
        val coefficients = numbers(of)
        return onGrid { nm -> coefficients.foldRight(0.0) { c, total -> total * ((nm - 550.0) / 170.0) + c } }
    }

    private fun camera(nodes: List<DoubleArray>) = curves(1) { c -> straight(nodes.map { it[c] }) }

    /** On the grid what is known every 5 nm, straight between. */
    private fun straight(nodes: List<Double>): DoubleArray = onGrid { nm ->
        nodes.indices.sumOf { max(0.0, 1.0 - abs(nm - (380.0 + 5 * it)) / 5.0) * nodes[it] }
    }

    private fun bells(known: List<DoubleArray>): DoubleArray = onGrid { nm ->
        known.sumOf { (height, centre, sigma) -> height * exp(-0.5 * ((nm - centre) / sigma).pow(2)) }
    }

    private fun onGrid(of: (Double) -> Double) = DoubleArray(Grid.SIZE) { of(Grid.wavelengths.values[it]) }
}
