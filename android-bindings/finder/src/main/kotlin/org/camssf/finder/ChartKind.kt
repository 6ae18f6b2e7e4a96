package org.camssf.finder

import org.camssf.flatten
import org.camssf.json.list
import org.camssf.json.number
import org.camssf.json.numbers
import org.camssf.photo.Agreement
import org.camssf.spectra.ChartTable
import kotlin.math.ln
import kotlin.math.sqrt

/**
 * A kind of chart that the finder can distinguish: a grid of patches and their colours.
 *
 * Classic, Classic Nano, Classic Mini and the Passport's classic page are **one** kind: they have the same 24 colours
 * in the same 6 × 4 grid. A picture does not show their sizes. The gap between their patches is 0.12 of the pitch on
 * Classic and Mini, 0.14 on Nano, 0.17 on the Passport; it is measured only when the pose is refined on the mosaic.
 *
 * @property columns number of patches in a row.
 * @property rows number of patches in a column.
 * @property layouts names of the possible layouts ([org.camssf.spectra.ChartLayout]), the most common one first.
 */
public class ChartKind private constructor(
    public val columns: Int,
    public val rows: Int,
    public val layouts: List<String>,
    shape: () -> Shape,
) {
    /**
     * Edge of a patch along x and y in pitches, the patches' colours (n, 3) under a flat lamp, and their luminances
     * (n), 1 for an ideal white, if known.
     */
    internal class Shape(
        val sideX: Double,
        val sideY: Double,
        val colours: DoubleArray,
        val luminance: DoubleArray? = null,
    )

    internal val shape: Shape by lazy(shape)
    private val coloured: DoubleArray by lazy { unit(Agreement.features(this.shape.colours)) }
    private val grey: DoubleArray by lazy {
        val logs = DoubleArray(columns * rows) { ln(this.shape.colours[3 * it + 1]) }
        unit(DoubleArray(logs.size) { logs[it] - logs.sum() / logs.size })
    }

    /** [Agreement.features] of the patches (n, 4), or without colour ln of green from its mean (n), of length 1. */
    internal fun features(channels: Int): DoubleArray = if (channels == 3) coloured else grey

    private fun unit(values: DoubleArray): DoubleArray {
        val length = sqrt(values.sumOf { it * it })
        return DoubleArray(values.size) { values[it] / length }
    }

    override fun toString(): String = "ChartKind(${layouts[0]}, $columns × $rows)"

    public companion object {
        /** 24 patches: Classic, Nano, Mini, Passport. */
        @JvmField
        public val CLASSIC_24: ChartKind = stored(6, 4, "classic24", "passport24", "nano24", "mini24")

        /** ColorChecker Digital SG. */
        @JvmField
        public val SG_140: ChartKind = stored(14, 10, "sg140")

        /** The kind of a chart: one of the above, or that of the table's own layout. */
        internal fun of(chart: ChartTable): ChartKind {
            val layout = chart.layout
            return listOf(CLASSIC_24, SG_140).firstOrNull { layout.name in it.layouts }
                ?: ChartKind(layout.columns, layout.rows, listOf(layout.name)) {
                    Shape(layout.sideX, layout.sideY, chart.genericSignals())
                }
        }

        private fun stored(columns: Int, rows: Int, vararg layouts: String): ChartKind =
            ChartKind(columns, rows, layouts.toList()) {
                val kind = FinderFile.kind(layouts[0])
                val side = kind.number("side")
                val colours = kind.list("colours").map { numbers(it) }.flatten()
                Shape(side, side, colours, if ("luminance" in kind) kind.numbers("luminance") else null)
            }
    }
}
