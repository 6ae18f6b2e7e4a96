package org.camssf.spectra

import kotlinx.serialization.SerializationException
import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.doubleOrNull
import kotlinx.serialization.json.intOrNull
import org.camssf.InvalidArgument
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
        public fun parse(name: String, content: ByteArray): ChartLayout = LayoutFile(name, content).layout()
    }
}

/** The reader of a layout file; Python's `camssf.spectra.layouts` has the same rules and messages. */
private class LayoutFile(private val name: String, content: ByteArray) {
    private val document: JsonObject = try {
        val text = content.toString(Charsets.UTF_8).removePrefix("\uFEFF")
        // The parser's stack overflows where brackets nest thousands deep.
        if (text.count { it in "[{" } > BRACKETS) throw SerializationException("too many brackets")
        Json.parseToJsonElement(text)
    } catch (error: SerializationException) {
        throw InvalidArgument("$name is not JSON.", "A layout is a JSON object. $ADVICE", cause = error)
    }.let { found ->
        need(found is JsonObject && word(found["format"]) == FORMAT) { "a layout has \"format\": \"$FORMAT\"" }
        found as JsonObject
    }

    fun layout(): ChartLayout {
        document.keys.forEach { need(it in FIELDS) { "a layout has no field \"$it\"" } }
        REQUIRED.forEach { need(it in document) { "the field \"$it\" is missing" } }
        val title = word(document["name"])
        need(title != null && NAME.matches(title)) {
            "\"name\" needs 1 to 64 letters, digits, spaces, dots, hyphens or underscores"
        }
        need(ChartLayout.of(title!!.lowercase()) == null) { "\"name\" is that of a shipped layout, $title" }
        val (columns, rows) = listOf(count("columns"), count("rows"))
        need(columns * rows in PATCHES) {
            "it has ${columns * rows} patches; ${PATCHES.first} to ${PATCHES.last} are possible"
        }
        val patch = edges("patch", "above 0") { it > 0 }
        val gap = edges("gap", "of at least 0") { it >= 0 }
        val side = DoubleArray(2) { patch[it] / (patch[it] + gap[it]) }
        need(side.min() >= NARROWEST) {
            "the gaps are too wide: a patch must take at least 60 % of the step to the next"
        }
        val white = word(document["white"] ?: JsonPrimitive(""))
        need(white != null && white.length <= LONGEST) { "\"white\" must be the name of a patch in the table" }
        val marks = marks(document["fiducials"] ?: JsonArray(emptyList()), patch, gap)
        need(marks != null && (marks.isEmpty() || surround(marks, side, columns, rows))) {
            "\"fiducials\" must be four points [x, y], clockwise from the top left, around the patches"
        }
        return ChartLayout(title, columns, rows, side[0], side[1], white!!, marks!!)
    }

    private inline fun need(right: Boolean, what: () -> String) {
        if (!right) throw InvalidArgument("$name: ${what()}.", ADVICE)
    }

    private fun word(value: JsonElement?): String? = (value as? JsonPrimitive)?.takeIf { it.isString }?.content

    private fun count(field: String): Int {
        val value = (document[field] as? JsonPrimitive)?.takeIf { !it.isString }?.intOrNull ?: 0
        need(value in SIDES) { "\"$field\" must be a whole number from ${SIDES.first} to ${SIDES.last}" }
        return value
    }

    private fun edges(field: String, least: String, right: (Double) -> Boolean): DoubleArray {
        val found = pair(document[field])
        need(found != null && found.all(right)) { "\"$field\" must be a number $least, or two: across and down" }
        return found!!
    }

    /** A number, or two, below a million in size; null for anything else. */
    private fun pair(value: JsonElement?): DoubleArray? {
        val both = (value as? JsonArray)?.toList() ?: listOf(value, value)
        val numbers = both.mapNotNull { (it as? JsonPrimitive)?.takeIf { found -> !found.isString }?.doubleOrNull }
        return if (both.size == 2 && numbers.size == 2 && numbers.all { abs(it) < 1e6 }) {
            numbers.toDoubleArray()
        } else {
            null
        }
    }

    /** Marks from the outer corner of the first patch, in lattice coordinates; null if they are not four points. */
    private fun marks(given: JsonElement, patch: DoubleArray, gap: DoubleArray): DoubleArray? {
        val points = (given as? JsonArray ?: return null).map { each -> (each as? JsonArray)?.let { pair(it) } }
        if (points.any { it == null } || points.size !in setOf(0, 4)) return null
        return DoubleArray(2 * points.size) {
            val axis = it % 2
            (points[it / 2]!![axis] - patch[axis] / 2) / (patch[axis] + gap[axis])
        }
    }

    /** True if the marks run clockwise and the block of patches lies inside them or on their edges. */
    private fun surround(marks: DoubleArray, side: DoubleArray, columns: Int, rows: Int): Boolean {
        val (left, top) = listOf(-side[0] / 2, -side[1] / 2)
        val (right, bottom) = listOf(columns - 1 + side[0] / 2, rows - 1 + side[1] / 2)
        val ends = listOf(left to top, right to top, right to bottom, left to bottom)
        return (0..3).all { i ->
            val (x, y) = marks[2 * i] to marks[2 * i + 1]
            val dx = marks[(2 * i + 2) % 8] - x
            val dy = marks[(2 * i + 3) % 8] - y
            (dx != 0.0 || dy != 0.0) && ends.none { (u, v) -> dx * (v - y) - dy * (u - x) < -1e-9 }
        }
    }

    private companion object {
        const val FORMAT = "camssf-layout/1"
        val REQUIRED = listOf("format", "name", "columns", "rows", "patch", "gap")
        val FIELDS = REQUIRED + listOf("white", "fiducials")
        val NAME = Regex("[A-Za-z0-9][A-Za-z0-9 ._-]{0,63}")

        /** Ranges of the number of columns and of rows, and of patches. */
        val SIDES = 2..30
        val PATCHES = 12..300

        /** Smallest edge of a patch in pitches. */
        const val NARROWEST = 0.6
        const val LONGEST = 64

        /** Largest number of opening brackets; a layout has eight at most. */
        const val BRACKETS = 20
        const val ADVICE =
            "docs/tables.md shows a layout. \"patch\" and \"gap\" may be in any unit: \"patch\": [18, 18], " +
                "\"gap\": [3, 3]."
    }
}
