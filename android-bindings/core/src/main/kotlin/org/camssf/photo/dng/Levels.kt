package org.camssf.photo.dng

import org.camssf.Refusal
import org.camssf.photo.Mosaic
import org.camssf.photo.Region
import kotlin.math.abs
import kotlin.math.pow

private const val MAX_MASKED = 64L

/** The Bayer order at the active area's corner, which is the pattern's origin. */
internal fun cfa(tiff: Tiff, raw: Directory): String {
    val size = tiff.whole(raw, Tag.CFA_SIZE, 2)
    val planes = tiff.raw(raw, Tag.CFA_PLANES, 16).let { if (it.isEmpty()) byteArrayOf(0, 1, 2) else it }
    val letters = tiff.raw(raw, Tag.CFA_PATTERN, 64).joinToString("") {
        if (it in planes && it in 0..2) "RGB"[it.toInt()].toString() else "?"
    }
    val square = size.isEmpty() || (size[0] == 2L && size[1] == 2L)
    if (!square || letters !in Mosaic.CFA_ORDERS || tiff.one(raw, Tag.CFA_LAYOUT, 1) != 1L) {
        val sides = if (size.isEmpty()) longArrayOf(2, 2) else size
        throw Refusal.of(
            "unsupported_raw.colour_filters", "file" to tiff.name, "filters" to letters.ifEmpty { "unnamed" },
            "rows" to sides[0], "columns" to sides[1], "orders" to Mosaic.CFA_ORDERS.joinToString(),
        )
    }
    return letters
}

/** (2, 2) row-major DN: the mean black level of each position of the colour cell over the active area. */
internal fun black(tiff: Tiff, raw: Directory, area: Region): DoubleArray {
    val repeat = tiff.whole(raw, Tag.BLACK_REPEAT, 2)
    val (rows, columns) = if (repeat.isEmpty()) longArrayOf(1, 1) else repeat
    if (rows !in 1..64 || columns !in 1..64) {
        throw tiff.damaged("a black level that repeats every $rows × $columns samples")
    }
    val pattern = tiff.numbers(raw, Tag.BLACK, rows * columns) ?: DoubleArray((rows * columns).toInt())
    val across = tiff.numbers(raw, Tag.BLACK_ACROSS, area.width.toLong())
    val down = tiff.numbers(raw, Tag.BLACK_DOWN, area.height.toLong())
    val black = DoubleArray(4) { cell ->
        val i = cell / 2
        val j = cell % 2
        patternMean(pattern, rows.toInt(), columns.toInt(), i, j) +
            ((down?.every2(i) ?: 0.0) + (across?.every2(j) ?: 0.0))
    }
    if (black.any { !(abs(it) <= 65535.0) }) throw tiff.damaged("its black level is no number")
    return black
}

/**
 * Mean of a repeating pattern at rows of parity i and columns of parity j. With an odd period, each entry occurs at
 * both parities.
 */
private fun patternMean(pattern: DoubleArray, rows: Int, columns: Int, i: Int, j: Int): Double {
    var sum = 0.0
    for (y in i until 2 * rows step 2) {
        for (x in j until 2 * columns step 2) {
            sum +=
                pattern[y % rows * columns + x % columns]
        }
    }
    return sum / (rows * columns)
}

private fun DoubleArray.every2(first: Int): Double {
    var sum = 0.0
    for (at in first until size step 2) sum += this[at]
    return sum / ((size - first + 1) / 2)
}

/** The white level, DN; 2^bits - 1 if the tag is missing. */
internal fun white(tiff: Tiff, raw: Directory, bits: Int): Double {
    val white = tiff.numbers(raw, Tag.WHITE, 1)?.get(0) ?: (2.0.pow(bits) - 1)
    if (!(white > 0 && white <= 65535)) throw tiff.damaged("a white level of $white")
    return white
}

/**
 * (65536) linearised value of each stored value, unsigned 16-bit; the table's last entry holds beyond its end. Null
 * if there is no table.
 */
internal fun linearization(tiff: Tiff, raw: Directory): ShortArray? {
    if (tiff.count(raw, Tag.LINEARIZATION) > 65536) throw tiff.damaged("a linearization table of too many values")
    val table = tiff.whole(raw, Tag.LINEARIZATION)
    if (table.isEmpty()) return null
    if (table.any { it !in 0..65535 }) throw tiff.damaged("its linearization table leaves 16 bits")
    return ShortArray(65536) { table[minOf(it, table.size - 1)].toShort() }
}

/** Shielded parts of the sensor, in samples of the stored picture; invalid rectangles are left out. */
internal fun maskedAreas(tiff: Tiff, raw: Directory, picture: StoredPicture): List<Region> {
    val count = tiff.count(raw, Tag.MASKED_AREAS)
    if (count == 0L || count % 4 != 0L || count > 4 * MAX_MASKED) return emptyList()
    val values = tiff.whole(raw, Tag.MASKED_AREAS)
    return (0 until values.size / 4).mapNotNull {
        val (top, left, bottom, right) = values.copyOfRange(4 * it, 4 * it + 4)
        val inside =
            top in 0 until bottom && bottom <= picture.height && left in 0 until right && right <= picture.width
        if (inside) Region(left.toInt(), top.toInt(), right.toInt(), bottom.toInt()) else null
    }
}

/** The first positive number under `tag`; some writers store 0 for unknown. */
internal fun positive(tiff: Tiff, directories: List<Directory>, tag: Int): Double? {
    for (directory in directories) {
        val value = tiff.numbers(directory, tag, limit = 1)?.get(0) ?: continue
        if (value > 0 && !value.isInfinite()) return value
    }
    return null
}

/** The numbers under `tag` if there are exactly `count` and all are finite; null otherwise. */
internal fun finite(tiff: Tiff, directory: Directory, tag: Int, count: Int): DoubleArray? {
    val values = tiff.numbers(directory, tag, limit = count) ?: return null
    val whole = tiff.count(directory, tag) == count.toLong()
    return if (whole && values.none { it.isNaN() || it.isInfinite() }) values else null
}

/** Noise profile: pairs (S, O), one pair or one for each of up to four planes; null if missing or invalid. */
internal fun noiseProfile(tiff: Tiff, raw: Directory): DoubleArray? {
    val directory = if (Tag.NOISE_PROFILE in raw) raw else tiff.main[0]
    val count = tiff.count(directory, Tag.NOISE_PROFILE)
    return if (count in 2..8 && count % 2 == 0L) finite(tiff, directory, Tag.NOISE_PROFILE, count.toInt()) else null
}
