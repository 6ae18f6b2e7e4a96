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

    /** The numbers; nested lists of unequal length become one long list, for the checks to refuse. */
    fun resolve(value: JsonElement): Tensor = when (value) {
        is JsonObject -> form(value)
        is JsonArray -> nested(value)
        else -> Tensor.scalar(number(value) ?: throw GoldenError("null is no number"))
    }

    private fun form(form: JsonObject): Tensor = when (form.keys) {
        setOf("chart", "patches") -> {
            val table = values("charts", form.text("chart"))
            stacked(form.getValue("patches").jsonArray.map { row(table, it.jsonPrimitive.int - 1) })
        }

        setOf("chart", "mixtures") -> {
            val table = values("charts", form.text("chart"))
            stacked(
                List(form.getValue("mixtures").jsonPrimitive.int) { i ->
                    val t = 37 * i % 100 / 100.0
                    val a = row(table, i % 24)
                    val b = row(table, (7 * i + 5) % 24)
                    DoubleArray(Grid.SIZE) { (1.0 - t) * a[it] + t * b[it] }
                },
            )
        }

        setOf("lamps") -> stacked(form.getValue("lamps").jsonArray.map { lamp(it.jsonPrimitive.content) })

        setOf("constant", "shape") -> {
            val shape = form.getValue("shape").jsonArray.map { it.jsonPrimitive.int }.toIntArray()
            Tensor.full(number(form.getValue("constant"))!!, *shape)
        }

        setOf("polynomials") -> polynomials(form.getValue("polynomials").jsonArray)

        setOf("modes") -> modes(form.getValue("modes").jsonArray)

        setOf("camera") -> camera(form.text("camera"))

        setOf("bells") -> bells(form.getValue("bells").jsonArray)

        setOf("case", "output") -> {
            val other = GoldenCase.read(form.text("case"), files)
            resolve(other.outputs!!.getValue(form.text("output")))
        }

        else -> throw GoldenError("there is no input form with the keys ${form.keys.sorted()}")
    }

    private fun nested(value: JsonArray): Tensor {
        val numbers = ArrayList<Double>()
        val shape = shape(value, numbers)
        val all = numbers.toDoubleArray()
        return if (shape == null) Tensor(all, all.size) else Tensor(all, *shape)
    }

    /** Shape of nested lists, null if their lengths differ; collects the numbers. */
    private fun shape(value: JsonElement, into: ArrayList<Double>): IntArray? {
        if (value !is JsonArray) {
            into += number(value) ?: throw GoldenError("null is no number")
            return IntArray(0)
        }
        val inner = value.map { shape(it, into) }
        val first = inner.firstOrNull() ?: return if (inner.isEmpty()) intArrayOf(0) else null
        if (inner.any { it == null || !it.contentEquals(first) }) return null
        return intArrayOf(value.size) + first
    }

    private fun values(file: String, name: String): JsonArray {
        val known = spectra.getOrPut(file) {
            Json.parseToJsonElement(files.read("spectra/$file.json").decodeToString()).jsonObject
        }
        return known.getValue("values").jsonObject.getValue(name).jsonArray
    }

    private fun row(table: JsonArray, at: Int): DoubleArray = numbers(table[at].jsonArray)

    private fun numbers(list: JsonArray): DoubleArray = DoubleArray(list.size) { number(list[it])!! }

    private fun lamp(name: String): DoubleArray =
        if (name == "equal-energy") DoubleArray(Grid.SIZE) { 1.0 } else numbers(values("lamps", name))

    private fun stacked(rows: List<DoubleArray>): Tensor =
        Tensor(DoubleArray(rows.size * Grid.SIZE) { rows[it / Grid.SIZE][it % Grid.SIZE] }, rows.size, Grid.SIZE)

    private fun polynomials(shots: JsonArray): Tensor {
        val grid = Grid.wavelengths.values
        val modes = shots.map { shot -> shot.jsonArray.map { numbers(it.jsonArray) } }
        val q = modes.maxOf { it.size }
        val values = DoubleArray(modes.size * q * Grid.SIZE)
        modes.forEachIndexed { j, shot ->
            if (shot.size != q) throw GoldenError("shots have ${shot.size} and $q modes")
            shot.forEachIndexed { i, coefficients ->
                for (m in 0 until Grid.SIZE) {
                    val u = (grid[m] - 550.0) / 170.0
                    values[(j * q + i) * Grid.SIZE + m] = coefficients.foldRight(0.0) { c, total -> total * u + c }
                }
            }
        }
        return Tensor(values, modes.size, q, Grid.SIZE)
    }

    private fun camera(name: String): Tensor {
        val nodes = values("cameras", name).map { numbers(it.jsonArray) }
        val curves = List(3) { c -> straight(DoubleArray(nodes.size) { nodes[it][c] }) }
        return Tensor(DoubleArray(3 * Grid.SIZE) { curves[it % 3][it / 3] }, Grid.SIZE, 3)
    }

    /** Modes of each shot's kind of lamp, zeros where it has fewer than another, or no kind. */
    private fun modes(kinds: JsonArray): Tensor {
        val known = kinds.map { kind ->
            if (kind == JsonNull) return@map emptyList()
            values("modes", kind.jsonPrimitive.content).map { straight(numbers(it.jsonArray)) }
        }
        val q = known.maxOf { it.size }
        val values = DoubleArray(known.size * q * Grid.SIZE)
        known.forEachIndexed { j, own ->
            own.forEachIndexed { i, mode -> mode.copyInto(values, (j * q + i) * Grid.SIZE) }
        }
        return Tensor(values, known.size, q, Grid.SIZE)
    }

    /** On the grid what is known every 5 nm, straight between. */
    private fun straight(nodes: DoubleArray): DoubleArray {
        val grid = Grid.wavelengths.values
        return DoubleArray(Grid.SIZE) { m ->
            nodes.indices.sumOf { max(0.0, 1.0 - abs(grid[m] - (380.0 + 5 * it)) / 5.0) * nodes[it] }
        }
    }

    private fun bells(channels: JsonArray): Tensor {
        val grid = Grid.wavelengths.values
        val known = channels.map { channel -> channel.jsonArray.map { numbers(it.jsonArray) } }
        return Tensor(
            DoubleArray(3 * Grid.SIZE) { at ->
                known[at % 3].sumOf { (height, centre, sigma) ->
                    val u = (grid[at / 3] - centre) / sigma
                    height * exp(-0.5 * u * u)
                }
            },
            Grid.SIZE,
            3,
        )
    }
}
