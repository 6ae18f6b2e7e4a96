package org.camssf.spectra

import org.camssf.InvalidArgument
import org.camssf.json.JsonText
import org.camssf.json.list
import org.camssf.json.members
import org.camssf.json.part
import org.camssf.json.whole

/** Parses rawtoaces' JSON of an illuminant: `spectral_data.data.main` by wavelength, one column in `index.main`. */
internal object RawtoacesLamp {
    private val JSON = Regex("^\\s*(\\{|\\[\\s*[\\[{\"0-9-])")
    private val NM = Regex("[0-9]{1,5}(\\.[0-9]{1,9})?")

    /** Whether the text looks like JSON. */
    fun claims(text: String): Boolean = JSON.containsMatchIn(text)

    /** @throws InvalidArgument other JSON, or a table of several columns. */
    fun read(text: String, name: String): Spectra {
        var why = "it is not sound JSON"
        val (columns, table) = try {
            val document = JsonText.parse(text)
            why = if (document is Map<*, *>) {
                "its keys are ${document.keys.joinToString().take(Bundled.limits.whole("longest_quote"))}"
            } else {
                "it is a list"
            }
            val spectra = members(document).part("spectral_data")
            val columns = spectra.part("index").list("main").map { it.toString().lowercase() }
            val rows = spectra.part("data").part("main").map { (nm, row) ->
                require(NM.matches(nm)) { nm }
                nm.toDouble() to ((row as List<*>).first() as Number).toDouble()
            }
            columns to rows.sortedBy { it.first }
        } catch (error: RuntimeException) { // a missing or malformed field
            throw other(name, why, error)
        }
        if (columns.size != 1) throw other(name, "its columns are ${columns.joinToString()}", null)
        if (table.isEmpty()) throw InvalidArgument("$name has no samples.", "Give a measured spectrum.")
        return Spectra(
            listOf(name),
            DoubleArray(table.size) { table[it].first },
            listOf(DoubleArray(table.size) { table[it].second }),
        )
    }

    private fun other(name: String, why: String, cause: Exception?) = InvalidArgument(
        "$name is not an illuminant of rawtoaces: $why.",
        "It needs spectral_data with one column and data.main by wavelength; or give two columns, nm and power.",
        cause = cause,
    )
}
