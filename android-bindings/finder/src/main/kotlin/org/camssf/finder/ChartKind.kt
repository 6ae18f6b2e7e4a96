package org.camssf.finder

import org.camssf.flatten
import org.camssf.json.list
import org.camssf.json.number
import org.camssf.json.numbers
import org.camssf.spectra.ChartTable

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
    /** Edge of a patch along x and y in pitches, and the patches' colours (n, 3). */
    private class Shape(val sideX: Double, val sideY: Double, val colours: DoubleArray)

    private val shape: Shape by lazy(shape)
    private val coloured: DoubleArray by lazy { Orientation.features(this.shape.colours, 3) }
    private val grey: DoubleArray by lazy { Orientation.features(this.shape.colours, 1) }

    internal val sideX: Double get() = shape.sideX
    internal val sideY: Double get() = shape.sideY

    internal fun features(channels: Int): DoubleArray = if (channels == 3) coloured else grey

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
                Shape(side, side, colours)
            }
    }
}
