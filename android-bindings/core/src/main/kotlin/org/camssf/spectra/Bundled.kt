package org.camssf.spectra

import org.camssf.Grid
import org.camssf.Shipped
import org.camssf.flatten
import org.camssf.json.JsonText
import org.camssf.json.Members
import org.camssf.json.list
import org.camssf.json.members
import org.camssf.json.number
import org.camssf.json.numbers
import org.camssf.json.part
import org.camssf.json.text
import org.camssf.json.texts
import org.camssf.json.whole
import org.camssf.mean
import org.camssf.short
import kotlin.math.expm1
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.pow
import kotlin.math.round

/**
 * The bundled tables of lamps and charts (spectra.json, the same file as in Python) and CIE's formulas; see
 * docs/tables.md.
 */
internal object Bundled {
    private val file: Members by lazy {
        members(JsonText.parse(Shipped.text("spectra.json"))).also {
            check(it.text("format") == "camssf-spectra/1") { "spectra.json is of another version" }
        }
    }

    /** Parses the tables, which the first use of one does otherwise. */
    fun load() {
        file
    }

    val lamps: Set<String> get() = file.part("lamps").keys
    val families: Set<String> get() = file.part("families").keys
    val charts: List<String> get() = file.part("charts").texts("names")

    /** Chart tables by the word after the colon in a chart's name; the first is the default. */
    val tables: Map<String, String> get() = file.part("charts").part("tables").mapValues { it.value as String }

    /** Correlated colour temperatures of the illuminants that have one, K. */
    val kelvin: Map<String, Double> get() = file.part("kelvin").let { all -> all.mapValues { all.number(it.key) } }

    /** Limits of what is read, by their names in Python's `camssf.spectra.limits`, which says what they mean. */
    val limits: Members get() = file.part("limits")

    /** A tabulated CIE illuminant on the grid, (681); linear between its nodes. */
    fun illuminant(name: String): DoubleArray = linear(file.part("lamps").part(name), "values")

    private fun linear(table: Members, key: String): DoubleArray {
        val values = table.numbers(key)
        return Interpolation.linear(
            Interpolation.nodes(table.number("start"), table.number("step"), values.size),
            values,
        )
    }

    /** A bundled chart table, for the chart of this name. */
    fun chart(table: String, name: String, layout: ChartLayout): ChartTable {
        val entry = file.part("tables").part(table)
        val rows = entry.list("values").map { numbers(it) }
        val names = entry.texts("patches")
        val nodes = Interpolation.nodes(entry.number("start"), entry.number("step"), rows[0].size)
        val public = limits.number("public_chart")
        val tolerance = DoubleArray(names.size) { public }
        val white = entry.whole("white")
        val source = "$table (colour-science)"
        return ChartTable(name, table, layout, names, nodes, rows.flatten(), tolerance, white, source)
    }

    fun layouts(): List<ChartLayout> = file.part("layouts").map { (name, each) ->
        val entry = members(each)
        val (x, y) = entry.numbers("side").toList()
        ChartLayout(name, entry.whole("columns"), entry.whole("rows"), x, y)
    }

    /** The colour-matching functions x, y, z of a file on the grid, (681) each: CIE 1931 2°, or those of `from`. */
    fun observer(from: Members = file): List<DoubleArray> =
        listOf("x", "y", "z").map { linear(from.part("observer"), it) }

    /** Planck's law on the grid, (681), any scale: λ⁻⁵ / (exp(c₂ / λT) - 1), c₂ = 1.4388e-2 m K (CIE 15, ITS-90). */
    fun planck(kelvin: Double): DoubleArray {
        val grid = Grid.wavelengths
        return DoubleArray(Grid.SIZE) {
            (grid[it] / 560.0).pow(-5.0) / expm1(1.4388e-2 / (grid[it] * 1e-9 * kelvin))
        }
    }

