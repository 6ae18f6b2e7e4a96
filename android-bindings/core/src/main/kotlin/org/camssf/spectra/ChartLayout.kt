package org.camssf.spectra

import org.camssf.InvalidArgument
import org.camssf.json.JsonText
import org.camssf.json.NotJson
import org.camssf.json.number
import org.camssf.json.numbers
import org.camssf.json.whole
import org.camssf.short
import kotlin.math.abs

/**
 * The printed geometry of a chart, in units of its patch pitch (centre to centre). Safe to pass between threads.
 *
 * @property name for example "classic24".
 * @property columns of patches; patch i lies at column i % columns, row i / columns.
 * @property rows of patches.
 * @property sideX edge of a patch along x in pitches; the rest of the pitch is the gap.
 * @property sideY edge of a patch along y in pitches.
 * @property white name of the white patch in the table; "" for the brightest neutral patch.
 */
public class ChartLayout internal constructor(
    public val name: String,
    public val columns: Int,
    public val rows: Int,
    public val sideX: Double,
    public val sideY: Double,
    public val white: String = "",
    /**
     * (4, 2) marks around the patches that may be tapped in place of the block's corners: lattice coordinates,
     * clockwise from the top left; empty if there are none.
     */
    internal val fiducials: DoubleArray = DoubleArray(0),
) {
    /** True for the layouts of [all], false for one of the user's own. */
    public val shipped: Boolean get() = of(name) != null

    override fun toString(): String = "ChartLayout($name, $columns × $rows)"

    /** The layout in a document: its name if it is shipped, else as a layout file in pitches. */
    internal fun plain(): Any = if (shipped) name else own()

    private fun own(): Map<String, Any> {
        val side = listOf(sideX, sideY)
        val plain = linkedMapOf(
            "format" to LayoutFile.FORMAT, "name" to name, "columns" to columns, "rows" to rows,
            "patch" to side, "gap" to side.map { 1 - it },
        )
        if (white.isNotEmpty()) plain["white"] = white
        if (fiducials.isNotEmpty()) {
            plain["fiducials"] =
                List(4) { i -> List(2) { fiducials[2 * i + it] + side[it] / 2 } }
        }
        return plain
    }

    public companion object {
        /** The layouts of all shipped charts. */
        @JvmStatic
        public fun all(): List<ChartLayout> = Bundled.layouts()

        internal fun of(name: String): ChartLayout? = Bundled.layouts().firstOrNull { it.name == name }

        /**
         * Parses a user's own layout, a JSON file "camssf-layout/1" (docs/tables.md).
         *
         * @param name of the file, for messages.
         * @throws InvalidArgument the content is no such layout.
         */
        @JvmStatic
        public fun parse(name: String, content: ByteArray): ChartLayout {
            val plain = try {
                JsonText.parse(content.toString(Charsets.UTF_8).removePrefix("\uFEFF"))
            } catch (error: NotJson) {
                val advice = "A layout is a JSON object. ${LayoutFile.ADVICE}"
                throw InvalidArgument("$name is not JSON.", advice, cause = error)
            }
            return LayoutFile(name, plain).layout()
        }

        /**
         * The layout in a document, as [plain] has it; `place` is its name in messages.
         *
         * @throws InvalidArgument neither the name of a shipped layout nor the content of a layout file.
         */
        internal fun of(plain: Any?, place: String): ChartLayout {
            if (plain !is String) return LayoutFile(place, plain).layout()
            return of(plain) ?: throw InvalidArgument(
                "no layout is called '$plain'",
                "Give one of ${all().joinToString { it.name }}.",
            )
        }
    }
}

/** The reader of a layout file; Python's `camssf.spectra.layouts` has the same rules and messages. */
private class LayoutFile(private val name: String, plain: Any?) {
    private val limits = Bundled.limits

    @Suppress("UNCHECKED_CAST")
    private val document = (plain as? Map<String, Any?>).orEmpty()

