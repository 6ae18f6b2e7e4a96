package org.camssf.golden

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.int
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.Grid
import org.camssf.recovery.Tensor
import kotlin.math.abs
import kotlin.math.exp
import kotlin.math.max

/** What an input stands for (golden/format.md, Input forms). */
internal class Forms(private val files: GoldenFiles) {
    private val spectra = HashMap<String, JsonObject>()

    /** A case by its name. */
    fun case(name: String): GoldenCase = GoldenCase(parsed("cases/$name.json"), this)

    private fun parsed(path: String): JsonObject =
        Json.parseToJsonElement(files.read(path).decodeToString()).jsonObject

    /** The numbers. */
    fun resolve(value: JsonElement): Tensor = when (value) {
        is JsonObject -> form(value)
        is JsonArray -> if (value.isEmpty()) Tensor(DoubleArray(0), 0) else Tensor.stack(value.map { resolve(it) })
        else -> Tensor.scalar(number(value) ?: throw GoldenError("null is no number"))
    }

    private fun form(form: JsonObject): Tensor = when (form.keys) {
        setOf("chart", "patches") -> {
            val table = values("charts", form.text("chart"))
            tensorOf(form.getValue("patches").jsonArray.map { row(table, it.jsonPrimitive.int - 1) })!!
        }

        setOf("lamps") -> tensorOf(form.getValue("lamps").jsonArray.map { lamp(it.jsonPrimitive.content) })!!

        setOf("constant", "shape") -> {
            val shape = form.getValue("shape").jsonArray.map { it.jsonPrimitive.int }.toIntArray()
            Tensor.full(number(form.getValue("constant"))!!, *shape)
        }

        setOf("polynomials") -> polynomials(form.getValue("polynomials").jsonArray)

        setOf("modes") -> modes(form.getValue("modes").jsonArray.map { kind(it) })

        setOf("camera") -> camera(form.text("camera"))

        setOf("bells") -> bells(form.getValue("bells").jsonArray)

        else -> throw GoldenError("there is no input form with the keys ${form.keys.sorted()}")
    }

    private fun values(file: String, name: String): JsonArray {
        val known = spectra.getOrPut(file) { parsed("spectra/$file.json").getValue("values").jsonObject }
        return known.getValue(name).jsonArray
    }

    private fun row(table: JsonArray, at: Int): DoubleArray = numbers(table[at])

    private fun lamp(name: String): DoubleArray =
        if (name == "equal-energy") DoubleArray(Grid.SIZE) { 1.0 } else numbers(values("lamps", name))

    private fun polynomials(shots: JsonArray): Tensor = modes(
        shots.map { shot ->
            shot.jsonArray.map { numbers(it) }.map { coefficients ->
                onGrid { nm ->
                    val u = (nm - 550.0) / 170.0
                    coefficients.foldRight(0.0) { c, total -> total * u + c }
                }
            }
        },
    )

    /** (k, q, points) modes of each shot, zeros where it has fewer than another. */
    private fun modes(shots: List<List<DoubleArray>>): Tensor {
        val q = shots.maxOf { it.size }
        val values = DoubleArray(shots.size * q * Grid.SIZE)
        shots.forEachIndexed { j, own ->
            own.forEachIndexed { i, mode -> mode.copyInto(values, (j * q + i) * Grid.SIZE) }
        }
        return Tensor(values, shots.size, q, Grid.SIZE)
    }

    private fun camera(name: String): Tensor {
        val nodes = values("cameras", name).map { numbers(it) }
        return curves(1) { c -> straight(DoubleArray(nodes.size) { nodes[it][c] }) }
    }

    /** Modes of a kind of lamp; none of no kind. */
    private fun kind(name: JsonElement): List<DoubleArray> =
        if (name ==
            JsonNull
        ) {
            emptyList()
        } else {
            values("modes", name.jsonPrimitive.content).map { straight(numbers(it)) }
        }

    /** On the grid what is known every 5 nm, straight between. */
    private fun straight(nodes: DoubleArray): DoubleArray = onGrid { nm ->
        nodes.indices.sumOf { max(0.0, 1.0 - abs(nm - (380.0 + 5 * it)) / 5.0) * nodes[it] }
    }

    private fun bells(channels: JsonArray): Tensor = curves(1) { c ->
        val known = channels[c].jsonArray.map { numbers(it) }
        onGrid { nm ->
            known.sumOf { (height, centre, sigma) ->
                val u = (nm - centre) / sigma
                height * exp(-0.5 * u * u)
            }
        }
    }

    private fun onGrid(of: (Double) -> Double) = DoubleArray(Grid.SIZE) { of(Grid.wavelengths.values[it]) }
}
