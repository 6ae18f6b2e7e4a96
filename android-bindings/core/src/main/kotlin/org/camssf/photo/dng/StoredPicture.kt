package org.camssf.photo.dng

import org.camssf.NotSensorRaw
import org.camssf.Refusal
import org.camssf.UnreadableRaw
import org.camssf.UnsupportedRaw
import org.camssf.photo.Region
import java.nio.ByteOrder
import kotlin.math.abs

internal const val UNCOMPRESSED = 1
internal const val LOSSLESS_JPEG = 7
internal const val DEFLATE = 8

private const val CFA = 32803L
private const val LINEAR_RAW = 34892L
private const val MAX_SIDE = 65535L

/** Largest number of samples of a photo (SECURITY.md); phones' largest mosaics have 201 million. */
private const val MAX_SAMPLES = 220_000_000L
private const val MAX_PIECES = 1L shl 16

/** Pairs of rows that are compared to tell whether rows are padded. */
private const val PAIRS = 64

/** Upper limit of deflate's compression ratio. */
private const val MAX_DEFLATE = 1032L

private val CODECS = mapOf(
    5L to "LZW",
    34892L to "lossy JPEG",
    34713L to "Nikon NEF",
    32767L to "Sony ARW",
    50002L to "JPEG XL",
    52546L to "JPEG XL",
)

/**
 * Layout of the stored picture and its pieces: strips or tiles, row by row from the top left.
 *
 * @property area the active area, in samples of the stored picture.
 * @property differences true if deflate holds differences of neighbours (TIFF's predictor 2).
 * @property pieceWidth width of a piece, samples; edge tiles are padded to it.
 * @property pieceHeight rows of a piece; the last strip may have fewer.
 * @property across number of pieces in a row.
 * @property offsets first byte of each piece in the file.
 * @property ends the byte behind the last of each piece.
 */
internal class StoredPicture(
    val width: Int,
    val height: Int,
    val bits: Int,
    val compression: Int,
    val differences: Boolean,
    val area: Region,
    val tiled: Boolean,
    val pieceWidth: Int,
    val pieceHeight: Int,
    val across: Int,
    val offsets: LongArray,
    val ends: LongArray,
) {
    /** Bytes from row to row of an uncompressed piece. */
    var stride: Int = rowBytes
        private set

    /** Sets [stride]. */
    fun padded(stride: Int): StoredPicture = also { it.stride = stride }

    /** Number of rows that piece `number` stores. */
    fun rows(number: Int): Int = if (tiled) pieceHeight else minOf(pieceHeight, height - number * pieceHeight)

    /** Bytes of an uncompressed row of a piece. */
    val rowBytes: Int get() = ((pieceWidth.toLong() * bits + 7) / 8).toInt()

    /** Byte order of the samples: packed ones have the highest bit first in every file. */
    fun order(tiff: Tiff): ByteOrder = if (bits == 16) tiff.order else ByteOrder.BIG_ENDIAN
}

/**
 * The directory of the largest full-resolution mosaic.
 *
 * @throws NotSensorRaw the file holds only demosaiced pictures.
 * @throws UnsupportedRaw the file is a raw file but no DNG, has another DNG version, or holds no mosaic.
 * @throws UnreadableRaw the file is an ordinary TIFF picture.
 */
internal fun rawDirectory(tiff: Tiff): Directory {
    val version = tiff.raw(tiff.main[0], Tag.DNG_VERSION, 4)
    if (version.isEmpty()) {
        if (tiff.all.any { tiff.whole(it, Tag.PHOTOMETRIC).firstOrNull() == CFA }) {
            throw Refusal.of("unsupported_raw.no_dng", "file" to tiff.name)
        }
        throw Refusal.of("unreadable_raw.tiff_picture", "file" to tiff.name)
    }
    if (version[0].toInt() != 1) {
        throw Refusal.of(
            "unsupported_raw.dng_version", "file" to tiff.name, "version" to version[0].toInt(),
        )
    }
    val full = tiff.all.filter { tiff.one(it, Tag.NEW_SUBFILE_TYPE, 0) == 0L }
    val mosaics = full.filter { tiff.one(it, Tag.PHOTOMETRIC, -1) == CFA }
    val largest = mosaics.maxByOrNull { tiff.one(it, Tag.WIDTH, 0).toDouble() * tiff.one(it, Tag.HEIGHT, 0) }
    if (largest != null) return largest
    if (full.any { tiff.one(it, Tag.PHOTOMETRIC, -1) == LINEAR_RAW }) {
        throw Refusal.of("not_sensor_raw.linear_dng", "file" to tiff.name)
    }
    throw Refusal.of("unsupported_raw.no_mosaic", "file" to tiff.name)
}

