package org.camssf.guide

import org.camssf.Grid
import org.camssf.finder.ChartKind
import org.camssf.spectra.ChartTable
import kotlin.math.exp
import kotlin.math.ln

/**
 * Known reflectances of the patches of a kind of chart.
 *
 * @property luminance luminance of each patch, 0 to 1.
 * @property colourfulness 1 - smallest / largest of red, green and blue, for each patch.
 * @property white index of the white patch.
 * @property black index of the black patch.
 */
internal class Reference private constructor(
    val luminance: DoubleArray,
    val colourfulness: DoubleArray,
    val white: Int,
    val black: Int,
) {
    /** ln of [luminance] relative to a middle grey of 0.2. */
    val tone = DoubleArray(luminance.size) { ln(luminance[it] / 0.2) }

    companion object {
        private val classic: Reference by lazy {
            val table = ChartTable.read("classic24")
            val values = table.sharedValues
            val grid = Grid.wavelengths.values
            fun seen(patch: Int, centre: Double, width: Double): Double {
                var (sum, total) = 0.0 to 0.0
                for (i in 0 until Grid.SIZE) {
                    val off = (grid[i] - centre) / width
                    val weight = exp(-off * off / 2)
                    sum += weight * values[patch * Grid.SIZE + i]
                    total += weight
                }
                return sum / total
            }
            // V(λ), approximated by a Gaussian.
            val luminance = DoubleArray(table.patches.size) { seen(it, 559.0, 42.0) }
            val colour = DoubleArray(table.patches.size) { patch ->
                val rgb = listOf(600.0, 540.0, 455.0).map { seen(patch, it, 38.0) }
                1 - rgb.min() / rgb.max()
            }
            Reference(luminance, colour, table.white, luminance.indices.minByOrNull { luminance[it] }!!)
        }

        /** The reference of a kind of chart; null for the SG, because camssf has no table of its colours. */
        fun of(kind: ChartKind): Reference? = if (kind == ChartKind.CLASSIC_24) classic else null
    }
}
