package org.camssf.spectra

import org.camssf.CalibrationException
import org.camssf.InvalidArgument
import org.camssf.short

/** Named spectra of a file, on common wavelengths. */
internal class Spectra(val names: List<String>, val wavelengths: DoubleArray, val values: List<DoubleArray>)

/** Parses tables of spectra in CSV and CGATS.17. It handles formats only; the callers check the physics. */
internal object SpectraFile {
    private const val LARGEST = 20_000_000

    /** Words in a header that mark a column as a standard deviation. */
    private val DEVIATIONS =
        setOf("std", "stdev", "sd", "sigma", "σ", "se", "err", "error", "deviation", "uncertainty")

    /**
     * A third column without a name counts as the power's standard deviation if it is at most this fraction of the
     * largest power.
     */
    private const val LARGEST_DEVIATION = 0.2

    /**
     * Parses a single spectrum: a table of two columns, or of three with the power's standard deviation, which is
     * ignored; or CGATS text with one set.
     */
    fun spectrum(name: String, content: ByteArray): Spectra {
        val text = decode(name, content)
        if ("BEGIN_DATA_FORMAT" in text) {
            val table = cgats(text, name)
            if (table.values.size != 1) {
                throw InvalidArgument("$name holds ${table.values.size} spectra.", "Give a file with one of them.")
            }
            return table
        }
        val lines = rows(text)
        val start = lines.indexOfFirst { numbers(it) != null }
        val pairs = if (start < 0) emptyList() else lines.drop(start).map { numbers(it) }
        val widths = pairs.map { it?.size }.toSet()
        if (widths != setOf(2) && widths != setOf(3)) {
            throw InvalidArgument(
                "$name is not a table of one spectrum.",
                "Write a line for each wavelength: the wavelength in nm, the power.",
            )
        }
        val known = pairs.filterNotNull()
        if (widths == setOf(3) && !isDeviation(lines.getOrNull(start - 1).orEmpty(), known)) {
            throw InvalidArgument(
                "$name has two columns beside the wavelength, and the second is no standard deviation of the first.",
                "Give one lamp a file; a standard deviation is named std in the header, or is small against the power.",
            )
        }
        return Spectra(listOf(name), column(known, 0), listOf(column(known, 1)))
    }

    /**
     * True if the third column is the power's standard deviation, judged by its name or, without a name, by its size.
     */
    private fun isDeviation(header: List<String>, rows: List<DoubleArray>): Boolean {
        if (header.size == 3) {
            return Regex("[a-zσ]+").findAll(header[2].lowercase()).any { it.value in DEVIATIONS }
        }
        return rows.all { it[2] >= 0 } && rows.maxOf { it[2] } <= LARGEST_DEVIATION * rows.maxOf { it[1] }
    }

    /**
     * Parses the spectra of a chart's patches, in the file's order: CSV with a header of wavelengths and one line per
     * patch, or with one line per wavelength; or CGATS.17 text with spectral fields.
     */
    fun spectra(name: String, content: ByteArray): Spectra {
        if (name.lowercase().endsWith(".cxf")) {
            throw InvalidArgument(
                "$name is CxF, which is not read here.",
                "Export the table as CSV or as CGATS text.",
            )
        }
        val text = decode(name, content)
        return if ("BEGIN_DATA_FORMAT" in text) cgats(text, name) else csv(text, name)
    }