    /**
     * CIE daylight of a correlated colour temperature on the grid, (681): CIE 15, with M₁ and M₂ rounded to three
     * decimals.
     */
    fun daylight(kelvin: Double): DoubleArray {
        val t = 1e3 / kelvin
        val x = if (kelvin <= 7000.0) {
            ((-4.6070 * t + 2.9678) * t + 0.09911) * t + 0.244063
        } else {
            ((-2.0064 * t + 1.9018) * t + 0.24748) * t + 0.237040
        }
        val y = (-3.0 * x + 2.87) * x - 0.275
        val m = 0.0241 + 0.2562 * x - 0.7341 * y
        val m1 = round(1000.0 * ((-1.3515 - 1.7703 * x + 5.9114 * y) / m)) / 1000.0
        val m2 = round(1000.0 * ((0.03 - 31.4424 * x + 30.0717 * y) / m)) / 1000.0
        val part = file.part("daylight")
        val (s0, s1, s2) = listOf("S0", "S1", "S2").map { part.numbers(it) }
        val values = DoubleArray(s0.size) { s0[it] + m1 * s1[it] + m2 * s2[it] }
        return Interpolation.linear(
            Interpolation.nodes(part.number("start"), part.number("step"), values.size),
            values,
        )
    }

    /** A lamp known only by kind: power (681), error modes (q) of (681), description for the report, tolerance. */
    fun family(name: String): Family {
        val entry = file.part("families").part(name)
        val tolerance = entry.number("tolerance")
        if ("formula" in entry) {
            val centre = entry.number("centre")
            val spread = entry.number("spread")
            return Family(
                planck(centre),
                listOf(temperatureMode(::planck, centre, spread)),
                "Planck, ${short(centre)} ± ${short(spread)} K",
                tolerance,
            )
        }
        if ("mean" in entry) return drawn(entry, entry, entry.text("source"))
        val members = entry.texts("members").map { scaled(illuminant(it)) }
        val power = DoubleArray(Grid.SIZE) { m -> members.sumOf { it[m] } / members.size }
        val least = entry.number("dimmest") * power.max()
        val weights = entry.list("weights").map { numbers(it) }
        return Family(
            power,
            weights.map { row ->
                DoubleArray(Grid.SIZE) { m ->
                    members.indices.sumOf { row[it] * members[it][m] } /
                        max(power[m], least)
                }
            },
            "mean and ${weights.size} principal components of ${members.size} CIE lamps",
            tolerance,
        )
    }

    /** The power scaled to a mean of 1. */
    fun scaled(power: DoubleArray): DoubleArray {
        val level = mean(power)
        return DoubleArray(power.size) { power[it] / level }
    }

    /** The shapes of a kind of drawn lamps with their shares; empty if it has none. */
    fun shapes(name: String): List<Pair<Family, Double>> {
        val whole = file.part("families").part(name)
        if ("shapes" !in whole) return emptyList()
        return whole.list("shapes").map { members(it) }.mapIndexed { i, shape ->
            drawn(whole, shape, "white LEDs of shape ${i + 1}") to shape.number("share")
        }
    }

    /** A kind of drawn lamps, or a shape of one, from its mean and modes at the nodes. */
    private fun drawn(whole: Members, own: Members, words: String): Family {
        fun onGrid(row: DoubleArray) = Interpolation.linear(
            Interpolation.nodes(whole.number("start"), whole.number("step"), row.size),
            row,
        )
        val power = onGrid(own.numbers("mean"))
        val least = whole.number("dimmest") * power.max()
        val modes = own.list("modes").map { row ->
            onGrid(numbers(row)).let { mode -> DoubleArray(Grid.SIZE) { mode[it] / max(power[it], least) } }
        }
        val source = "mean and ${modes.size} principal components of $words"
        return Family(power, modes, source, own.number("tolerance"))
    }

    class Family(val power: DoubleArray, val modes: List<DoubleArray>, val source: String, val tolerance: Double)

    /** Change of ln L for one standard deviation of a lamp's temperature, (681), by a central difference. */
    fun temperatureMode(formula: (Double) -> DoubleArray, centre: Double, spread: Double): DoubleArray {
        val high = logarithm(formula(centre + spread))
        val low = logarithm(formula(centre - spread))
        return DoubleArray(Grid.SIZE) { 0.5 * (high[it] - low[it]) }
    }

    /** ln L minus its mean over the grid; very small power is raised. */
    private fun logarithm(power: DoubleArray): DoubleArray {
        val least = limits.number("dimmest") * power.max()
        val level = DoubleArray(power.size) { ln(max(power[it], least)) }
        val middle = mean(level)
        return DoubleArray(power.size) { level[it] - middle }
    }
}
