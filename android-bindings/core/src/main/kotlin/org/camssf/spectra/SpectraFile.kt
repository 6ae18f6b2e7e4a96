package org.camssf.spectra

import org.camssf.InvalidArgument
import org.camssf.Refusal
import org.camssf.json.number
import org.camssf.json.numbers
import org.camssf.json.part
import org.camssf.json.range
import org.camssf.json.whole
import org.camssf.scientific
import org.camssf.short
import kotlin.math.abs

/** Named spectra of a file, on common wavelengths. */
internal class Spectra(val names: List<String>, val wavelengths: DoubleArray, val values: List<DoubleArray>) {
    /** The same, turned if the wavelengths decrease throughout. */
    fun ascending(): Spectra {
        if ((1 until wavelengths.size).any { wavelengths[it] >= wavelengths[it - 1] }) return this
        return Spectra(names, wavelengths.reversedArray(), values.map { it.reversedArray() })
    }
}

/**
 * Parses tables of spectra in CSV and CGATS.17, meters' lines and rawtoaces' illuminants. It handles formats only; the
 * callers check the physics. Python's `camssf.spectra.tables` has the same rules and messages.
 */
internal object SpectraFile {
    private val limits get() = Bundled.limits

    /** Words in a header that mark a column as a standard deviation. */
    private val DEVIATIONS =
        setOf("std", "stdev", "sd", "sigma", "σ", "se", "err", "error", "deviation", "uncertainty")

    /**
     * Parses a single spectrum: a table of two columns, or of three with the power's standard deviation, which is
     * ignored; a header of wavelengths with one row; CGATS text with one set; or rawtoaces' illuminant.
     */
    fun spectrum(name: String, content: ByteArray): Spectra = oneSpectrum(name, decode(name, content)).ascending()

    private fun oneSpectrum(name: String, text: String): Spectra {
        if (text.trimStart().startsWith("<")) {
            throw InvalidArgument("$name is XML, which is not read here.", "Export the spectrum as CSV.")
        }
        if (RawtoacesLamp.claims(text)) return RawtoacesLamp.read(text, name)
        if ("BEGIN_DATA_FORMAT" in text) {
            val table = cgats(text, name)
            val kind = Regex("^MEAS_TYPE\\s+\"?(\\w+)", RegexOption.MULTILINE).find(text)?.groupValues?.get(1)
            if (kind == "REFLECTIVE" || kind == "TRANSMISSIVE") {
                throw InvalidArgument(
                    "$name holds the spectrum of a surface, not of light.",
                    "Measure the lamp's emission (spotread -e or -a).",
                )
            }
            if (table.values.size != 1) {
                throw InvalidArgument("$name holds ${table.values.size} spectra.", "Give a file with one of them.")
            }
            return table
        }
        val rows = TextTable.rows(text)
        return LabelledLines.read(rows, name) ?: oneRow(rows, name) ?: twoColumns(rows, name)
    }

    /** The spectrum of a header of wavelengths and the row below it; null without such a header. */
    private fun oneRow(rows: List<TextRow>, name: String): Spectra? {
        val at = headerOfWavelengths(rows) ?: return null
        val found = underWavelengths(rows[at], rows.drop(at + 1), name)
        if (found.values.size != 1) {
            throw InvalidArgument(
                "$name holds ${found.values.size} spectra, from line ${rows[at + 1].line} on.",
                "Give a file with one of them.",
            )
        }
        return found
    }