    fun layout(): ChartLayout {
        need(document["format"] == FORMAT) { "a layout has \"format\": \"$FORMAT\"" }
        document.keys.forEach { need(it in FIELDS) { "a layout has no field \"$it\"" } }
        REQUIRED.forEach { need(it in document) { "the field \"$it\" is missing" } }
        val title = document["name"] as? String
        val longest = limits.whole("longest_name")
        need(title != null && title.length <= longest && NAME.matches(title)) {
            "\"name\" needs 1 to $longest letters, digits, spaces, dots, hyphens or underscores"
        }
        need(ChartLayout.of(title!!.lowercase()) == null) { "\"name\" is that of a shipped layout, $title" }
        val (columns, rows) = listOf(count("columns"), count("rows"))
        val possible = wholes("patches")
        need(columns * rows in possible) {
            "it has ${columns * rows} patches; ${possible.first} to ${possible.last} are possible"
        }
        val patch = edges("patch", "above 0") { it > 0 }
        val gap = edges("gap", "of at least 0") { it >= 0 }
        val side = DoubleArray(2) { patch[it] / (patch[it] + gap[it]) }
        val narrowest = limits.number("narrowest")
        need(side.min() >= narrowest) {
            "the gaps are too wide: a patch must take at least ${short(100 * narrowest)} % of the step to the next"
        }
        val white = document.getValue("white", "") as? String
        need(white != null && white.length <= longest) {
            "\"white\" must be the name of a patch in the table"
        }
        val marks = marks(document.getValue("fiducials", emptyList<Any>()), patch, gap)
        need(marks != null && (marks.isEmpty() || surround(marks, side, columns, rows))) {
            "\"fiducials\" must be four points [x, y], clockwise from the top left, around the patches"
        }
        return ChartLayout(title, columns, rows, side[0], side[1], white!!, marks!!)
    }

    private fun Map<String, Any?>.getValue(field: String, default: Any): Any? =
        if (field in this) this[field] else default

    private inline fun need(right: Boolean, what: () -> String) {
        if (!right) throw InvalidArgument("$name: ${what()}.", ADVICE)
    }

    private fun wholes(name: String): IntRange = limits.numbers(name).let { (least, most) ->
        least.toInt()..most.toInt()
    }

    private fun count(field: String): Int {
        val value = document[field] as? Long ?: 0
        val possible = wholes("sides")
        need(value in possible) {
            "\"$field\" must be a whole number from ${possible.first} to ${possible.last}"
        }
        return value.toInt()
    }

    private fun edges(field: String, least: String, right: (Double) -> Boolean): DoubleArray {
        val found = pair(document[field])
        need(found != null && found.all(right)) { "\"$field\" must be a number $least, or two: across and down" }
        return found!!
    }

    /** A number, or two, below a million in size; null for anything else. */
    private fun pair(value: Any?): DoubleArray? {
        val both = value as? List<*> ?: listOf(value, value)
        val numbers = both.mapNotNull { (it as? Number)?.toDouble() }
        return if (both.size == 2 && numbers.size == 2 && numbers.all { abs(it) < 1e6 }) {
            numbers.toDoubleArray()
        } else {
            null
        }
    }

    /** Marks from the outer corner of the first patch, in lattice coordinates; null if they are not four points. */
    private fun marks(given: Any?, patch: DoubleArray, gap: DoubleArray): DoubleArray? {
        val points = (given as? List<*> ?: return null).map { each -> (each as? List<*>)?.let { pair(it) } }
        if (points.any { it == null } || points.size !in setOf(0, 4)) return null
        return DoubleArray(2 * points.size) {
            val axis = it % 2
            (points[it / 2]!![axis] - patch[axis] / 2) / (patch[axis] + gap[axis])
        }
    }

    /** True if the marks run clockwise and the block of patches lies inside them or on their edges. */
    private fun surround(marks: DoubleArray, side: DoubleArray, columns: Int, rows: Int): Boolean {
        val left = -side[0] / 2
        val top = -side[1] / 2
        val right = columns - 1 - left
        val bottom = rows - 1 - top
        val ends = listOf(left to top, right to top, right to bottom, left to bottom)
        return (0..3).all { i ->
            val (x, y) = marks[2 * i] to marks[2 * i + 1]
            val dx = marks[(2 * i + 2) % 8] - x
            val dy = marks[(2 * i + 3) % 8] - y
            (dx != 0.0 || dy != 0.0) && ends.none { (u, v) -> dx * (v - y) - dy * (u - x) < -1e-9 }
        }
    }

    companion object {
        const val FORMAT = "camssf-layout/1"
        private val REQUIRED = listOf("format", "name", "columns", "rows", "patch", "gap")
        private val FIELDS = REQUIRED + listOf("white", "fiducials")
        private val NAME = Regex("[A-Za-z0-9][A-Za-z0-9 ._-]*")
        const val ADVICE =
            "docs/tables.md shows a layout. \"patch\" and \"gap\" may be in any unit: \"patch\": [18, 18], " +
                "\"gap\": [3, 3]."
    }
}
