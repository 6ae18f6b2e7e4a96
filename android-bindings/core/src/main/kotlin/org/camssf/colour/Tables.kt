package org.camssf.colour

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.jsonObject
import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.model.Models
import org.camssf.spectra.Interpolation
import org.camssf.spectra.list
import org.camssf.spectra.number
import org.camssf.spectra.numbers
import org.camssf.spectra.part
import org.camssf.spectra.text
import kotlin.math.ceil
import kotlin.math.exp
import kotlin.math.sqrt

/** Three curves or functions on [Grid], one behind the other: (3) of (681). */
internal typealias Three = Array<DoubleArray>

/** Real surfaces and standard observers: Python's own table (colour.json). */
internal object Tables {
    private val file: JsonObject by lazy {
        val found = try {
            Json.parseToJsonElement(Models.read("colour.json").decodeToString()).jsonObject
        } catch (error: IllegalStateException) {
            throw InvalidArgument(
                error.message.orEmpty(),
                "Add camssf-core and camssf-model unchanged.",
                cause = error,
            )
        }
        check(found.text("format") == "camssf-surfaces/1") { "colour.json is of another version" }
        found
    }

    /** (n, 69) reflectances on the 5-nm nodes, straight between them. */
    val surfaces: Array<DoubleArray> by lazy {
        file.part("surfaces").list("values").map { numbers(it) }.toTypedArray()
    }

    /** Colour-matching functions of each observer, straight between 1-nm nodes. */
    private val observers: Map<String, Three> by lazy {
        val table = file.part("observers")
        table.part("values").mapValues { (_, rows) ->
            val own = JsonObject(mapOf("rows" to rows)).list("rows").map { numbers(it) }
            Array(3) {
                Interpolation.linear(
                    Interpolation.nodes(table.number("start"), table.number("step"), own[it].size),
                    own[it],
                )
            }
        }
    }

    fun observer(of: Observer): Three = observers.getValue(of.word)
}

/** The 5-nm nodes, between which surfaces and bases run straight. */
internal object Nodes {
    const val SIZE = 69
    private const val EACH = 10

    /** Onto the nodes (69) as the adjoint of [straight]: Σ f s over the grid is Σ fold(f) s over the nodes. */
    fun fold(values: DoubleArray): DoubleArray {
        val found = DoubleArray(SIZE)
        for (m in values.indices) {
            val share = (m % EACH) / EACH.toDouble()
            found[m / EACH] += (1 - share) * values[m]
            if (share > 0) found[m / EACH + 1] += share * values[m]
        }
        return found
    }

    /** On the grid what is known on the nodes. */
    inline fun straight(node: (Int) -> Double): DoubleArray = DoubleArray(Grid.SIZE) { m ->
        val share = (m % EACH) / EACH.toDouble()
        val left = node(m / EACH)
        if (share > 0) (1 - share) * left + share * node(m / EACH + 1) else left
    }
}

/**
 * Directions of an error that is smooth over a length ℓ, nm, one standard deviation each, (681): white noise on points
 * ℓ/2 apart, smoothed.
 */
internal fun smoothErrors(length: Double): List<DoubleArray> {
    val step = length / 2
    val weight = sqrt(step / (length * sqrt(Math.PI / 2)))
    val grid = Grid.WAVELENGTHS
    return List(ceil((340 + 4 * length) / step).toInt() + 1) { q ->
        val place = 380 - 2 * length + step * q
        DoubleArray(Grid.SIZE) {
            val u = (grid[it] - place) / length
            weight * exp(-u * u)
        }
    }
}