    /** The spectrum of a table with a line for each wavelength. */
    private fun twoColumns(rows: List<TextRow>, name: String): Spectra {
        val (header, lines) = spectrumLines(rows, name)
        val width = lines[0].fields.size
        lines.firstOrNull { it.fields.size != width }?.let {
            throw noSpectrum(
                name,
                "line ${it.line} has ${it.fields.size} numbers, line ${lines[0].line} has $width.",
            )
        }
        val named = header?.let { "; its header, line ${it.line}, reads $it" }.orEmpty()
        if (width > 3) throw noSpectrum(name, "line ${lines[0].line} has $width numbers$named.")
        val table = Numerals.of(lines, name, wavelengths = true)
        if (width == 3 && !isDeviation(header?.fields.orEmpty(), lines, table)) {
            throw InvalidArgument(
                "$name has two columns beside the wavelength, and the second is no standard deviation of the " +
                    "first$named.",
                "Give one lamp a file; a standard deviation is named std in the header, or is small against the " +
                    "power. Where a comma separates the columns, the decimal mark must be a point.",
            )
        }
        return Spectra(listOf(name), column(table, 0), listOf(column(table, 1)))
    }

    /**
     * The header, if any, and the lines of numbers of the table of one spectrum. Text around the table is left out; a
     * line before or after it that may belong to it is an error.
     */
    private fun spectrumLines(rows: List<TextRow>, name: String): Pair<TextRow?, List<TextRow>> {
        val runs = ArrayList<IntRange>()
        for (i in rows.indices) {
            if (!isLine(rows[i])) continue
            val open = runs.lastOrNull()
            if (open != null && open.last == i - 1) runs[runs.lastIndex] = open.first..i else runs += i..i
        }
        if (runs.isEmpty()) {
            for (row in rows) {
                val odd = row.fields.drop(1).firstOrNull { !Numerals.isNumeral(it) } ?: continue
                if (mayBeWavelength(row)) throw Numerals.notANumber(name, row, odd)
            }
            throw noSpectrum(name, "no line has a wavelength and a number${begins(rows)}.")
        }
        val table = runs.maxWith(
            compareBy({ run -> run.count { mayBeWavelength(rows[it]) } }, { it.last - it.first }),
        )
        for (i in rows.indices) {
            val beside = i == table.first - 1 || i == table.last + 1
            if (i in table || !mayBeWavelength(rows[i]) || !(beside || isLine(rows[i]))) continue
            val parting = if (i < table.first) rows[table.first - 1] else rows[table.last + 1]
            val what = if (mayBeWavelength(parting)) {
                "is not a wavelength and a number"
            } else {
                "stands between two tables of numbers"
            }
            throw noSpectrum(name, "line ${parting.line}, $parting, $what.")
        }
        return rows.getOrNull(table.first - 1)?.takeIf { it.fields.size > 1 } to rows.slice(table)
    }

    private fun begins(rows: List<TextRow>): String =
        rows.firstOrNull()?.let { "; line ${it.line} reads $it" }.orEmpty()

    /** The row with 380 in place of `380nm` in its first cell. */
    private fun withPlainWavelength(row: TextRow): TextRow {
        val first = row.fields[0]
        if (Numerals.number(first) != null) return row
        val value = TextTable.wavelength(first) ?: return row
        return row.with(listOf("$value") + row.fields.drop(1))
    }

    /** Whether a row is a number, then one or more numbers, possibly with thousands separators. */
    private fun isLine(row: TextRow): Boolean =
        row.fields.size > 1 && Numerals.number(row.fields[0]) != null && row.fields.all { Numerals.isNumeral(it) }

    /** Whether the row begins with a number that may be a wavelength in nm. */
    private fun mayBeWavelength(row: TextRow): Boolean = TextTable.wavelength(row.fields[0]) != null

    private fun noSpectrum(name: String, why: String) = InvalidArgument(
        "$name is not a table of one spectrum: $why",
        "Write a line for each wavelength: the wavelength in nm, the power. Leave out all other tables.",
    )

