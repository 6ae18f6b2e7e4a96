package org.camssf.spectra

/**
 * The printed geometry of a chart, in units of its patch pitch (centre to centre).
 *
 * @property name for example "classic24".
 * @property columns of patches; patch i lies at column i % columns, row i / columns.
 * @property rows of patches.
 * @property sideX edge of a patch along x in pitches; the rest of the pitch is the gap.
 * @property sideY edge of a patch along y in pitches.
 */
public class ChartLayout internal constructor(
    public val name: String,
    public val columns: Int,
    public val rows: Int,
    public val sideX: Double,
    public val sideY: Double,
) {
    override fun toString(): String = "ChartLayout($name, $columns × $rows)"

    public companion object {
        /** The layouts of all supported charts. */
        @JvmStatic
        public fun all(): List<ChartLayout> = Bundled.layouts()

        internal fun of(name: String): ChartLayout? = Bundled.layouts().firstOrNull { it.name == name }
    }
}
