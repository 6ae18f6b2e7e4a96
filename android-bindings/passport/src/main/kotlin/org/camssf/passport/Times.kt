package org.camssf.passport

import org.camssf.InvalidArgument
import kotlin.math.floor
import kotlin.math.round
import kotlin.time.Instant

/** The first second after the year 9999, in seconds since 1970. */
internal const val AFTER_ALL = 253402300800L

/** A time as Python's isoformat writes it. */
internal fun iso(at: Instant): String = at.toString().removeSuffix("Z") + "+00:00"

internal fun second(at: Long): Instant = Instant.fromEpochSeconds(at)

/**
 * End of a passport's validity, in seconds since 1970: a whole number of seconds after its beginning, at least one.
 */
internal fun end(begins: Long, days: Double): Long {
    val length = maxOf(1L, floor(round(days * 86400e6) / 1e6).toLong())
    if (begins < 0 || begins + length >= AFTER_ALL) {
        throw InvalidArgument(
            "The passport must begin after 1970 and end before the year 9999.",
            "Choose another begin or a shorter validity.",
        )
    }
    return begins + length
}

/** A time in ISO 8601, in the only spelling that Python's isoformat has; "" stays "". */
internal fun captured(text: String): String {
    if (text.isEmpty()) return ""
    val found = TIME.matchEntire(text)?.groupValues ?: throw noTime(text)
    val (year, month, day) = found.slice(1..3).map { it.toInt() }
    val (hour, minute, second) = found.slice(4..6).map { if (it.isEmpty()) 0 else it.toInt() }
    val leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0)
    val length = if (month == 2 && leap) 29 else LENGTHS.getOrElse(month) { 0 }
    if (year < 1 || day !in 1..length || hour > 23 || minute > 59 || second > 59) throw noTime(text)
    val micro = found[7].padEnd(6, '0').trimEnd('0').let { if (it.isEmpty()) "" else "." + it.padEnd(6, '0') }
    val zone = found[8].let { if (it == "Z" || it == "-00:00") "+00:00" else it }
    if (zone.isNotEmpty() && (zone.substring(1, 3).toInt() > 23 || zone.substring(4).toInt() > 59)) throw noTime(text)
    val clock = listOf(hour, minute, second).joinToString(":") { it.toString().padStart(2, '0') }
    return "${found[1]}-${found[2]}-${found[3]}T$clock$micro$zone"
}

private fun noTime(text: String) =
    InvalidArgument("'$text' is not a time.", "Write ISO 8601, as 2026-11-22T10:30:00+01:00.")

private val LENGTHS = listOf(0, 31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31)
private val TIME = Regex(
    "([0-9]{4})-([0-9]{2})-([0-9]{2})(?:[T ]([0-9]{2}):([0-9]{2})(?::([0-9]{2})(?:\\.([0-9]{1,6}))?)?" +
        "(Z|[+-][0-9]{2}:[0-9]{2})?)?",
)