    /**
     * True if the third column is the power's standard deviation, judged by its name or, without a name, by its size.
     * Digits such as 05 are decimals behind a comma.
     */
    private fun isDeviation(header: List<String>, lines: List<TextRow>, rows: List<DoubleArray>): Boolean {
        if (lines.any { Regex("0[0-9]+").matches(it.fields[2]) }) return false
        if (header.size == 3) {
            return Regex("[a-zσ]+").findAll(header[2].lowercase()).any { it.value in DEVIATIONS }
        }
        return rows.all { it[2] >= 0 } &&
            rows.maxOf { it[2] } <= limits.number("largest_deviation") * rows.maxOf { it[1] }
    }

    /**
     * Parses the spectra of a chart's patches, in the file's order: CSV with a header of wavelengths and one line per
     * patch, or with one line per wavelength; or CGATS.17 text with spectral fields.
     */
    fun spectra(name: String, content: ByteArray): Spectra {
        val text = decode(name, content)
        if (name.lowercase().endsWith(".cxf") || text.trimStart().startsWith("<")) {
            throw InvalidArgument(
                "$name is CxF, which is not read here.",
                "Export the table as CSV or as CGATS text.",
            )
        }
        return (if ("BEGIN_DATA_FORMAT" in text) cgats(text, name) else csv(text, name)).ascending()
    }

    /**
     * Checks that the wavelengths increase, are in nm, and cover 400 to 700 nm without gaps above 20 nm in the grid.
     * Too small a range, too few wavelengths or too large gaps raise the refusal of this code.
     */
    fun checkWavelengths(
        wavelengths: DoubleArray,
        name: String,
        code: String,
    ) {
        val sorted = "Sort them, in nm, each once."
        val steps = DoubleArray(maxOf(wavelengths.size - 1, 0)) { wavelengths[it + 1] - wavelengths[it] }
        if (steps.isEmpty() || !wavelengths.all { it.isFinite() }) {
            throw InvalidArgument("$name has fewer than two wavelengths, or one that is not a number.", sorted)
        }
        checkUnit(wavelengths.min(), wavelengths.max(), name)
        val least = steps.indices.minBy { steps[it] }
        if (steps[least] < limits.number("smallest_step")) {
            throw InvalidArgument(
                "The wavelengths in $name do not increase: ${short(wavelengths[least])} is followed by " +
                    "${short(wavelengths[least + 1])}.",
                sorted,
            )
        }
        val first = wavelengths.first()
        val last = wavelengths.last()
        val words = arrayOf("file" to name, "first" to first, "last" to last)
        val (from, to) = limits.numbers("covered")
        if (first > from || last < to) throw Refusal.of("$code.narrow", *words)
        val step = limits.number("widest_step")
        if (wavelengths.size < limits.whole("fewest_wavelengths")) {
            throw Refusal.of(
                "$code.few_wavelengths", *words, "count" to wavelengths.size, value = steps.max(),
                threshold = step,
            )
        }
        val inside = steps.indices.filter { wavelengths[it] < 720.0 && wavelengths[it + 1] > 380.0 }
        val widest = inside.maxBy { steps[it] }
        if (steps[widest] > step) {
            throw Refusal.of(
                "$code.spectral_gap", "file" to name, "gap" to steps[widest], "first" to wavelengths[widest],
                "last" to wavelengths[widest + 1], value = steps[widest], threshold = step,
            )
        }
    }

    /** Throws if wavelengths from `first` to `last` are not in nm; names the unit that they would fit. */
    private fun checkUnit(first: Double, last: Double, name: String) {
        fun inside(range: ClosedFloatingPointRange<Double>) = first >= range.start && last <= range.endInclusive
        if (inside(limits.range("nanometres")) && !inside(limits.range("angstroms"))) return
        val unit = limits.part("other_units").let { units -> units.keys.firstOrNull { inside(units.range(it)) } }
        throw InvalidArgument(
            "The wavelengths in $name are not in nm: they run from ${size(first)} to ${size(last)}" +
                (unit?.let { ", as in $it." } ?: "."),
            "Write 550 for green.",
        )
    }

