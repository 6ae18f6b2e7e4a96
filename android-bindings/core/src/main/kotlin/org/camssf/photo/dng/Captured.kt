package org.camssf.photo.dng

private val TIME = Regex("([0-9]{4}):([0-9]{2}):([0-9]{2}) ([0-9]{2}):([0-9]{2}):([0-9]{2})")
private val OFFSET = Regex("[+-]([0-9]{2}):([0-9]{2})")
private val LENGTHS = listOf(0, 31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31)

/**
 * Capture time as ISO 8601: Exif's DateTimeOriginal with its offset. "" if the tag is missing or invalid; a clock
 * that was never set writes zeros or blanks.
 */
internal fun captured(tiff: Tiff, exif: Directory): String {
    val parts = TIME.matchEntire(tiff.text(exif, Tag.TIME))?.groupValues?.drop(1) ?: return ""
    val (year, month, day) = parts.map { it.toInt() }
    val (hour, minute, second) = parts.drop(3).map { it.toInt() }
    val leap = year % 4 == 0 && (year % 100 != 0 || year % 400 == 0)
    val length = if (month == 2 && leap) 29 else LENGTHS.getOrElse(month) { 0 }
    if (year < 1 || day !in 1..length || hour > 23 || minute > 59 || second > 59) return ""
    val offset = OFFSET.matchEntire(tiff.text(exif, Tag.TIME_OFFSET))
    if (offset != null && (offset.groupValues[1].toInt() > 23 || offset.groupValues[2].toInt() > 59)) return ""
    return parts.take(3).joinToString("-") + "T" + parts.drop(3).joinToString(":") + offset?.value.orEmpty()
}
