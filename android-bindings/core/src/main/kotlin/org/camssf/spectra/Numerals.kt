package org.camssf.spectra

import org.camssf.InvalidArgument
import org.camssf.json.range
import org.camssf.json.whole

/**
 * One line of a text table.
 *
 * @property line its number in the file, from 1.
 * @property fields its cells.
 * @property mark the separator between them; a blank for any number of blanks.
 */
internal class TextRow(val line: Int, val fields: List<String>, val mark: Char) {
    fun with(fields: List<String>): TextRow = TextRow(line, fields, mark)

    /** The row in a message. */
    override fun toString(): String =
        "'${fields.joinToString(if (mark == '\t') " " else "$mark").take(Bundled.limits.whole("longest_quote"))}'"
}

/** Reads the cells of a text table as numbers, with Python's rules (`camssf.spectra.text`) and messages. */
internal object Numerals {
    private val NUMBER = Regex(
        """[+-]?(?:(?:[0-9]+[.,]?[0-9]*|[.,][0-9]+)(?:[eE][+-]?[0-9]+)?|nan|inf|infinity)""",
        RegexOption.IGNORE_CASE,
    )

    /** Numbers with thousands separators of any country, such as 9'000 or 9.000,5. */
    private val SEPARATED =
        Regex("[+-]?[0-9]{1,3}(?:[.,'’ʼ´`_ \u00a0\u2007\u2009\u202f][0-9]{3})+(?:[.,][0-9]*)?")

    /** Cells in which the mark may be a decimal mark or a thousands separator, such as 9,000. */
    private val GROUPED = listOf(',', '.').associateWith { Regex("[+-]?[1-9][0-9]{0,2}\\$it[0-9]{3}") }
    private val WHOLE = Regex("[+-]?0*[1-9][0-9]*")

    /** The cell as a number, or null. A comma is a decimal comma. */
    fun number(field: String): Double? {
        val text = field.trim()
        if (!NUMBER.matches(text)) return null
        return text.replace(',', '.').toDoubleOrNull() ?: Double.NaN // infinities are refused by the callers, too
    }

    /** Whether the cell is a number, possibly with thousands separators. */
    fun isNumeral(field: String): Boolean = NUMBER.matches(field) || SEPARATED.matches(field)

    /**
     * The numbers of rows of equal length.
     *
     * @param wavelengths whether the first column holds wavelengths; their decimal mark is then known.
     * @throws InvalidArgument a cell is not a number, has thousands separators or may have them.
     */
    fun of(rows: List<TextRow>, name: String, wavelengths: Boolean): List<DoubleArray> {
        for (row in rows) {
            for (field in row.fields) {
                if (NUMBER.matches(field)) continue
                throw if (SEPARATED.matches(field)) {
                    separated(name, row, field, "has a thousands separator")
                } else {
                    notANumber(name, row, field)
                }
            }
        }
        checkMarks(rows, name, if (wavelengths) 1 else 0)
        return rows.map { row -> DoubleArray(row.fields.size) { number(row.fields[it])!! } }
    }

    /** Throws where 9,000 may be nine or nine thousand, judged by the other cells. */
    private fun checkMarks(rows: List<TextRow>, name: String, first: Int) {
        val values = rows.flatMap { it.fields.drop(first) }
        val whole = values.any { WHOLE.matches(it) }
        fun decimal(mark: Char) = values.any { mark in it && !GROUPED.getValue(mark).matches(it) }
        val nanometres = Bundled.limits.range("nanometres")
        fun inNanometres(mark: Char) =
            first > 0 && rows.any { mark in it.fields[0] && number(it.fields[0])!! in nanometres }
        for ((mark, other) in listOf(',' to '.', '.' to ',')) {
            val elsewhere = !inNanometres(mark) && (inNanometres(other) || rows.firstOrNull()?.mark == mark)
            if (decimal(mark) || !(whole || decimal(other) || elsewhere)) continue
            for (row in rows) {
                row.fields.drop(first).firstOrNull { GROUPED.getValue(mark).matches(it) }?.let {
                    throw separated(name, row, it, "may be a decimal number or have a thousands separator")
                }
            }
        }
    }

    private fun separated(name: String, row: TextRow, field: String, what: String) = InvalidArgument(
        "$name, line ${row.line}: '$field' $what.",
        "Export the numbers without thousands separators, with a decimal point.",
    )

    /** The error for a cell that is not a number. */
    fun notANumber(name: String, row: TextRow, field: String): InvalidArgument {
        val what = if (field.isEmpty()) "an empty cell" else "'${field.take(40)}'"
        return InvalidArgument(
            "$name, line ${row.line}: $what is not a number.",
            "Correct that line, or leave it out.",
        )
    }
}