    private fun size(value: Double): String = if (value > 0 && value < 1e-3) scientific(value, 1) else short(value)

    /** The addition to `source` for a table that ends inside the grid; "" otherwise. */
    fun held(wavelengths: DoubleArray): String {
        if (wavelengths.first() <= 380.0 && wavelengths.last() >= 720.0) return ""
        return ", held constant outside ${short(wavelengths.first())} to ${short(wavelengths.last())} nm"
    }

    private fun decode(name: String, content: ByteArray): String {
        val largest = limits.whole("largest_file")
        if (content.size > largest) {
            val most = "${short(largest / 1e6)} MB"
            throw InvalidArgument("$name is larger than $most.", "Tables of spectra are smaller. Check the file.")
        }
        val mark = content.take(2).map { it.toInt() and 0xff }
        if (mark == listOf(0xff, 0xfe) || mark == listOf(0xfe, 0xff)) return content.toString(Charsets.UTF_16)
        if (0 in mark) { // UTF-16 of a text that begins with ASCII
            return content.toString(if (mark[0] == 0) Charsets.UTF_16BE else Charsets.UTF_16LE)
        }
        val text = content.toString(Charsets.UTF_8).removePrefix("\uFEFF")
        return if ('\uFFFD' in text) content.toString(Charsets.ISO_8859_1) else text
    }

    private fun column(rows: List<DoubleArray>, at: Int): DoubleArray = DoubleArray(rows.size) { rows[it][at] }

    private fun noChart(name: String, why: String) = InvalidArgument(
        "$name is not a table of reflectances: $why",
        "Write a line of wavelengths and a line for each patch, or a line for each wavelength, a column a patch.",
    )

    /** Index of the first row with at least ten wavelengths; null without one. */
    private fun headerOfWavelengths(rows: List<TextRow>): Int? =
        rows.take(limits.whole("preamble")).indexOfFirst { hasWavelengths(it.fields) }.takeIf { it >= 0 }

    private fun hasWavelengths(fields: List<String>): Boolean =
        fields.count { TextTable.wavelength(it) != null } >= limits.whole("fewest_in_header")

    private fun csv(text: String, name: String): Spectra {
        val rows = TextTable.rows(text)
        headerOfWavelengths(rows)?.let { return underWavelengths(rows[it], rows.drop(it + 1), name) }
        val plain = rows.map { withPlainWavelength(it) }
        val start = plain.indexOfFirst { it.fields.size > 2 && isLine(it) }
        if (start < 0) {
            throw noChart(
                name,
                "no line has ten wavelengths, or a wavelength and the numbers of the patches${begins(rows)}.",
            )
        }
        val lines = plain.drop(start)
        val width = lines[0].fields.size
        lines.firstOrNull { it.fields.size != width }?.let {
            throw noChart(
                name,
                "line ${it.line}, $it, has ${it.fields.size} cells, line ${lines[0].line} has $width.",
            )
        }
        val table = Numerals.of(lines, name, wavelengths = true)
        val header = if (start > 0) rows[start - 1].fields.drop(1) else emptyList()
        val names = if (header.size == width - 1) header else List(width - 1) { "${it + 1}" }
        return Spectra(names, column(table, 0), List(width - 1) { column(table, it + 1) })
    }