/**
 * Reads size, coding, active area and pieces, and checks them against the file's size.
 *
 * @throws UnsupportedRaw a form that camssf does not read; the message names it.
 * @throws UnreadableRaw the numbers contradict each other or the file's size.
 */
internal fun storedPicture(tiff: Tiff, raw: Directory): StoredPicture {
    val width = tiff.one(raw, Tag.WIDTH, 0)
    val height = tiff.one(raw, Tag.HEIGHT, 0)
    if (width !in 2..MAX_SIDE || height !in 2..MAX_SIDE) {
        throw tiff.damaged("a picture of $width × $height samples")
    }
    val bits = tiff.whole(raw, Tag.BITS).let { if (it.isEmpty()) longArrayOf(1) else it }
    val samples = tiff.one(raw, Tag.SAMPLES, 1)
    if (samples != 1L || bits.size != 1) {
        throw Refusal.of("unsupported_raw.samples_per_pixel", "file" to tiff.name, "count" to samples)
    }
    if (tiff.one(raw, Tag.SAMPLE_FORMAT, 1) != 1L) {
        throw Refusal.of("unsupported_raw.sample_format", "file" to tiff.name)
    }
    val compression = tiff.one(raw, Tag.COMPRESSION, 1)
    if (compression != 1L && compression != 7L && compression != 8L) {
        val codec = CODECS[compression] ?: "number $compression"
        throw Refusal.of("unsupported_raw.compression", "file" to tiff.name, "codec" to codec)
    }
    if (bits[0] !in
        8..16
    ) {
        throw Refusal.of("unsupported_raw.bits", "file" to tiff.name, "bits" to bits[0])
    }
    val order = tiff.one(raw, Tag.FILL_ORDER, 1)
    if (order != 1L) {
        throw Refusal.of("unsupported_raw.fill_order", "file" to tiff.name, "order" to order)
    }
    val area = area(tiff, raw, width, height)
    return pieces(tiff, raw, width, height, bits[0].toInt(), compression.toInt(), area)
}

private fun area(tiff: Tiff, raw: Directory, width: Long, height: Long): Region {
    val stored = tiff.whole(raw, Tag.ACTIVE_AREA, 4)
    val (top, left, bottom, right) = if (stored.isEmpty()) longArrayOf(0, 0, height, width) else stored
    val inside = 0 <= top && bottom <= height && 0 <= left && right <= width
    if (!inside || bottom - top < 2 || right - left < 2) {
        throw tiff.damaged("active area $top, $left, $bottom, $right in $width × $height samples")
    }
    return Region(left.toInt(), top.toInt(), right.toInt(), bottom.toInt())
}

private fun pieces(
    tiff: Tiff, raw: Directory, width: Long, height: Long, bits: Int, compression: Int, area: Region,
): StoredPicture {
    val tiled = Tag.TILE_WIDTH in raw || Tag.TILE_HEIGHT in raw
    val pieceWidth = if (tiled) tiff.one(raw, Tag.TILE_WIDTH, 0) else width
    val pieceHeight =
        if (tiled) tiff.one(raw, Tag.TILE_HEIGHT, 0) else minOf(tiff.one(raw, Tag.ROWS_PER_STRIP, height), height)
    if (pieceWidth !in 1..MAX_SIDE || pieceHeight !in 1..MAX_SIDE) {
        throw tiff.damaged("pieces of $pieceWidth × $pieceHeight samples")
    }
    val across = (width + pieceWidth - 1) / pieceWidth
    val pieces = across * ((height + pieceHeight - 1) / pieceHeight)
    if (pieces > MAX_PIECES) throw tiff.damaged("its samples in $pieces pieces")
    val offsetTag = if (tiled) Tag.TILE_OFFSETS else Tag.STRIP_OFFSETS
    val countTag = if (tiled) Tag.TILE_COUNTS else Tag.STRIP_COUNTS
    if (tiff.count(raw, offsetTag) != pieces || tiff.count(raw, countTag) != pieces) {
        throw tiff.damaged("${tiff.count(raw, offsetTag)} pieces of data instead of $pieces")
    }
    val offsets = tiff.whole(raw, offsetTag, pieces)
    val picture = StoredPicture(
        width.toInt(), height.toInt(), bits, compression, differences(tiff, raw, bits, compression), area, tiled,
        pieceWidth.toInt(), pieceHeight.toInt(), across.toInt(), offsets, ends(tiff, offsets),
    )
    checkExtent(tiff, picture)
    if (width * height > MAX_SAMPLES) {
        throw Refusal.of(
            "unsupported_raw.too_large", "file" to tiff.name, "width" to width, "height" to height,
            "most" to MAX_SAMPLES / 1_000_000,
        )
    }
    return picture.padded(stride(tiff, picture, tiff.whole(raw, countTag, pieces)))
}

