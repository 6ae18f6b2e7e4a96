package org.camssf.spectra

import org.camssf.json.range
import org.camssf.json.whole

/** Splits texts into rows, with the rules of Python's `camssf.spectra.text`. */
internal object TextTable {
    /** Beginnings of lines that are no data; the last one is Excel's. */
    private val COMMENTS = listOf("#", "%", "//", "!", "sep=")
    private val SEPARATORS = listOf(';', '\t', ',', ' ')
    private val BLANKS = Regex("[ \\t\\f\\u000B]+")
    private val WAVELENGTH = Regex(
        """(?:(?:spectral[ _]?(?:data)?|spec|spd|reflectance|refl|wavelength|lambda|λ|wl|w|r|s|x)[ _=:(\[-]*)?""" +
            """(?:nm[ _=:-]*)?([0-9]{3,4}(?:[.,][0-9]+)?)[ _-]*[\[(]?(?:nm)?[\])]?""",
    )

    /** The lines, as editors count them; comments are empty lines. */
    fun lines(text: String): List<String> = text.lines().map { line ->
        if (COMMENTS.any { line.trimStart().startsWith(it) }) "" else line
    }

    /**
     * Cells of every line that is neither empty nor a comment. The separator is the one that gives most rows of
     * numbers, else one of the last line.
     */
    fun rows(text: String): List<TextRow> {
        val lines = lines(text).withIndex().filter { it.value.isNotBlank() }
        val sample = lines.takeLast(Bundled.limits.whole("sample"))
        val counts = SEPARATORS.associateWith { mark -> sample.count { isNumeric(cells(it.value, mark)) } }
        val best = SEPARATORS.maxBy { counts.getValue(it) }
        val mark = if (counts.getValue(best) > 0) {
            best
        } else {
            SEPARATORS.firstOrNull { lines.isNotEmpty() && it in lines.last().value } ?: ' '
        }
        return lines.map { (at, line) -> TextRow(at + 1, cells(line, mark), mark) }.filter { it.fields.isNotEmpty() }
    }

    /** Whether all cells are numbers, but for a name or a wavelength in the first one. */
    private fun isNumeric(fields: List<String>): Boolean {
        val named = fields.size > 2 ||
            (fields.size == 2 && (Numerals.isNumeral(fields[0]) || wavelength(fields[0]) != null))
        return named && fields.drop(1).all { Numerals.isNumeral(it) }
    }

    /** The cells of a line, without empty ones at its end; a cell in double quotes may hold the separator. */
    private fun cells(line: String, mark: Char): List<String> {
        if (mark == ' ') return line.split(BLANKS).filter { it.isNotEmpty() }
        val found = ArrayList<String>()
        val field = StringBuilder()
        var quoted = false
        var i = 0
        while (i < line.length) {
            val c = line[i]
            when {
                quoted && c == '"' && line.getOrNull(i + 1) == '"' -> field.append(line[i++])

                c == '"' && (quoted || field.isBlank()) -> quoted = !quoted

                c == mark && !quoted -> {
                    found += field.toString().trim()
                    field.setLength(0)
                }

                else -> field.append(c)
            }
            i++
        }
        found += field.toString().trim()
        return found.dropLastWhile { it.isEmpty() }
    }

    /** 380 from 380, nm380, 380_NM, R380, 380 [nm], SPECTRAL_NM_380, λ=380 ...; null for anything else. */
    fun wavelength(field: String): Double? {
        if (field.length > Bundled.limits.whole("longest_cell")) return null
        val match = WAVELENGTH.matchEntire(field.trim().lowercase()) ?: return null
        return match.groupValues[1].replace(',', '.').toDouble().takeIf { it in Bundled.limits.range("named") }
    }
}
