package org.camssf

import kotlin.math.min

/**
 * One number for each wavelength of [Grid]: 681 of them, read-only. Reading is free of copies; safe to pass between
 * threads.
 */
public class Curve internal constructor(internal val values: DoubleArray) : Iterable<Double> {
    /** 681. */
    public val size: Int get() = values.size

    /** The number at 380 nm + `index` · 0.5 nm. */
    public operator fun get(index: Int): Double = values[index]

    /**
     * The number at a wavelength, linear between the points of [Grid].
     *
     * @throws InvalidArgument the wavelength lies outside 380 to 720 nm.
     */
    public fun at(nm: Double): Double {
        val place = (nm - 380.0) / Grid.STEP
        if (!(place >= 0.0 && place <= Grid.SIZE - 1)) {
            throw InvalidArgument("$nm nm lies outside 380 to 720 nm.", "Ask for a wavelength of that range.")
        }
        val left = min(place.toInt(), Grid.SIZE - 2)
        return values[left] + (place - left) * (values[left + 1] - values[left])
    }

    /** A copy of the numbers, for what takes arrays. */
    public fun toDoubleArray(): DoubleArray = values.copyOf()

    override fun iterator(): DoubleIterator = values.iterator()

    override fun equals(other: Any?): Boolean = other is Curve && values.contentEquals(other.values)

    override fun hashCode(): Int = values.contentHashCode()

    override fun toString(): String = "Curve(${short(values.min())} to ${short(values.max())})"
}
