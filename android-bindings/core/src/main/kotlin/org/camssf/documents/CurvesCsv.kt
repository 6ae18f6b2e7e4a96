package org.camssf.documents

import org.camssf.Grid
import org.camssf.short

/** Writes curves as CSV: wavelength_nm,red,green,blue with peak 1, then the standard deviations if they are known. */
internal object CurvesCsv {
    fun of(curves: Curves): String {
        val names = listOf("red", "green", "blue")
        val header =
            listOf("wavelength_nm") + names + if (curves.std == null) emptyList() else names.map { "${it}_std" }
        val columns = curves.values + curves.std.orEmpty()
        return buildString {
            append(header.joinToString(",")).append('\n')
            for (m in 0 until Grid.SIZE) {
                append(short(Grid.wavelengths[m]))
                for (column in columns) append(',').append(column[m])
                append('\n')
            }
        }
    }
}
