package org.camssf.photo

/**
 * A rectangle of samples; `right` and `bottom` are exclusive. Safe to pass between threads.
 *
 * @property left first column.
 * @property top first row.
 * @property right one past the last column.
 * @property bottom one past the last row.
 */
public class Region internal constructor(
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

    /** The part inside a photo of this size; of no columns or rows if none is. */
    public fun within(width: Int, height: Int): Region = Region(
        maxOf(left, 0), maxOf(top, 0), minOf(right, width), minOf(bottom, height),
    )

    private fun sides() = listOf(left, top, right, bottom)

    override fun equals(other: Any?): Boolean = other is Region && sides() == other.sides()

    override fun hashCode(): Int = sides().hashCode()

    override fun toString(): String = "Region(left=$left, top=$top, width=$width, height=$height)"

    public companion object {
        /** The rectangle that begins at a column and a row and has so many columns and rows. */
        @JvmStatic
        public fun ofSize(left: Int, top: Int, width: Int, height: Int): Region =
            Region(left, top, left + width, top + height)
    }
}
