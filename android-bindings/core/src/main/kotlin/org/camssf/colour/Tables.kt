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
import kotlin.math.roundToInt

/** Three curves or functions on [Grid], (3) of (681). */
internal typealias Three = Array<DoubleArray>

/** Reflectances of real surfaces, and standard observers: colour.json, the same file as in Python. */
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

    /** (n, 69) reflectances on the 5-nm nodes, linear between them. */
    val surfaces: Array<DoubleArray> by lazy {
        file.part("surfaces").list("values").map { numbers(it) }.toTypedArray()
    }

    /** (n) of (35) reflectances at [SurfaceNodes] of a kind, "general" or "skin". */
    fun library(kind: String): List<DoubleArray> {
        val library = file.part("library")
        val unit = library.number("unit")
        val every = (library.number("step") / file.part("surfaces").number("step")).roundToInt()
        val training = surfaces.map { row -> DoubleArray(SurfaceNodes.SIZE) { row[it * every] } }
        val sets = library.list("sets").map { it.jsonObject }.filter { it.text("kind") == kind }
        return (if (kind == "general") training else emptyList()) + sets.flatMap { set ->
            set.list("values").map { row -> numbers(row).also { for (n in it.indices) it[n] *= unit } }
        }
    }

    /** Absorption (35) of an absorber of skin at [SurfaceNodes]; 1 at its largest. */
    fun absorber(name: String): DoubleArray = file.part("absorbers").part("values").numbers(name)

    /** Colour-matching functions of each observer, linear between 1-nm nodes. */
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
