package org.camssf.photo.dng

import org.camssf.NotSensorRaw
import org.camssf.UnreadableRaw
import org.camssf.UnsupportedRaw
import org.camssf.photo.Region

internal const val UNCOMPRESSED = 1
internal const val LOSSLESS_JPEG = 7
internal const val DEFLATE = 8

private const val CFA = 32803L
private const val LINEAR_RAW = 34892L
private const val MAX_SIDE = 65535L
private const val MAX_SAMPLES = 1L shl 29
private const val MAX_PIECES = 1L shl 16

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
    val counts: LongArray,
) {
    /** Number of rows that piece `number` stores. */
    fun rows(number: Int): Int = if (tiled) pieceHeight else minOf(pieceHeight, height - number * pieceHeight)

    /** Bytes of an uncompressed row of a piece. */
    val rowBytes: Int get() = ((pieceWidth.toLong() * bits + 7) / 8).toInt()
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
            throw UnsupportedRaw("${tiff.name} is a raw file, but no DNG.", CONVERT)
        }
        throw UnreadableRaw(
            "${tiff.name} is a TIFF picture, not a DNG.", "Give the camera's RAW photo as DNG, not a picture.",
        )
    }
    if (version[0].toInt() != 1) throw UnsupportedRaw("${tiff.name} has DNG version ${version[0]}.", CONVERT)
    val full = tiff.all.filter { tiff.one(it, Tag.NEW_SUBFILE_TYPE, 0) == 0L }
    val mosaics = full.filter { tiff.one(it, Tag.PHOTOMETRIC, -1) == CFA }
    val largest = mosaics.maxByOrNull { tiff.one(it, Tag.WIDTH, 0).toDouble() * tiff.one(it, Tag.HEIGHT, 0) }
    if (largest != null) return largest
    if (full.any { tiff.one(it, Tag.PHOTOMETRIC, -1) == LINEAR_RAW }) {
        throw NotSensorRaw("${tiff.name} is a linear DNG: its samples are demosaiced, not the sensor's.", RAW_MODE)
    }
    throw UnsupportedRaw("${tiff.name} holds no mosaic of sensor samples.", RAW_MODE)
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
    if (width !in 2..MAX_SIDE || height !in 2..MAX_SIDE || width * height > MAX_SAMPLES) {
        throw tiff.damaged("a picture of $width × $height samples")
    }
    val bits = tiff.whole(raw, Tag.BITS).let { if (it.isEmpty()) longArrayOf(1) else it }
    val samples = tiff.one(raw, Tag.SAMPLES, 1)
    if (samples != 1L || bits.size != 1) {
        throw UnsupportedRaw("${tiff.name} holds $samples samples a pixel, a mosaic has one.", RAW_MODE)
    }
    if (tiff.one(raw, Tag.SAMPLE_FORMAT, 1) != 1L) {
        throw UnsupportedRaw("${tiff.name} holds floating-point or signed samples.", CONVERT)
    }
    val compression = tiff.one(raw, Tag.COMPRESSION, 1)
    if (compression != 1L && compression != 7L && compression != 8L) {
        val codec = CODECS[compression] ?: "number $compression"
        throw UnsupportedRaw("${tiff.name} is compressed with $codec.", "Use lossless JPEG or none. $CONVERT")
    }
    if (bits[0] !in
        8..16
    ) {
        throw UnsupportedRaw("${tiff.name} holds samples of ${bits[0]} bits, not 8 to 16.", CONVERT)
    }
    val order = tiff.one(raw, Tag.FILL_ORDER, 1)
    if (order != 1L) {
        throw UnsupportedRaw("${tiff.name} states FillOrder $order: bytes with the lowest bit first.", CONVERT)
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
    val picture = StoredPicture(
        width.toInt(), height.toInt(), bits, compression, differences(tiff, raw, bits, compression), area, tiled,
        pieceWidth.toInt(), pieceHeight.toInt(), across.toInt(),
        tiff.whole(raw, offsetTag, pieces), tiff.whole(raw, countTag, pieces),
    )
    checkExtent(tiff, picture)
    return picture
}

/** Deflate's predictor 2: each sample is stored as the difference from its left neighbour. */
private fun differences(tiff: Tiff, raw: Directory, bits: Int, compression: Int): Boolean {
    if (compression != DEFLATE) return false
    val predictor = tiff.one(raw, Tag.PREDICTOR, 1)
    if (predictor == 1L) return false
    if (predictor != 2L || bits % 8 != 0) {
        throw UnsupportedRaw("${tiff.name} uses deflate with predictor $predictor on samples of $bits bits.", CONVERT)
    }
    return true
}

/**
 * Checks that every piece is inside the file and large enough for its samples, and that all together fit in the file.
 */
private fun checkExtent(tiff: Tiff, picture: StoredPicture) {
    var sum = 0L
    for (number in picture.offsets.indices) {
        val at = picture.offsets[number]
        val count = picture.counts[number]
        if (at < 8 || count < 1 || at + count > tiff.size) {
            throw tiff.damaged("its samples end at byte ${at + count} of ${tiff.size}")
        }
        val plain = picture.rows(number).toLong() * picture.rowBytes
        val least = when (picture.compression) {
            UNCOMPRESSED -> plain

            // at least one bit per sample
            LOSSLESS_JPEG -> (picture.rows(number).toLong() * picture.pieceWidth + 7) / 8

            else -> plain / MAX_DEFLATE
        }
        if (count < least || count > Int.MAX_VALUE - 64) throw tiff.damaged("piece $number of its data is too short")
        sum += count
    }
    if (sum > tiff.size) throw tiff.damaged("its pieces of data overlap")
}
