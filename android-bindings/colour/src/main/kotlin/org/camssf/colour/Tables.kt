package org.camssf.colour

import org.camssf.Grid
import org.camssf.json.JsonText
import org.camssf.json.Members
import org.camssf.json.list
import org.camssf.json.members
import org.camssf.json.number
import org.camssf.json.numbers
import org.camssf.json.part
import org.camssf.json.text
import org.camssf.spectra.Bundled
import kotlin.math.roundToInt

/** Three curves or functions on [Grid], (3) of (681). */
internal typealias Three = Array<DoubleArray>

/** Reflectances of real surfaces, and an observer: colour.json, the same file as in Python. */
internal object Tables {
    private val file: Members by lazy {
        val json = members(JsonText.parse(SurfaceModels.read("colour.json").decodeToString()))
        check(json.text("format") == "camssf-surfaces/1") { "colour.json is of another version" }
        json
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
        val sets = library.list("sets").map { members(it) }.filter { it.text("kind") == kind }
        return (if (kind == "general") training else emptyList()) + sets.flatMap { set ->
            set.list("values").map { row -> numbers(row).also { for (n in it.indices) it[n] *= unit } }
        }
    }

    /** Absorption (35) of an absorber of skin at [SurfaceNodes]; 1 at its largest. */
    fun absorber(name: String): DoubleArray = file.part("absorbers").part("values").numbers(name)

    /** Of each absorber of skin how much it changes within one person, as Python's `absorber_changes` says. */
    fun changes(): Map<String, DoubleArray> = file.part("absorbers").part("changes").let { of ->
        of.keys.associateWith { of.numbers(it) }
    }

    private val observers: Map<Observer, Three> by lazy {
        val functions = mapOf(Observer.CIE_1931 to Bundled.observer(), Observer.CIE_1964 to Bundled.observer(file))
        functions.mapValues { (_, xyz) -> xyz.toTypedArray() }
    }

    /** Colour-matching functions, linear between 1-nm nodes. */
    fun observer(of: Observer): Three = observers.getValue(of)
}
