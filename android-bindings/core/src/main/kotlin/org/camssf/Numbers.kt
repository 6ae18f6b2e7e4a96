package org.camssf

import java.math.BigDecimal
import java.math.MathContext
import java.math.RoundingMode
import java.util.Collections
import kotlin.math.abs
import kotlin.math.withSign

/** Formats a share in percent as Python's messages do, without a blank: 0.1234 with one digit is "12.3%". */
internal fun percent(value: Double, digits: Int): String = fixed(100.0 * value, digits) + "%"

/**
 * Formats a number with `digits` decimals, the same in any locale. As in Python, ties of the binary value go to even.
 */
internal fun fixed(value: Double, digits: Int): String {
    if (!value.isFinite()) {
        return if (value.isNaN()) {
            "nan"
        } else if (value > 0) {
            "inf"
        } else {
            "-inf"
        }
    }
    val size = BigDecimal(abs(value)).setScale(digits, RoundingMode.HALF_EVEN).toPlainString()
    return if (1.0.withSign(value) < 0) "-$size" else size
}

/** Formats a number with `digits` decimals and an exponent, as Python's `:.1e`: 1.2e-05. */
internal fun scientific(value: Double, digits: Int): String {
    if (!value.isFinite() || value == 0.0) return fixed(value, digits) + if (value == 0.0) "e+00" else ""
    val found = BigDecimal(abs(value)).round(MathContext(digits + 1, RoundingMode.HALF_EVEN))
    val exponent = found.precision() - found.scale() - 1
    val size = found.movePointLeft(exponent).setScale(digits).toPlainString()
    val power = "${if (exponent < 0) "-" else "+"}${abs(exponent).toString().padStart(2, '0')}"
    return "${if (value < 0) "-" else ""}${size}e$power"
}

/** As Python's `:g`. */
internal fun general(value: Double, digits: Int = 6): String =
    decimal(BigDecimal(value).round(MathContext(digits, RoundingMode.HALF_EVEN)), digits).removeSuffix(".0")

/** As Python writes floats, with an exponent where the first digit stands below 1e-4 or from `most` digits on. */
internal fun decimal(value: BigDecimal, most: Int): String {
    if (value.signum() == 0) return "0.0"
    val digits = value.stripTrailingZeros()
    val exponent = digits.precision() - digits.scale() - 1
    if (exponent in -4 until most) return digits.toPlainString().let { if ('.' in it) it else "$it.0" }
    val size = digits.movePointLeft(exponent).stripTrailingZeros().toPlainString()
    return "${size}e${if (exponent < 0) "-" else "+"}${abs(exponent).toString().padStart(2, '0')}"
}

/** Formats a number with up to six significant digits and no exponent: 0.5, 16383, 2856. */
internal fun short(value: Double): String = when {
    value.isNaN() || value.isInfinite() -> value.toString()
    value == 0.0 -> "0"
    else -> BigDecimal(value).round(MathContext(6, RoundingMode.HALF_EVEN)).stripTrailingZeros().toPlainString()
}

/** The median: the middle value, or the mean of the two middle values; NaN for an empty array. */
internal fun median(values: DoubleArray): Double {
    if (values.isEmpty()) return Double.NaN
    val sorted = values.sortedArray()
    return (sorted[(sorted.size - 1) / 2] + sorted[sorted.size / 2]) / 2.0
}

/** Sum in NumPy's order (blocks of 128, eight running sums), so that means equal Python's to the last bit. */
internal fun sum(values: DoubleArray, from: Int = 0, until: Int = values.size): Double {
    val n = until - from
    if (n < 8) {
        var total = -0.0
        for (i in from until until) total += values[i]
        return total
    }
    if (n > 128) {
        val half = n / 2 - n / 2 % 8
        return sum(values, from, from + half) + sum(values, from + half, until)
    }
    val r = values.copyOfRange(from, from + 8)
    var i = 8
    while (i < n - n % 8) {
        for (j in 0..7) r[j] += values[from + i + j]
        i += 8
    }
    var total = ((r[0] + r[1]) + (r[2] + r[3])) + ((r[4] + r[5]) + (r[6] + r[7]))
    while (i < n) total += values[from + i++]
    return total
}

/** Mean in NumPy's order. */
internal fun mean(values: DoubleArray): Double = sum(values) / values.size

/** Concatenates the arrays. */
internal fun List<DoubleArray>.flatten(): DoubleArray {
    val all = DoubleArray(sumOf { it.size })
    var at = 0
    for (each in this) {
        each.copyInto(all, at)
        at += each.size
    }
    return all
}

/** An unmodifiable copy; casting it to a MutableList does not make it writable. */
internal fun <T> List<T>.frozen(): List<T> = Collections.unmodifiableList(ArrayList(this))