    /** Parses rows of patches below a header whose fields are wavelengths or names of other columns. */
    private fun underWavelengths(header: TextRow, body: List<TextRow>, name: String): Spectra {
        val at = header.fields.indices.filter { TextTable.wavelength(header.fields[it]) != null }
        val width = header.fields.size
        body.firstOrNull { it.fields.size != width }?.let {
            throw InvalidArgument(
                "$name, line ${it.line}: $it has ${it.fields.size} cells, its header, line ${header.line}, $width.",
                "Correct that line, or leave it out.",
            )
        }
        if (body.isEmpty()) {
            throw InvalidArgument(
                "$name has no line below its header, line ${header.line}.",
                "Write one for a spectrum.",
            )
        }
        val values = Numerals.of(body.map { row -> row.with(at.map { row.fields[it] }) }, name, wavelengths = false)
        val words = header.fields.map { it.lowercase().replace(Regex("[^a-z]"), "") }
        val known = listOf("sampleloc", "samplename", "patchname", "patch", "name", "sampleid", "id")
        val columns = known.filter {
            it in words
        }.map { words.indexOf(it) }.ifEmpty { listOf(0).filter { it !in at } }
        val named =
            columns.map { column -> body.map { it.fields[column] } } + listOf(body.indices.map { "${it + 1}" })
        // A column of positions (A1 ...) orders the patches; without one, the first column of names.
        val position = Regex("[A-Na-n][0-9]{1,2}")
        val names = named.firstOrNull { each -> each.all { position.matches(it) } } ?: named[0]
        val wavelengths = at.map { TextTable.wavelength(header.fields[it])!! }.toDoubleArray()
        return Spectra(names, wavelengths, values)
    }

    /** The first table with spectral fields of a CGATS.17 file (Argyll's .ti3 and .sp are such files). */
    private fun cgats(text: String, name: String): Spectra {
        val clean = TextTable.lines(text).joinToString("\n")
        val parts = clean.split("BEGIN_DATA_FORMAT")
        var next = 1 + breaks(parts[0])
        for (part in parts.drop(1)) {
            val at = next
            next += breaks(part)
            val fields = part.substringBefore("END_DATA_FORMAT")
            val rest = part.substringAfter("END_DATA_FORMAT", "")
            val data = rest.substringAfter("BEGIN_DATA", "")
            val header = tokens(fields)
            if (!hasWavelengths(header)) continue
            if ("END_DATA" !in data) {
                throw InvalidArgument("$name ends early: its table has no END_DATA.", "Export it again.")
            }
            val line = at + breaks(fields) + breaks(rest.substringBefore("BEGIN_DATA"))
            val lines = data.substringBefore("END_DATA").split("\n").mapIndexed { i, words -> line + i to words }
            var body = lines.filter { it.second.isNotBlank() }.map { (number, words) ->
                TextRow(number, words.split("\t").map { it.trim().trim('"') }, '\t')
            }
            if (body.any { it.fields.size != header.size }) { // blanks separate, too
                body = lines.flatMap { (number, words) -> tokens(words).map { number to it } }.chunked(header.size)
                    .map { set -> TextRow(set[0].first, set.map { it.second }, ' ') }
            }
            val found = underWavelengths(TextRow(at, header, ' '), body, name)
            return Spectra(found.names, exact(found.wavelengths, clean), found.values)
        }
        throw InvalidArgument(
            "$name has no table of spectra.",
            "Export the spectral data (fields such as SPECTRAL_NM380), too.",
        )
    }

    private fun breaks(text: String): Int = text.count { it == '\n' }

    /** Wavelengths from the file's number of bands, start and end, if they fit those of the names. */
    private fun exact(named: DoubleArray, text: String): DoubleArray {
        val (bands, first, last) = listOf("BANDS", "START_NM", "END_NM").map { word ->
            Regex("^SPECTRAL_$word\\s+\"?([0-9.]+)", RegexOption.MULTILINE).find(text)?.groupValues?.get(1)
                ?.toDoubleOrNull() ?: return named
        }
        if (bands != named.size.toDouble()) return named
        val step = (last - first) / (named.size - 1)
        val exact = DoubleArray(named.size) { if (it == named.size - 1) last else first + it * step }
        val rounded = limits.number("rounded")
        return if (named.indices.all { abs(exact[it] - named[it]) < rounded }) exact else named
    }

    private fun tokens(text: String): List<String> =
        Regex("\"[^\"\\n]*\"|[^\\s\"]+").findAll(text).map { it.value.trim('"') }.toList()
}