/** Deflate's predictor 2: each sample is stored as the difference from its left neighbour. */
private fun differences(tiff: Tiff, raw: Directory, bits: Int, compression: Int): Boolean {
    if (compression != DEFLATE) return false
    val predictor = tiff.one(raw, Tag.PREDICTOR, 1)
    if (predictor == 1L) return false
    if (predictor != 2L || bits % 8 != 0) {
        throw Refusal.of(
            "unsupported_raw.deflate_predictor", "file" to tiff.name, "predictor" to predictor, "bits" to bits,
        )
    }
    return true
}

/**
 * The byte behind each piece's last: the next piece or directory, or the file's end. The byte counts are not trusted,
 * like LibRaw does: some writers compute them wrongly.
 */
private fun ends(tiff: Tiff, offsets: LongArray): LongArray {
    val pieces = offsets.sortedArray()
    if ((1 until pieces.size).any { pieces[it] == pieces[it - 1] }) throw tiff.damaged("its pieces of data overlap")
    val places = (pieces + tiff.places.toLongArray() + tiff.size).apply { sort() }
    return LongArray(offsets.size) {
        var next = places.binarySearch(offsets[it])
        while (next < places.size && places[next] <= offsets[it]) next++
        if (next < places.size) places[next] else tiff.size
    }
}

/** Checks that every piece can hold its samples. */
private fun checkExtent(tiff: Tiff, picture: StoredPicture) {
    for (number in picture.offsets.indices) {
        val at = picture.offsets[number]
        val plain = picture.rows(number).toLong() * picture.rowBytes
        val least = when (picture.compression) {
            UNCOMPRESSED -> plain

            // at least one bit per sample
            LOSSLESS_JPEG -> (picture.rows(number).toLong() * picture.pieceWidth + 7) / 8

            else -> maxOf(1, plain / MAX_DEFLATE)
        }
        if (at < 8 || at >= tiff.size) {
            throw tiff.damaged("its samples end at byte ${at + least} of ${tiff.size}")
        }
        if (at + least > picture.ends[number]) throw tiff.damaged("piece $number of its data is too short")
    }
}

/**
 * Bytes from row to row: more than a row's own if the byte counts allow for padding and the samples show it.
 * Neighbouring rows of one colour resemble each other if they are read with the right stride.
 */
private fun stride(tiff: Tiff, picture: StoredPicture, counts: LongArray): Int {
    val plain = picture.rowBytes
    val rows = picture.rows(0)
    val padded = counts[0] / rows
    val fits = counts.indices.all {
        (counts[it] == picture.rows(it) * padded || counts[it] == picture.pieceHeight * padded) &&
            picture.offsets[it] + picture.rows(it) * padded <= picture.ends[it]
    }
    if (picture.compression != UNCOMPRESSED || padded <= plain || !fits || rows < 3) return plain
    val steps = 0 until rows - 2 step maxOf(1, (rows - 2) / PAIRS)
    val better = 10 * unlike(tiff, picture, padded, steps) < 9 * unlike(tiff, picture, plain.toLong(), steps)
    return if (better) padded.toInt() else plain
}

/** Sum of absolute differences between rows of the first piece and the rows two below. */
private fun unlike(tiff: Tiff, picture: StoredPicture, stride: Long, steps: IntProgression): Long {
    val bytes = ByteArray(picture.rowBytes + Packed.SLACK)
    val packed = Packed(bytes, picture.bits, picture.order(tiff))
    val (above, below) = List(2) { ShortArray(picture.pieceWidth) }
    fun read(y: Int, row: ShortArray) {
        tiff.read(picture.offsets[0] + y * stride, bytes, 0, picture.rowBytes)
        packed.copy(0, row.size, row, 0)
    }
    return steps.sumOf { y ->
        read(y, above)
        read(y + 2, below)
        above.indices.sumOf { abs((below[it].toInt() and 0xffff) - (above[it].toInt() and 0xffff)).toLong() }
    }
}
