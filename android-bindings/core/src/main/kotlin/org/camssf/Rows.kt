package org.camssf

/**
 * Numbers of one, two or three axes, row by row, read-only. Reading is free of copies; safe to pass between threads.
 */
public class Rows internal constructor(internal val values: DoubleArray, internal vararg val sides: Int) :
    Iterable<Double> {
    /** Lengths of the axes. */
    public val shape: List<Int> = sides.asList().frozen()

    /** How many numbers there are. */
    public val size: Int get() = values.size

    /** The number at these places, from 0, one for each axis. */
    public operator fun get(vararg index: Int): Double {
        require(index.size == sides.size && index.indices.all { index[it] in 0 until sides[it] }) {
            "${index.joinToString()} is no place in rows of shape ${sides.joinToString()}"
        }
        return values[index.indices.fold(0) { at, axis -> at * sides[axis] + index[axis] }]
    }

    /** A copy of the numbers, row by row, for what takes arrays. */
    public fun toDoubleArray(): DoubleArray = values.copyOf()

    override fun iterator(): DoubleIterator = values.iterator()

    override fun equals(other: Any?): Boolean =
        other is Rows && sides.contentEquals(other.sides) && values.contentEquals(other.values)

    override fun hashCode(): Int = values.contentHashCode()

    override fun toString(): String = "Rows(${sides.joinToString(" × ")})"

    /** As nested lists; with `whole` of whole numbers, with `gaps` null in place of a row of NaN. */
    internal fun nested(whole: Boolean = false, gaps: Boolean = false): Any? = nested(0, 0, values.size, whole, gaps)

    private fun nested(axis: Int, from: Int, until: Int, whole: Boolean, gaps: Boolean): Any? {
        val count = sides[axis]
        if (axis < sides.size - 1) {
            val size = if (count == 0) 0 else (until - from) / count
            return List(count) { nested(axis + 1, from + it * size, from + (it + 1) * size, whole, gaps) }
        }
        if (gaps && (from until until).any { values[it].isNaN() }) return null
        return List(count) { if (whole) values[from + it].toLong() else values[from + it] }
    }
}
