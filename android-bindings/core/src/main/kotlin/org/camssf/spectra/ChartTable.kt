package org.camssf.spectra

import org.camssf.ChartUnfit
import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.Refusal
import org.camssf.Rows
import org.camssf.Rules
import org.camssf.flatten
import org.camssf.frozen
import org.camssf.json.number
import org.camssf.json.range
import org.camssf.short
import kotlin.math.pow
import kotlin.math.sqrt

/**
 * Reflectances (n, 681), row-major, of a chart whose colours have faded by v: R + v (R̄ - R), R̄ the mean over the grid.
 */
internal fun faded(reflectance: DoubleArray, amount: Double): DoubleArray {
    val means = DoubleArray(reflectance.size / Grid.SIZE) { i ->
        (0 until Grid.SIZE).sumOf { reflectance[i * Grid.SIZE + it] } / Grid.SIZE
    }
    return DoubleArray(reflectance.size) { reflectance[it] + amount * (means[it / Grid.SIZE] - reflectance[it]) }
}

/**
 * The measured reflectances of a chart. Safe to pass between threads.
 *
 * @property name of the chart as given, for example "classic24".
 * @property table name of the table, for example "BabelColor Average".
 * @property layout its printed geometry.
 * @property white index of the white patch.
 * @property source description for the report.
 * @property file name and SHA-256 of its file, or null.
 */
