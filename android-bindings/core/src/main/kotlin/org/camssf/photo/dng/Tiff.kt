package org.camssf.photo.dng

import org.camssf.Refusal
import org.camssf.photo.fromApp
import java.nio.ByteBuffer
import java.nio.ByteOrder
import kotlin.math.abs
import kotlin.math.floor

/** One directory entry whose value is not yet read: TIFF type, count, and offset of the value. */
internal class Field(val kind: Int, val count: Long, val at: Long)

/** The entries of a directory with a tag in [Tag]. */
internal class Directory(private val fields: Map<Int, Field>) {
    /** The entry; null if the file has none. Only tags in [Tag] are kept; any other fails. */
    operator fun get(tag: Int): Field? {
        check(tag in Tag.KNOWN) { "tag $tag is not in Tag.KNOWN" }
        return fields[tag]
    }

    operator fun contains(tag: Int): Boolean = get(tag) != null
}

/**
 * The directories of a TIFF file. Values are read on demand, within the file's bounds and up to the requested length.
 *
 * Only the tags in [Tag] are kept, so many large directories need little memory.
 */
internal class Tiff(val source: DngSource) {
    val name: String = source.name
    val size: Long = source.size
    val order: ByteOrder
    val main = ArrayList<Directory>()
    val all = ArrayList<Directory>()

    /** Offsets of the directories. */
    val places = HashSet<Long>()

    init {
        if (size == 0L) throw Refusal.of("unreadable_raw.empty", "file" to name)
        val magic = bytes(0, minOf(size, 16L))
        if (OTHER_RAWS.any { (at, word) -> magic.holds(at, word) }) {
            throw Refusal.of("unsupported_raw.no_dng", "file" to name)
        }
        if (!magic.holds(0, "II*\u0000") && !magic.holds(0, "MM\u0000*")) {
            if (magic.holds(0, "II+\u0000") || magic.holds(0, "MM\u0000+")) {
                throw Refusal.of("unsupported_raw.big_tiff", "file" to name)
            }
            throw Refusal.of("unreadable_raw.no_dng", "file" to name)
        }
        order = if (magic[0] == 'I'.code.toByte()) ByteOrder.LITTLE_ENDIAN else ByteOrder.BIG_ENDIAN
        var at = word(4)
        while (at != 0L) at = directory(at, 0, main)
        if (main.isEmpty()) throw damaged("it has no directory")
    }

    /** The error for this file. */
    fun damaged(what: String, cause: Throwable? = null): Refusal =
        Refusal.of("unreadable_raw.damaged", "file" to name, "detail" to what, cause = cause)

    /** Reads `length` bytes from `at` into `into`. */
    fun read(at: Long, into: ByteArray, offset: Int, length: Int) {
        inside(at, length.toLong())
        fromApp(name) { source.read(at, into, offset, length) }
    }

    private fun inside(at: Long, length: Long) {
        if (at < 0 || length < 0 || at + length > size) throw damaged("byte ${at + length} is wanted of $size")
    }

    private fun bytes(at: Long, length: Long): ByteArray {
        inside(at, length)
        return ByteArray(length.toInt()).also { read(at, it, 0, it.size) }
    }

    private fun buffer(at: Long, length: Long): ByteBuffer = ByteBuffer.wrap(bytes(at, length)).order(order)

    private fun word(at: Long): Long = buffer(at, 4).getInt().toLong() and 0xffffffffL

    /** Reads the directory at `at` into `into`, and its children into `all`; returns the offset of the next one. */
    private fun directory(at: Long, depth: Int, into: MutableList<Directory>): Long {
        if (at in places || places.size == MAX_DIRECTORIES || depth > MAX_DEPTH) {
            throw damaged("its directories run in a circle or are too many")
        }
        places.add(at)
        val count = buffer(at, 2).getShort().toInt() and 0xffff
        val entries = buffer(at + 2, 12L * count)
        val fields = HashMap<Int, Field>()
        for (number in 0 until count) {
            val tag = entries.getShort(12 * number).toInt() and 0xffff
            val kind = entries.getShort(12 * number + 2).toInt() and 0xffff
            // TIFF 6.0, page 16: skip fields of an unknown type
            if (tag !in Tag.KNOWN || kind !in 1 until WIDTHS.size || tag in fields) continue
            val length = entries.getInt(12 * number + 4).toLong() and 0xffffffffL
            val value = entries.getInt(12 * number + 8).toLong() and 0xffffffffL
            fields[tag] = Field(kind, length, if (length * WIDTHS[kind] <= 4) at + 10 + 12 * number else value)
        }
        val directory = Directory(fields)
        into.add(directory)
        all.add(directory)
        val children = directory[Tag.SUB_IFDS]
        if (children != null) {
            if (children.count > MAX_DIRECTORIES) throw damaged("its directories are too many")
            for (child in whole(directory, Tag.SUB_IFDS)) directory(child, depth + 1, ArrayList(1))
        }
        return word(at + 2 + 12L * count)
    }

