package org.camssf.photo.dng

import java.nio.ByteBuffer
import java.nio.ByteOrder
import java.util.zip.DataFormatException
import java.util.zip.Inflater

private const val CHUNK = 1 shl 18

/** Bytes allowed for headers; compressed samples take less than twice their plain size. */
private const val MAX_TABLES = 1L shl 16

/**
 * Decodes only the strips or tiles that the wanted part touches; compressed ones to their end, so that damage in them
 * is seen wherever it is.
 *
 * @param window receives the rows.
 * @param extraBits true if category 16 of lossless JPEG is followed by 16 bits, as in DNG before 1.1.
 */
internal fun decode(
    tiff: Tiff,
    picture: StoredPicture,
    window: Window,
    extraBits: Boolean,
) {
    val jpeg = LosslessJpeg(tiff, extraBits)
    val bytes = Scratch()
    for (number in picture.offsets.indices) {
        val left = number % picture.across * picture.pieceWidth
        val top = number / picture.across * picture.pieceHeight
        val rows = window.rows(left, top, picture.pieceWidth, picture.rows(number))
        if (rows.isEmpty()) continue
        val piece = Piece(tiff, picture, number, left, top, rows, window)
        when (picture.compression) {
            UNCOMPRESSED -> piece.plain(bytes)
            LOSSLESS_JPEG -> piece.jpeg(jpeg, bytes)
            else -> piece.inflate(bytes)
        }
    }
}

/** A reusable buffer that grows as needed. */
internal class Scratch {
    private var bytes = ByteArray(0)

    fun of(size: Int): ByteArray {
        if (bytes.size < size) bytes = ByteArray(size)
        return bytes
    }
}

/** One strip or tile at (left, top) of the stored picture; `rows` are its wanted rows. */
private class Piece(
    private val tiff: Tiff,
    private val picture: StoredPicture,
    private val number: Int,
    private val left: Int,
    private val top: Int,
    private val rows: IntRange,
    private val window: Window,
) {
    private val at = picture.offsets[number]
    private val length =
        minOf(picture.ends[number] - at, 2L * picture.rows(number) * picture.rowBytes + MAX_TABLES).toInt()
    private val width = minOf(picture.pieceWidth, picture.width - left)

    private val order = picture.order(tiff)

    fun plain(scratch: Scratch) {
        val some = maxOf(1, CHUNK / picture.stride)
        val bytes = scratch.of(some * picture.stride + Packed.SLACK)
        val packed = Packed(bytes, picture.bits, order)
        for (first in rows step some) {
            val count = minOf(some, rows.last + 1 - first)
            tiff.read(at + first.toLong() * picture.stride, bytes, 0, (count - 1) * picture.stride + picture.rowBytes)
            for (row in 0 until count) {
                packed.start = row * picture.stride
                window.put(left, top + first + row, width, packed)
            }
        }
    }

    fun jpeg(jpeg: LosslessJpeg, scratch: Scratch) {
        val bytes = scratch.of(length + LosslessJpeg.SLACK)
        tiff.read(at, bytes, 0, length)
        val samples = picture.pieceWidth.toLong() * picture.rows(number)
        jpeg.decode(bytes, length, samples, ::put)
    }

    /** Distributes `line`, which starts at sample `from` of the piece, over the piece's rows. */
    private fun put(line: LosslessJpeg.Line, from: Long) {
        var row = (from / picture.pieceWidth).toInt()
        var column = (from % picture.pieceWidth).toInt()
        line.start = 0
        while (line.start < line.size) {
            val count = minOf(line.size - line.start, picture.pieceWidth - column)
            window.put(left + column, top + row, minOf(count, width - column), line)
            line.start += count
            column = 0
            row++
        }
    }

    fun inflate(scratch: Scratch) {
        val row = ShortArray(picture.pieceWidth)
        val bytes = scratch.of(picture.rowBytes + Packed.SLACK)
        val packed = Packed(bytes, picture.bits, order)
        val stream = Inflated(tiff, at, length)
        try {
            for (y in 0 until picture.rows(number)) {
                stream.read(bytes, picture.rowBytes)
                if (y !in rows) continue
                packed.copy(0, row.size, row, 0)
                if (picture.differences) accumulate(row)
                window.put(left, top + y, width) { from, count, into, at ->
                    System.arraycopy(row, from, into, at, count)
                }
            }
            stream.finish()
        } finally {
            stream.close()
        }
    }

    /** Reverses horizontal differencing, modulo the sample's range. TIFF 6.0, section 14. */
    private fun accumulate(row: ShortArray) {
        val mask = (1 shl picture.bits) - 1
        for (i in 1 until row.size) row[i] = (row[i] + row[i - 1] and mask).toShort()
    }
}

/**
 * Rows of unsigned samples of 8 to 16 bits: 16-bit words in byte order `order`; other sizes are packed, highest bit
 * first.
 *
 * @param bytes the samples, followed by [SLACK] bytes.
 * @property start offset of the row, bytes.
 */
internal class Packed(private val bytes: ByteArray, private val bits: Int, order: ByteOrder) : Window.Row {
    var start = 0
    private val words = ByteBuffer.wrap(bytes).order(order)
    private val shorts = words.asShortBuffer()

    override fun copy(from: Int, count: Int, into: ShortArray, at: Int) {
        when (bits) {
            8 -> for (i in 0 until count) into[at + i] = (bytes[start + from + i].toInt() and 0xff).toShort()

            16 -> {
                if (start % 2 == 0) {
                    shorts.position(start / 2 + from)
                    shorts.get(into, at, count)
                } else {
                    for (i in 0 until count) into[at + i] = words.getShort(start + 2 * (from + i))
                }
            }

            else -> unpack(from, count, into, at)
        }
    }

    private fun unpack(from: Int, count: Int, into: ShortArray, at: Int) {
        val mask = (1 shl bits) - 1
        var bit = from * bits
        for (i in at until at + count) {
            val word = words.getInt(start + (bit ushr 3)) // big-endian, as bits != 16
            into[i] = (word ushr (32 - bits - (bit and 7)) and mask).toShort()
            bit += bits
        }
    }

    companion object {
        const val SLACK = 4
    }
}

/** The bytes of a zlib stream in the file. */
private class Inflated(private val tiff: Tiff, private var at: Long, private var left: Int) {
    private val inflater = Inflater()
    private val chunk = ByteArray(minOf(left, CHUNK))

    /** Reads exactly `length` bytes into `into`. */
    fun read(into: ByteArray, length: Int) {
        var have = 0
        while (have < length) {
            val count = some(into, have, length - have)
            if (count == 0) throw tiff.damaged("its deflated samples end early")
            have += count
        }
    }

    /** Checks that the stream ends here, including its checksum. */
    fun finish() {
        if (some(ByteArray(1), 0, 1) != 0) throw tiff.damaged("its deflated samples are too many")
        if (!inflater.finished()) throw tiff.damaged("its deflated samples have no end")
    }

    fun close() = inflater.end()

    /** Reads at least one byte; returns 0 at the end of the stream or the piece. */
    private fun some(into: ByteArray, from: Int, length: Int): Int {
        while (true) {
            val count = try {
                inflater.inflate(into, from, length)
            } catch (error: DataFormatException) {
                throw tiff.damaged("its deflated samples", error)
            }
            if (count > 0 || inflater.finished() || !inflater.needsInput() || left == 0) return count
            val next = minOf(left, chunk.size)
            tiff.read(at, chunk, 0, next)
            inflater.setInput(chunk, 0, next)
            at += next
            left -= next
        }
    }
}
