package org.camssf.documents

import org.camssf.Grid
import org.camssf.recovery.Ssf
import org.camssf.short

/** Writes curves as CSV: wavelength_nm,red,green,blue with peak 1, then the standard deviations if they are known. */
internal object CurvesCsv {
    fun of(ssf: Ssf): String {
        val columns =
            List(3) { ssf.curve(it) } + if (ssf.sharedStd == null) emptyList() else List(3) { ssf.deviation(it)!! }
        val names = listOf("red", "green", "blue")
        val header =
            listOf("wavelength_nm") + names + if (ssf.sharedStd == null) emptyList() else names.map { "${it}_std" }
        val grid = Grid.wavelengths
        return buildString {
            append(header.joinToString(",")).append('\n')
            for (m in 0 until Grid.SIZE) {
                append(short(grid[m]))
                for (column in columns) append(',').append(column[m])
                append('\n')
            }
        }
    }
}