    /**
     * Checks that the wavelengths increase, are in nm, and cover 400 to 700 nm without gaps above 20 nm in the grid.
     * Too small a range, too few wavelengths or too large gaps raise the error that `unfit` creates.
     */
    fun checkWavelengths(
        wavelengths: DoubleArray,
        name: String,
        unfit: (String, String, Double?, Double?) -> CalibrationException,
    ) {
        val steps = DoubleArray(maxOf(wavelengths.size - 1, 0)) { wavelengths[it + 1] - wavelengths[it] }
        if (steps.isEmpty() || !wavelengths.all { it.isFinite() } || steps.min() < 1e-3) {
            throw InvalidArgument("The wavelengths in $name do not increase.", "Sort them, in nm, each once.")
        }
        val first = wavelengths.first()
        val last = wavelengths.last()
        if (first < 100 || last > 20_000) {
            throw InvalidArgument("The wavelengths in $name are not in nm.", "Write 550 for green, not 0.55 or 5500.")
        }
        val span = "${short(first)} to ${short(last)} nm"
        if (first > 400.0 || last < 700.0) {
            throw unfit("$name covers only $span.", "It must cover 400 to 700 nm, better 380 to 720 nm.", null, null)
        }
        if (wavelengths.size < 6) {
            throw unfit(
                "$name has only ${wavelengths.size} wavelengths from $span.",
                "Give a spectrum every 20 nm or finer; 5 nm is usual.",
                steps.max(),
                20.0,
            )
        }
        val inside = steps.indices.filter { wavelengths[it] < 720.0 && wavelengths[it + 1] > 380.0 }
        val widest = inside.maxBy { steps[it] }
        if (steps[widest] > 20.0) {
            throw unfit(
                "$name has a gap of ${short(steps[widest])} nm: nothing from ${short(wavelengths[widest])} to " +
                    "${short(wavelengths[widest + 1])} nm.",
                "Give a spectrum every 20 nm or finer; 5 nm is usual. A list of lines alone is no spectrum.",
                steps[widest],
                20.0,
            )
        }
    }

    /** The addition to `source` for a table that ends inside the grid; "" otherwise. */
    fun held(wavelengths: DoubleArray): String {
        if (wavelengths.first() <= 380.0 && wavelengths.last() >= 720.0) return ""
        return ", held constant outside ${short(wavelengths.first())} to ${short(wavelengths.last())} nm"
    }

    private fun decode(name: String, content: ByteArray): String {
        if (content.size > LARGEST) {
            throw InvalidArgument("$name is larger than 20 MB.", "Tables of spectra are smaller. Check the file.")
        }
        val mark = content.take(2).map { it.toInt() and 0xff }
        if (mark == listOf(0xff, 0xfe) || mark == listOf(0xfe, 0xff)) return content.toString(Charsets.UTF_16)
        val text = content.toString(Charsets.UTF_8).removePrefix("\uFEFF")
        return if ('\uFFFD' in text) content.toString(Charsets.ISO_8859_1) else text
    }

    /** Fields of every line that is neither empty nor a comment, separated by semicolon, tab, comma or blanks. */
    private fun rows(text: String): List<List<String>> {
        val lines = text.lines().filter { it.isNotBlank() && !it.trimStart().startsWith("#") }
        val separator = lines.lastOrNull()?.let { last -> ";\t,".firstOrNull { it in last } }
            ?: return lines.map { line -> line.trim().split(Regex("\\s+")) }
        return lines.map {
            fields(it, separator).dropLastWhile { field -> field.isEmpty() }
        }.filter { it.isNotEmpty() }
    }

    /** Fields of a CSV line; a field in double quotes may contain the separator, and "" for a quote. */
    private fun fields(line: String, separator: Char): List<String> {
        val found = ArrayList<String>()
        val field = StringBuilder()
        var quoted = false
        var i = 0
        while (i < line.length) {
            val c = line[i]
            when {
                quoted && c == '"' && line.getOrNull(i + 1) == '"' -> field.append(line[i++])

                c == '"' && (quoted || field.isEmpty()) -> quoted = !quoted

                c == separator && !quoted -> {
                    found += field.toString().trim()
                    field.setLength(0)
                }

                else -> field.append(c)
            }
            i++
        }
        found += field.toString().trim()
        return found
    }

    /** The fields as numbers, or null. A remaining comma is a decimal comma. */
    private fun numbers(fields: List<String>): DoubleArray? {
        val values = fields.map { number(it.replace(',', '.').trim()) ?: return null }
        return values.toDoubleArray()
    }

    /** Parses a number as Python does. Java's parser would also accept 380f, 1d and 0x1p0, and would refuse "nan". */
    private fun number(text: String): Double? = when {
        NUMBER.matches(text) -> text.toDouble()
        NO_NUMBER.matches(text) -> Double.NaN
        else -> null
    }

    private val NUMBER = Regex("""[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?""")

    /** Words for a missing or infinite value; the callers refuse values that are not finite. */
    private val NO_NUMBER = Regex("""[+-]?(?:nan|inf|infinity)""", RegexOption.IGNORE_CASE)

