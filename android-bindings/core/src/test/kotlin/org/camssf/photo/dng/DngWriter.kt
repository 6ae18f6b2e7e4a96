package org.camssf.photo.dng

import java.io.ByteArrayOutputStream
import java.nio.ByteBuffer
import java.nio.ByteOrder
import java.util.TreeMap
import java.util.zip.Deflater

/** A tag's value: TIFF type and numbers (two for each rational). */
internal class Value(val kind: Int, val numbers: List<Number>) {
    companion object {
        fun bytes(vararg numbers: Int) = Value(1, numbers.toList())
        fun blob(bytes: ByteArray) = Value(7, bytes.toList())
        fun text(text: String) = Value(2, (text + "\u0000").toByteArray().toList())
        fun short(vararg numbers: Int) = Value(3, numbers.toList())
        fun long(vararg numbers: Long) = Value(4, numbers.toList())
        fun long(vararg numbers: Int) = Value(4, numbers.toList())
        fun rational(vararg numbers: Int) = Value(5, numbers.toList())
        fun srational(vararg numbers: Int) = Value(10, numbers.toList())
        fun double(vararg numbers: Double) = Value(12, numbers.toList())
    }
}

internal typealias Tags = Map<Int, Value?>

/** Where the mosaic's directory lies: the first, the second of the chain, a child, or a grandchild. */
internal enum class Place { FIRST, CHAIN, CHILD, GRANDCHILD }

/**
 * A DNG to be, odd ones included; written byte by byte, independently of the reader.
 *
 * @property samples (height, width) as stored, row-major.
 * @property tile width and height of tiles, or null for strips.
 * @property jpeg makes the encoder for a piece's width.
 * @property raw tags of the mosaic's directory, over the defaults; null removes. Likewise `first` of the first one.
 */