    /** The Exif directory; empty if there is none. */
    fun exif(): Directory {
        if (Tag.EXIF !in main[0]) return Directory(emptyMap())
        val found = ArrayList<Directory>(1)
        directory(whole(main[0], Tag.EXIF, 1)[0], 1, found)
        return found[0]
    }

    /** Number of values of the tag; 0 if it is missing. */
    fun count(directory: Directory, tag: Int): Long = directory[tag]?.count ?: 0

    /** The first bytes of the value as stored, at most `limit`; the whole value must be inside the file. */
    fun raw(directory: Directory, tag: Int, limit: Int): ByteArray {
        val field = directory[tag] ?: return ByteArray(0)
        val length = field.count * WIDTHS[field.kind]
        inside(field.at, length)
        return bytes(field.at, minOf(length, limit.toLong()))
    }

    /**
     * The value as numbers; null if the tag is missing.
     *
     * @param count required number of values; any if null.
     * @param limit largest number of values to read; the whole value must be inside the file.
     */
    fun numbers(directory: Directory, tag: Int, count: Long? = null, limit: Int = MAX_VALUES): DoubleArray? {
        val field = directory[tag] ?: return null
        if (field.count == 0L || (count != null && count != field.count)) {
            throw damaged("tag $tag has ${field.count} values")
        }
        inside(field.at, field.count * WIDTHS[field.kind])
        val some = if (count != null) field.count.toInt() else minOf(field.count, limit.toLong()).toInt()
        val buffer = buffer(field.at, some.toLong() * WIDTHS[field.kind])
        return DoubleArray(some) { number(buffer, field.kind) }
    }

    private fun number(from: ByteBuffer, kind: Int): Double = when (kind) {
        1, 2, 7 -> (from.get().toInt() and 0xff).toDouble()
        3 -> (from.getShort().toInt() and 0xffff).toDouble()
        4, 13 -> (from.getInt().toLong() and 0xffffffffL).toDouble()
        5 -> number(from, 4) / number(from, 4)
        6 -> from.get().toDouble()
        8 -> from.getShort().toDouble()
        9 -> from.getInt().toDouble()
        10 -> number(from, 9) / number(from, 9)
        11 -> from.getFloat().toDouble()
        else -> from.getDouble()
    }

    /** The value as whole numbers; empty if the tag is missing. */
    fun whole(directory: Directory, tag: Int, count: Long? = null): LongArray {
        val values = numbers(directory, tag, count) ?: return LongArray(0)
        return LongArray(values.size) {
            val value = values[it]
            if (!(abs(value) < 4294967296.0) ||
                value != floor(value)
            ) {
                throw damaged("tag $tag holds no whole numbers")
            }
            value.toLong()
        }
    }

    /** A single whole number; `default` if the tag is missing. */
    fun one(directory: Directory, tag: Int, default: Long): Long =
        if (tag in directory) whole(directory, tag, 1)[0] else default

    /** A string without its terminating zero and surrounding blanks. */
    fun text(directory: Directory, tag: Int): String {
        val stored = raw(directory, tag, MAX_TEXT)
        val end = stored.indexOf(0)
        return String(stored, 0, if (end < 0) stored.size else end, Charsets.UTF_8).trim()
    }

    private companion object {
        const val MAX_DIRECTORIES = 64
        const val MAX_DEPTH = 4
        const val MAX_VALUES = 65536
        const val MAX_TEXT = 4096

        /** Bytes of one value of TIFF's types 1 to 13. */
        val WIDTHS = intArrayOf(0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8, 4)

        /** Offset and signature of raw files that are not TIFF, or that have a TIFF header but are no DNG. */
        val OTHER_RAWS = listOf(
            8 to "CR\u0002",
            4 to "ftypcrx ",
            0 to "FUJIFILMCCD-RAW",
            0 to "IIU\u0000",
            0 to "IIRO",
            0 to "IIRS",
            0 to "MMOR",
            0 to "FOVb",
            0 to "\u0000MRM",
        )

        fun ByteArray.holds(at: Int, word: String): Boolean =
            size >= at + word.length && word.indices.all { this[at + it].toInt() == word[it].code }
    }
}