    private fun column(rows: List<DoubleArray>, at: Int): DoubleArray = DoubleArray(rows.size) { rows[it][at] }

    private val WAVELENGTH =
        Regex("""(?:spectral_?|spec_?|reflectance_?|r_?)?(?:nm_?)?([0-9]{3,4}(?:[.,][0-9]+)?) ?(?:nm)?""")

    /** The wavelength 380 of 380, nm380, 380nm, SPEC_380, SPECTRAL_NM380 ...; null for any other field. */
    private fun wavelength(field: String): Double? {
        val match = WAVELENGTH.matchEntire(field.lowercase()) ?: return null
        return match.groupValues[1].replace(',', '.').toDouble().takeIf { it in 200.0..2500.0 }
    }

    private fun noChart(name: String) = InvalidArgument(
        "$name is not a table of reflectances.",
        "Write a line of wavelengths and a line for each patch, or a line for each wavelength, a column a patch.",
    )

    private fun csv(text: String, name: String): Spectra {
        val rows = rows(text)
        for ((i, row) in rows.take(40).withIndex()) { // instruments write a preamble before the header
            if (row.count { wavelength(it) != null } >= 10) return underWavelengths(row, rows.drop(i + 1), name)
        }
        val start = rows.indexOfFirst { it.size > 2 && numbers(it) != null }
        if (start < 0) throw noChart(name)
        val lines = rows.drop(start).map { numbers(it) ?: throw noChart(name) }
        if (lines.any { it.size != lines[0].size }) throw noChart(name)
        val count = lines[0].size - 1
        val header = if (start > 0) rows[start - 1].drop(1) else emptyList()
        val names = if (header.size == count) header else List(count) { "${it + 1}" }
        return Spectra(names, column(lines, 0), List(count) { column(lines, it + 1) })
    }

    /** Parses rows of patches below a header whose fields are wavelengths or names of other columns. */
    private fun underWavelengths(header: List<String>, body: List<List<String>>, name: String): Spectra {
        val at = header.indices.filter { wavelength(header[it]) != null }
        if (body.isEmpty() || body.any { it.size != header.size }) throw noChart(name)
        val values = body.map { row -> numbers(at.map { row[it] }) ?: throw noChart(name) }
        val words = header.map { it.lowercase().replace(Regex("[^a-z]"), "") }
        val known = listOf("sampleloc", "samplename", "patchname", "patch", "name", "sampleid", "id")
        val columns = known.filter {
            it in words
        }.map { words.indexOf(it) }.ifEmpty { listOf(0).filter { it !in at } }
        val named = columns.map { column -> body.map { it[column] } } + listOf(body.indices.map { "${it + 1}" })
        // A column of positions (A1 ...) orders the patches; without one, the first column of names.
        val position = Regex("[A-Na-n][0-9]{1,2}")
        val names = named.firstOrNull { each -> each.all { position.matches(it) } } ?: named[0]
        return Spectra(names, at.map { wavelength(header[it])!! }.toDoubleArray(), values)
    }

    /** The first table with spectral fields of a CGATS.17 file (Argyll's .ti3 and .sp are such files). */
    private fun cgats(text: String, name: String): Spectra {
        val clean = text.lines().filter { !it.trimStart().startsWith("#") }.joinToString("\n")
        for (part in clean.split("BEGIN_DATA_FORMAT").drop(1)) {
            val header = tokens(part.substringBefore("END_DATA_FORMAT"))
            val rest = part.substringAfter("END_DATA_FORMAT", "")
            val data = rest.substringAfter("BEGIN_DATA", "").substringBefore("END_DATA")
            if (header.count { wavelength(it) != null } < 10) continue
            val lines = data.lines().filter { it.isNotBlank() }
            var body = lines.map { line -> line.split("\t").map { it.trim().trim('"') } }
            if (body.any { it.size != header.size }) body = tokens(data).chunked(header.size) // blanks separate, too
            return underWavelengths(header, body, name)
        }
        throw InvalidArgument(
            "$name has no table of spectra.",
            "Export the spectral data (fields such as SPECTRAL_NM380).",
        )
    }

    private fun tokens(text: String): List<String> =
        Regex("\"[^\"\\n]*\"|[^\\s\"]+").findAll(text).map { it.value.trim('"') }.toList()
}