public class ChartTable internal constructor(
    public val name: String,
    public val table: String,
    public val layout: ChartLayout,
    patches: List<String>,
    /** (w) nodes of the table, nm. */
    internal val wavelengths: DoubleArray,
    /** (n, w) reflectance as the table has it, 0 to 1. */
    internal val reflectance: DoubleArray,
    internal val sharedTolerance: DoubleArray,
    public val white: Int,
    public val source: String,
    public val file: SourceFile? = null,
    /** Part v of its colour that the chart has lost, 0 to 1. */
    internal val fading: Double = 0.0,
) {
    /** (n) patch names in reading order from the chart's top left. */
    public val patches: List<String> = patches.frozen()

    internal val sharedValues: DoubleArray by lazy {
        val values = if (wavelengths.contentEquals(Grid.wavelengths.values)) reflectance else onGrid()
        if (fading == 0.0) values else faded(values, fading)
    }

    private fun onGrid(): DoubleArray = List(this.patches.size) {
        Interpolation.smooth(wavelengths, reflectance.copyOfRange(it * wavelengths.size, (it + 1) * wavelengths.size))
    }.flatten().also { all ->
        val most = Bundled.limits.number("largest_reflectance")
        for (i in all.indices) all[i] = all[i].coerceIn(0.0, most)
    }

    override fun toString(): String = "ChartTable($name, $table)"

    /** (n, 681) reflectance on [Grid], 0 to 1. */
    public val values: Rows get() = Rows(sharedValues, patches.size, Grid.SIZE)

    /**
     * (n, 3) signals of a generic camera with Gaussian curves under a flat lamp, row-major, any unit; the finder compares pictures with them.
     */
    public fun genericSignals(): DoubleArray = genericSignals(null)

    /** The same under a lamp of this power (681); null for a flat spectrum. */
    internal fun genericSignals(power: DoubleArray?): DoubleArray {
        val grid = Grid.wavelengths
        val fwhm = Rules.shipped.number("pose.fwhm")
        val curves = listOf("red", "green", "blue").map { colour ->
            val centre = Rules.shipped.number("pose.$colour")
            val curve = DoubleArray(Grid.SIZE) {
                2.0.pow(-4 * ((grid[it] - centre) / fwhm).pow(2)) * (power?.get(it) ?: 1.0)
            }
            val total = curve.sum()
            DoubleArray(Grid.SIZE) { curve[it] / total }
        }
        return DoubleArray(3 * patches.size) { i ->
            val from = i / 3 * Grid.SIZE
            (0 until Grid.SIZE).sumOf { sharedValues[from + it] * curves[i % 3][it] }
        }
    }

    /** (n) one standard deviation of the table's relative error for an individual chart, 1. */
    public val tolerance: Rows get() = Rows(sharedTolerance, patches.size)

    /**
     * The table with another relative error of an individual chart, one standard deviation: 0.01 for 1 %.
     *
     * @throws InvalidArgument no number from 0 to 0.5.
     */
    public fun withTolerance(tolerance: Double): ChartTable {
        val most = Bundled.limits.number("largest_chart_tolerance")
        if (!(tolerance in 0.0..most)) {
            throw InvalidArgument(
                "The chart's tolerance is ${short(tolerance)}; 0 to ${short(most)} is possible.",
                "Write 1 % as 0.01.",
            )
        }
        return with(tolerance = DoubleArray(patches.size) { tolerance })
    }

    /** The table of a chart whose colours have faded by `amount`. */
    internal fun faded(amount: Double): ChartTable = if (amount == 0.0) this else with(fading = amount)

    private fun with(tolerance: DoubleArray = sharedTolerance, fading: Double = this.fading): ChartTable = ChartTable(
        name, table, layout, patches, wavelengths, reflectance, tolerance, white, source, file, fading,
    )

    /** Whether the table is a published one, not measured by the user. */
    internal val public: Boolean get() = table in Bundled.tables.values

    /** The chart's other public tables, with the same tolerance, if this is the default one and not named. */
    internal fun otherTables(): List<ChartTable> {
        if (name !in Bundled.charts || table != Bundled.tables.values.first()) return emptyList()
        return Bundled.tables.keys.drop(1).map { read("$name:$it").with(tolerance = sharedTolerance) }
    }

    internal fun reflectance(patch: Int): DoubleArray =
        sharedValues.copyOfRange(patch * Grid.SIZE, (patch + 1) * Grid.SIZE)

    public companion object {
        private val COUNTS = mapOf(24 to "classic24", 140 to "sg140")
        private const val MENU =
            "Charts: classic24, nano24, mini24, passport24 (add :babelcolor or :ohta to fix the table), or a file " +
                "of measured reflectances by ChartTable.parse; sg140 by such a file only; another chart by its " +
                "layout (ChartLayout.parse) and such a file."

        /** Names that [read] accepts. */
        @JvmStatic
        public fun names(): List<String> = Bundled.charts + Bundled.charts.map { "$it:ohta" }

        /**
         * Reads the reflectances of a chart by name: `classic24`, `nano24`, `mini24`, `passport24`: BabelColor's
         * average of 30 charts, or Ohta's table where the signals clearly speak for it; `:babelcolor` or `:ohta` fixes
         * the table. The tolerance is 3 %.
         *
         * Threads: any once an `SsfCalibrator` was opened, which loads the tables; before, any but the main one.
         *
         * @throws InvalidArgument an unknown name.
         */
        @JvmStatic
        public fun read(spec: String): ChartTable {
            val text = spec.trim()
            val chart = text.substringBefore(':').lowercase()
            val tail = text.substringAfter(':', "").lowercase()
            val table = if (tail.isEmpty()) Bundled.tables.values.first() else Bundled.tables[tail]
            if (chart == "sg140") {
                throw InvalidArgument(
                    "camssf has no table of the ColorChecker Digital SG.",
                    "Give a file of measured reflectances, 140 patches, to ChartTable.parse (CSV or CGATS).",
                )
            }
            if (chart !in Bundled.charts || table == null) {
                throw InvalidArgument(
                    if (text.isEmpty()) "The chart is missing." else "No chart is called '$text'.",
                    MENU,
                )
            }
            return Bundled.chart(table, text, ChartLayout.of(chart)!!)
        }

        /** As the other `parse`, with the usual layout of so many patches. */
        @JvmStatic
        public fun parse(name: String, content: ByteArray): ChartTable = parse(name, content, null as String?)

        /**
         * Parses measured reflectances of an individual chart (CSV or CGATS): 24 or 140 patches in reading order,
         * unless the file names them by position (A1 ...). Values are read as percent if any exceeds 2. Outside the
         * file's wavelengths reflectance is held constant; the file must cover 400 to 700 nm in steps of 20 nm at
         * most. The tolerance is 1 %.
         *
         * Threads: any but the main one.
         *
         * @param name of the file, for messages and the result.
         * @param layout for example "nano24"; null for the default of this number of patches.
         * @throws InvalidArgument the content is not such a table, or has a wrong number of patches.
         * @throws ChartUnfit too few wavelengths, a reflectance outside 0 to 1.2 or not finite, no neutral patch, or
         *   24 colours that are not in reading order.
         */
        @JvmStatic
        public fun parse(name: String, content: ByteArray, layout: String?): ChartTable {
            val printed = layout?.let {
                ChartLayout.of(it) ?: throw InvalidArgument("There is no chart layout '$it'.", MENU)
            }
            return measured(name, content, printed)
        }

        /** As above, for the layout of another chart, as [ChartLayout.parse] reads it. */
        @JvmStatic
        public fun parse(name: String, content: ByteArray, layout: ChartLayout): ChartTable =
            measured(name, content, layout)

        private fun measured(name: String, content: ByteArray, given: ChartLayout?): ChartTable {
            val file = SpectraFile.spectra(name, content)
            val count = file.values.size
            val layout = given ?: COUNTS[count]?.let { ChartLayout.of(it) }
            if (layout == null || layout.columns * layout.rows != count) {
                val has = layout?.let { ", ${it.name} has ${it.columns * it.rows}." } ?: "."
                throw InvalidArgument(
                    "$name holds $count patches$has",
                    if (layout != null && !layout.shipped) {
                        "Give one spectrum for each patch of the layout."
                    } else {
                        "classic24, nano24, mini24 and passport24 have 24, sg140 has 140; give one spectrum for " +
                            "each patch, or the layout of another chart by ChartLayout.parse (docs/tables.md)."
                    },
                    count.toDouble(),
                )
            }
            SpectraFile.checkWavelengths(file.wavelengths, name, "chart_unfit")
            val order = readingOrder(file.names, layout)
            val reflectance = shares(file, name)
            val tolerance = Bundled.limits.number("measured_chart")
            fun table(white: Int) = ChartTable(
                if (given == null) name else "${given.name}:$name",
                name,
                layout,
                order.map { file.names[it] },
                file.wavelengths,
                order.map { reflectance[it] }.flatten(),
                DoubleArray(count) { tolerance },
                white,
                "file $name${SpectraFile.held(file.wavelengths)}",
                SourceFile.of(name, content),
            )
            val values = table(0).let { first -> List(count) { first.reflectance(it) } }
            if (layout.shipped && count == 24) checkOrder(values, name)
            return table(white(values, order.map { file.names[it] }, layout, name))
        }

        /** The file's reflectances as parts of 1, checked. */
        private fun shares(file: Spectra, name: String): List<DoubleArray> {
            if (file.values.any { row -> row.any { !it.isFinite() } }) {
                throw Refusal.of("chart_unfit.not_a_number", "file" to name)
            }
            val most = file.values.maxOf { it.max() }
            val scale = if (most > Bundled.limits.number("percent")) 100.0 else 1.0
            val least = file.values.minOf { it.min() } / scale
            val worst = if (least < 0) least else most / scale
            if (worst !in 0.0..Bundled.limits.number("largest_reflectance")) {
                throw Refusal.of("chart_unfit.reflectance", "file" to name, "reflectance" to worst, value = worst)
            }
            return file.values.map { row -> DoubleArray(row.size) { row[it] / scale } }
        }

        /**
         * Indices of the file's rows in reading order if their names are positions; otherwise the file's order.
         * Letters are columns where their number is the layout's number of columns (A1 to F4), else rows (A1 to D6).
         */
        private fun readingOrder(names: List<String>, layout: ChartLayout): List<Int> {
            val stand = names.indices.toList()
            val cells = names.mapNotNull { name ->
                Regex("([A-Z])([0-9]{1,2})").matchEntire(name.uppercase())?.let {
                    it.groupValues[1] to
                        it.groupValues[2].toInt()
                }
            }
            val shape = cells.map { it.first }.toSet().size to cells.map { it.second }.toSet().size
            val byColumns = shape == layout.columns to layout.rows
            val placed = byColumns || shape == layout.rows to layout.columns
            if (cells.toSet().size != names.size || !placed) return stand
            val byLetter = compareBy<Int>({ cells[it].first }, { cells[it].second })
            val byNumber = compareBy<Int>({ cells[it].second }, { cells[it].first })
            return stand.sortedWith(if (byColumns) byNumber else byLetter)
        }

        /**
         * Throws [ChartUnfit] if the 24 colours run upside down or column by column, because all results would then
         * be wrong.
         */
        private fun checkOrder(values: List<DoubleArray>, name: String) {
            val known = read("classic24:babelcolor").sharedValues
            fun misfit(place: (Int) -> Int): Double {
                var total = 0.0
                for (i in 0 until 24) {
                    for (m in 0 until Grid.SIZE) {
                        val off = values[place(i)][m] - known[i * Grid.SIZE + m]
                        total += off * off
                    }
                }
                return sqrt(total / (24 * Grid.SIZE))
            }
            // Index in the file of the chart's patch at row i / 6, column i % 6.
            val orders: Map<String, (Int) -> Int> = mapOf(
                "upside down" to { i -> 23 - i },
                "by columns" to { i -> 4 * (i % 6) + i / 6 },
                "by columns from below" to { i -> 4 * (i % 6) + 3 - i / 6 },
            )
            val found = orders.mapValues { misfit(it.value) }.minByOrNull { it.value }!!
            val here = misfit { it }
            val share = Bundled.limits.number("other_order")
            if (found.value < share * here) {
                throw Refusal.of(
                    "chart_unfit.order", "file" to name, "order" to found.key, value = here,
                    threshold = found.value / share,
                )
            }
        }

        /**
         * Index of the layout's white patch; without one, of the brightest neutral patch, or E5 of an SG unless
         * another is clearly brighter (its border repeats the white).
         */
        private fun white(values: List<DoubleArray>, names: List<String>, layout: ChartLayout, name: String): Int {
            if (layout.white.isNotEmpty()) {
                val given = names.indexOf(layout.white)
                if (given >= 0) return given
                throw InvalidArgument(
                    "$name has no patch '${layout.white}', the white patch of the layout ${layout.name}.",
                    "Give its name in the table as \"white\" of the layout, or leave \"white\" out.",
                )
            }
            val limits = Bundled.limits
            val neutral = limits.range("neutral")
            val visible = (0 until Grid.SIZE).filter { Grid.wavelengths[it] in neutral }
            val brightness = values.map { row ->
                val level = visible.sumOf { row[it] } / visible.size
                val spread = sqrt(visible.sumOf { (row[it] - level) * (row[it] - level) } / visible.size)
                if (spread <= limits.number("uneven") * level) level else 0.0
            }
            val most = brightness.max()
            if (most <= 0) {
                throw Refusal.of("chart_unfit.no_neutral", "file" to name)
            }
            val e5 = 4 * 14 + 4
            if (layout.name == "sg140" && brightness[e5] >= limits.number("as_white") * most) return e5
            return brightness.indexOf(most)
        }
    }
}
