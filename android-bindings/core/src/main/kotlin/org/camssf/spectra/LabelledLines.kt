package org.camssf.spectra

import org.camssf.InvalidArgument
import org.camssf.json.whole
import org.camssf.short
import kotlin.math.abs
import kotlin.math.sign

/**
 * Parses meters' files with a named wavelength in each line (`Spectral Data 380[nm],0.0012` or `380nm`, a tab and a
 * value). Some files have two tables, every 5 nm and every 1 nm; other lines are left out.
 */
internal object LabelledLines {
    /** The spectrum with the finest steps; null for another form. */
    fun read(all: List<TextRow>, name: String): Spectra? {
        val rows = all.mapNotNull { row ->
            TextTable.wavelength(row.fields[0])?.takeIf { Numerals.number(row.fields[0]) == null }
                ?.let { row.with(listOf("$it") + row.fields.drop(1)) }
        }
        if (rows.size < Bundled.limits.whole("fewest_labelled")) return null
        rows.firstOrNull { it.fields.size != 2 }?.let {
            throw InvalidArgument(
                "$name, line ${it.line} has ${it.fields.size - 1} values at ${short(it.fields[0].toDouble())} nm.",
                "Export one measurement a file, and anew.",
            )
        }
        val table = Numerals.of(rows, name, wavelengths = true)
        val direction = sign(table[1][0] - table[0][0])
        val parts = ArrayList<MutableList<DoubleArray>>()
        for ((i, line) in table.withIndex()) {
            if (i == 0 || sign(line[0] - table[i - 1][0]) != direction) parts += ArrayList<DoubleArray>()
            parts.last() += line
        }
        val best = parts.minBy { (abs(it.last()[0] - it.first()[0]) + 1.0) / it.size }
        return Spectra(
            listOf(name),
            DoubleArray(best.size) { best[it][0] },
            listOf(DoubleArray(best.size) { best[it][1] }),
        )
    }
}
