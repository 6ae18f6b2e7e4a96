package org.camssf.photo

/**
 * A rectangle of samples; `right` and `bottom` are exclusive.
 *
 * @property left first column.
 * @property top first row.
 * @property right one past the last column.
 * @property bottom one past the last row.
 */
public data class Region(
    public val left: Int,
    public val top: Int,
    public val right: Int,
    public val bottom: Int,
) {
    /** Columns. */
    public val width: Int get() = right - left

    /** Rows. */
    public val height: Int get() = bottom - top

    /** True if the sample at column x and row y is inside. */
    public fun contains(x: Int, y: Int): Boolean = x in left until right && y in top until bottom
}