internal class DngWriter(
    val width: Int,
    val height: Int,
    val samples: IntArray,
    val bits: Int = 16,
    val order: ByteOrder = ByteOrder.LITTLE_ENDIAN,
    val compression: Int = 1,
    val tile: Pair<Int, Int>? = null,
    val rowsPerStrip: Int? = null,
    val reversePieces: Boolean = false,
    val place: Place = Place.FIRST,
    val cfa: String = "RGGB",
    val predictor: Int = 1,
    val jpeg: (Int) -> JpegWriter = { JpegWriter(bits, it) },
    val raw: Tags = emptyMap(),
    val first: Tags = emptyMap(),
    val exif: Tags = emptyMap(),
) {
    /** The file. */
    fun encode(): ByteArray {
        val pieces = pieces()
        val body = ByteArrayOutputStream()
        val offsets = LongArray(pieces.size)
        for (number in if (reversePieces) pieces.indices.reversed() else pieces.indices) {
            offsets[number] = 8L + body.size()
            body.write(pieces[number])
        }
        while (body.size() % 4 != 0) body.write(0)
        val mosaic = over(mosaicTags(offsets, pieces.map { it.size.toLong() }.toLongArray()), raw)
        val preview: Tags = mapOf(
            254 to Value.long(1), 256 to Value.long(2), 257 to Value.long(2),
            262 to Value.short(1),
        )
        fun add(tags: Tags, next: Long = 0): Long {
            val at = 8L + body.size()
            body.write(directory(tags, at, next))
            return at
        }
        val exifAt = if (exif.isEmpty()) null else add(exif)
        val general = over(generalTags(), if (exifAt == null) first else mapOf(34665 to Value.long(exifAt)) + first)
        val start = when (place) {
            Place.FIRST -> add(mosaic + general)

            Place.CHAIN -> add(preview + general, add(mosaic))

            Place.CHILD -> add(preview + general + (330 to Value.long(add(mosaic))))

            Place.GRANDCHILD -> {
                val child = add(preview + (330 to Value.long(add(mosaic))))
                add(preview + general + (330 to Value.long(child)))
            }
        }
        val head = ByteBuffer.allocate(8).order(order)
        head.put(
            (
                if (order ==
                    ByteOrder.LITTLE_ENDIAN
                ) {
                    "II"
                } else {
                    "MM"
                }
                ).toByteArray(),
        ).putShort(42).putInt(start.toInt())
        return head.array() + body.toByteArray()
    }

    private fun over(base: Tags, more: Tags): Tags = (base + more).filterValues { it != null }

    private fun generalTags(): Tags = mapOf(
        271 to Value.text("Maker"),
        272 to Value.text("Model 1"),
        50706 to Value.bytes(1, 4, 0, 0),
        50708 to Value.text("Maker Model 1"),
    )

    private fun mosaicTags(offsets: LongArray, counts: LongArray): Tags {
        val tags: MutableMap<Int, Value?> = mutableMapOf(
            254 to Value.long(0),
            256 to Value.long(width),
            257 to Value.long(height),
            258 to Value.short(bits),
            259 to Value.short(compression),
            262 to Value.short(32803),
            277 to Value.short(1),
            284 to Value.short(1),
            33421 to Value.short(2, 2),
            33422 to Value(1, cfa.map { "RGB".indexOf(it) }),
        )
        if (predictor != 1) tags[317] = Value.short(predictor)
        if (tile != null) {
            tags += mapOf(322 to Value.long(tile.first), 323 to Value.long(tile.second))
            tags += mapOf(324 to Value(4, offsets.toList()), 325 to Value(4, counts.toList()))
        } else {
            tags += mapOf(278 to Value.long(rowsPerStrip ?: height))
            tags += mapOf(273 to Value(4, offsets.toList()), 279 to Value(4, counts.toList()))
        }
        return tags
    }

    /** The strips or tiles; edge tiles repeat the last sample. */
    private fun pieces(): List<ByteArray> {
        val across = tile?.first ?: width
        val down = tile?.second ?: rowsPerStrip ?: height
        val found = ArrayList<ByteArray>()
        for (top in 0 until height step down) {
            for (left in 0 until width step across) {
                val rows = if (tile == null) minOf(down, height - top) else down
                val piece = IntArray(rows * across) {
                    val y = minOf(top + it / across, height - 1)
                    samples[y * width + minOf(left + it % across, width - 1)]
                }
                found += when (compression) {
                    7 -> jpeg(across).encode(piece)
                    8 -> deflate(plain(difference(piece, across), across))
                    else -> plain(piece, across)
                }
            }
        }
        return found
    }

    private fun difference(piece: IntArray, across: Int): IntArray {
        if (predictor != 2) return piece
        return IntArray(piece.size) {
            (if (it % across == 0) piece[it] else piece[it] - piece[it - 1]) and ((1 shl bits) - 1)
        }
    }

    /** Rows as they lie in the file: words of 16 bits, or the samples' bits in one string. */
    private fun plain(piece: IntArray, across: Int): ByteArray {
        val out = ByteArrayOutputStream()
        for (row in piece.indices step across) {
            val line = piece.copyOfRange(row, row + across)
            if (bits == 16) {
                val words = ByteBuffer.allocate(2 * across).order(order)
                line.forEach { words.putShort(it.toShort()) }
                out.write(words.array())
            } else {
                val string = line.joinToString("") { it.toString(2).padStart(bits, '0') }
                string.chunked(8).forEach { out.write(it.padEnd(8, '0').toInt(2)) }
            }
        }
        return out.toByteArray()
    }

    private fun deflate(bytes: ByteArray): ByteArray {
        val deflater = Deflater(6)
        deflater.setInput(bytes)
        deflater.finish()
        val room = ByteArray(bytes.size + 1000)
        return room.copyOf(deflater.deflate(room)).also { deflater.end() }
    }

    /** One directory that will lie at byte `at`, its long values behind it. */
    private fun directory(tags: Tags, at: Long, next: Long): ByteArray {
        val sorted = TreeMap(tags.filterValues { it != null })
        val entries = ByteBuffer.allocate(2 + 12 * sorted.size + 4).order(order)
        val values = ByteArrayOutputStream()
        entries.putShort(sorted.size.toShort())
        for ((tag, value) in sorted) {
            val content = content(value!!)
            val each = if (value.kind == 5 || value.kind == 10) 2 else 1
            entries.putShort(tag.toShort()).putShort(value.kind.toShort()).putInt(value.numbers.size / each)
            if (content.size <= 4) {
                entries.put(content.copyOf(4))
            } else {
                entries.putInt((at + entries.capacity() + values.size()).toInt())
                values.write(content)
                while (values.size() % 4 != 0) values.write(0)
            }
        }
        entries.putInt(next.toInt())
        return entries.array() + values.toByteArray()
    }

    private fun content(value: Value): ByteArray {
        val buffer = ByteBuffer.allocate(8 * value.numbers.size).order(order)
        for (number in value.numbers) {
            when (value.kind) {
                3, 8 -> buffer.putShort(number.toShort())
                4, 5, 9, 10, 13 -> buffer.putInt(number.toInt())
                11 -> buffer.putFloat(number.toFloat())
                12 -> buffer.putDouble(number.toDouble())
                else -> buffer.put(number.toByte())
            }
        }
        return buffer.array().copyOf(buffer.position())
    }
}

/** Opcode lists, big-endian in every file. */
internal object OpcodeWriter {
    fun list(vararg opcodes: ByteArray): Value {
        val head = ByteBuffer.allocate(4).putInt(opcodes.size).array()
        return Value.blob(opcodes.fold(head) { all, each -> all + each })
    }

    fun opcode(number: Int, content: ByteArray, optional: Boolean = false): ByteArray =
        ByteBuffer.allocate(16 + content.size).putInt(number).putInt(0x01030000).putInt(if (optional) 1 else 0)
            .putInt(content.size).put(content).array()

    /** `numbers`: Int as 4 bytes, Float as 4, Double as 8. */
    fun content(vararg numbers: Number): ByteArray {
        val buffer = ByteBuffer.allocate(8 * numbers.size)
        for (number in numbers) {
            when (number) {
                is Double -> buffer.putDouble(number)
                is Float -> buffer.putFloat(number)
                else -> buffer.putInt(number.toInt())
            }
        }
        return buffer.array().copyOf(buffer.position())
    }
}
