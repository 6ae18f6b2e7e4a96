package org.camssf.photo.dng

import org.camssf.Refusal
import java.nio.ByteBuffer

/**
 * Decoder of lossless JPEG (ITU-T T.81, process 14, SOF3) with 2 to 16 bits and 1 to 4 interleaved components.
 *
 * It detects damage as far as the format allows: codes that are in no table, samples beyond the precision, data that
 * end too early or too late, markers in the wrong order. One object decodes many images, one after the other.
 *
 * @param tiff the file, for error messages.
 * @param extraBits true if category 16 is followed by 16 bits, as in DNG before 1.1.
 */
internal class LosslessJpeg(private val tiff: Tiff, private val extraBits: Boolean) {
    /** A decoded line of columns × components samples; `copy` counts from sample `start`. */
    class Line(val size: Int) : Window.Row {
        var start = 0
        val values = IntArray(size)
        var shift = 0

        override fun copy(from: Int, count: Int, into: ShortArray, at: Int) {
            val first = start + from
            for (i in 0 until count) into[at + i] = (values[first + i] shl shift).toShort()
        }
    }

    private var bytes = ByteArray(0)
    private var words = ByteBuffer.wrap(bytes)
    private var length = 0

    private var precision = 0
    private var lines = 0
    private var columns = 0
    private var components = 0
    private val ids = IntArray(4)
    private var restart = 0
    private var selector = 0
    private var shift = 0
    private val defined = arrayOfNulls<ByteArray>(4)
    private val tables = arrayOfNulls<Huffman>(4) // kept, because the next image usually has the same tables
    private var used: Array<IntArray> = emptyArray()
    private var long: Array<Huffman> = emptyArray()

    // State of the current segment: its coded bytes, without stuffing, and the bits already read.
    private var end = 0
    private var marker = 0
    private var next = 0
    private var at = 0
    private var buffer = 0L
    private var count = 0

    /**
     * Decodes one image.
     *
     * @param bytes the image, followed by [SLACK] bytes; its content is changed.
     * @param length length of the image, bytes.
     * @param samples number of samples that the image must have.
     * @param sink receives each line and the number of its first sample, counted over lines and components.
     */
    fun decode(bytes: ByteArray, length: Int, samples: Long, sink: (Line, Long) -> Unit) {
        this.bytes = bytes
        this.words = ByteBuffer.wrap(bytes)
        this.length = length
        restart = 0
        precision = 0
        defined.fill(null)
        val scan = header()
        if (lines.toLong() * columns * components != samples) {
            throw tiff.damaged("a JPEG of $columns × $lines × $components in a piece of $samples samples")
        }
        var line = Line(columns * components)
        var above = Line(columns * components)
        line.shift = shift
        above.shift = shift
        segment(scan)
        for (number in 0 until lines) {
            val first = number % restart == 0
            if (first && number > 0) {
                close(0xd0 + (number / restart - 1) % 8)
                segment(next)
            }
            differences(line.values)
            if (at * 8L - count > end * 8L) throw tiff.damaged("its JPEG data end early")
            predict(line.values, above.values, first)
            sink(line, number.toLong() * line.size)
            line = above.also { above = line }
        }
        close(0xd9)
    }

    // Header ------------------------------------------------------------------------------------------------------

    private fun byte(at: Int): Int {
        if (at >= length) throw tiff.damaged("a JPEG without an end")
        return bytes[at].toInt() and 0xff
    }

    private fun short(at: Int): Int = (byte(at) shl 8) or byte(at + 1)

    /** Reads all markers up to the scan; returns the offset of its coded data. */
    private fun header(): Int {
        if (length < 2 || short(0) != 0xffd8) throw tiff.damaged("a piece of its data is no JPEG")
        var place = 2
        while (true) {
            if (byte(place) != 0xff) throw tiff.damaged("a JPEG without a header")
            while (byte(place) == 0xff) place++
            val marker = byte(place++)
            if (marker in 0xd0..0xd9 || marker < 2) throw tiff.damaged("a JPEG with marker $marker in its header")
            val size = short(place)
            if (size < 2 || place + size > length) throw tiff.damaged("a JPEG whose header ends early")
            when (marker) {
                0xc3 -> frame(place + 2, size - 2)

                0xc4 -> huffman(place + 2, place + size)

                0xdd -> if (size == 4) restart = short(place + 2) else throw tiff.damaged("a JPEG's restart interval")

                0xda -> {
                    scan(place + 2, size - 2)
                    return place + size
                }

                0xc0, 0xc1, 0xc2, 0xc5, 0xc6, 0xc7, in 0xc9..0xcb, in 0xcd..0xcf -> throw Refusal.of(
                    "unsupported_raw.lossy_jpeg", "file" to tiff.name, "process" to marker - 0xc0,
                )
            }
            place += size
        }
    }

    /** T.81 B.2.2. */
    private fun frame(at: Int, size: Int) {
        if (precision != 0 || size < 6 || size != 6 + 3 * byte(at + 5)) throw tiff.damaged("a JPEG's frame header")
        precision = byte(at)
        lines = short(at + 1)
        columns = short(at + 3)
        components = byte(at + 5)
        if (precision !in 2..16 || components !in 1..4 || lines == 0 || columns == 0) {
            throw tiff.damaged("a JPEG of $columns × $lines × $components samples of $precision bits")
        }
        for (i in 0 until components) {
            ids[i] = byte(at + 6 + 3 * i)
            if (byte(at + 7 + 3 * i) != 0x11) {
                throw Refusal.of("unsupported_raw.subsampled_jpeg", "file" to tiff.name)
            }
        }
    }

    /** T.81 B.2.4.2. */
    private fun huffman(from: Int, until: Int) {
        var place = from
        while (place < until) {
            if (until - place < 17) throw tiff.damaged("a JPEG's Huffman table")
            val which = byte(place)
            val codes = (1..16).sumOf { byte(place + it) }
            if (which > 3 || codes > 17 || until - place < 17 + codes) throw tiff.damaged("a JPEG's Huffman table")
            defined[which] = bytes.copyOfRange(place + 1, place + 17 + codes)
            place += 17 + codes
        }
    }

    /** T.81 B.2.3, table B.3. */
    private fun scan(at: Int, size: Int) {
        if (precision == 0) throw tiff.damaged("a JPEG without a frame header")
        val inScan = byte(at)
        if (size != 4 + 2 * inScan) throw tiff.damaged("a JPEG's scan header")
        if (inScan != components) {
            throw Refusal.of("unsupported_raw.separate_components", "file" to tiff.name)
        }
        val found = List(components) {
            if (byte(at + 1 + 2 * it) != ids[it]) throw tiff.damaged("a JPEG's scan header")
            table(byte(at + 2 + 2 * it) shr 4)
        }
        long = found.toTypedArray()
        used = Array(components) { found[it].entries }
        selector = byte(at + 1 + 2 * inScan)
        shift = byte(at + 3 + 2 * inScan) and 15
        if (selector !in 1..7 ||
            shift >= precision
        ) {
            throw tiff.damaged("a JPEG with predictor $selector, shift $shift")
        }
        if (restart % columns != 0) throw tiff.damaged("a JPEG that restarts within a line")
        restart = if (restart == 0) lines else restart / columns
    }

    private fun table(which: Int): Huffman {
        val stored = defined.getOrNull(which) ?: throw tiff.damaged("a JPEG without its Huffman table")
        val known = tables[which]
        if (known != null && known.stored.contentEquals(stored)) return known
        val made = Huffman.of(stored, extraBits) ?: throw tiff.damaged("a JPEG's Huffman table")
        tables[which] = made
        return made
    }

    // Coded data --------------------------------------------------------------------------------------------------

    /** Removes the stuffing from the coded bytes from `from` up to the next marker, in place. */
    private fun segment(from: Int) {
        val bytes = bytes
        var write = from
        var read = from
        marker = -1
        while (true) {
            var run = read
            while (run < length && bytes[run] != FF) run++
            if (write != read) System.arraycopy(bytes, read, bytes, write, run - read)
            write += run - read
            if (run + 1 >= length) break
            if (bytes[run + 1] == ZERO) {
                bytes[write++] = FF
                read = run + 2
                continue
            }
            while (run < length && bytes[run] == FF) run++
            if (run < length) marker = byte(run)
            next = run + 1
            break
        }
        at = from
        end = write
        buffer = 0
        count = 0
    }

    /**
     * Checks that the segment was read completely and that exactly this marker follows; trailing zero bytes are
     * allowed.
     */
    private fun close(expected: Int) {
        val used = ((at * 8L - count + 7) / 8).toInt()
        for (i in used until end) if (bytes[i] != ZERO) throw tiff.damaged("its JPEG data go on too long")
        if (marker != expected) throw tiff.damaged("its JPEG data have no proper end")
    }

    /**
     * Reads a line of differences.
     *
     * `buffer` holds the next bits, starting at the highest. `count` of them are valid; the bits after them are
     * loaded again.
     */
    private fun differences(into: IntArray) {
        val words = words
        val used = used
        val components = components
        val limit = end + 8
        var at = at
        var buffer = buffer
        var count = count
        var component = 0
        for (i in into.indices) {
            if (count < 32) { // a code and its bits are at most 32
                if (at > limit) throw tiff.damaged("its JPEG data end early")
                buffer = buffer or (words.getLong(at) ushr count)
                at += (63 - count) ushr 3
                count = count or 56
            }
            var entry = used[component][(buffer ushr (64 - Huffman.BITS)).toInt()]
            if (entry == 0) {
                entry = long[component].long((buffer ushr 48).toInt())
                if (entry == 0) {
                    if (at * 8L - count >= end * 8L) throw tiff.damaged("its JPEG data end early")
                    throw tiff.damaged("a code in its JPEG data is in no table")
                }
            }
            buffer = buffer shl (entry and 31)
            count -= entry and 31
            val category = (entry shr 5) and 31
            if (category == 0) {
                into[i] = entry shr 16
            } else {
                into[i] = Huffman.extend((buffer ushr (64 - category)).toInt(), category)
                buffer = buffer shl category
                count -= category
            }
            if (++component == components) component = 0
        }
        this.at = at
        this.buffer = buffer
        this.count = count
    }

    /** Converts the line's differences to samples, modulo 2^16. T.81 H.1.1 and table H.1. */
    private fun predict(line: IntArray, above: IntArray, first: Boolean) {
        val n = components
        val start = 1 shl (precision - shift - 1)
        for (c in 0 until n) line[c] = (line[c] + (if (first) start else above[c])) and 0xffff
        when (if (first) 1 else selector) {
            1 -> for (i in n until line.size) line[i] = (line[i] + line[i - n]) and 0xffff

            2 -> for (i in n until line.size) line[i] = (line[i] + above[i]) and 0xffff

            3 -> for (i in n until line.size) line[i] = (line[i] + above[i - n]) and 0xffff

            4 -> for (i in n until line.size) line[i] = (line[i] + line[i - n] + above[i] - above[i - n]) and 0xffff

            5 -> for (i in n until line.size) {
                line[i] = (line[i] + line[i - n] + ((above[i] - above[i - n]) shr 1)) and 0xffff
            }

            6 -> for (i in n until line.size) {
                line[i] = (line[i] + above[i] + ((line[i - n] - above[i - n]) shr 1)) and 0xffff
            }

            else -> for (i in n until line.size) line[i] = (line[i] + ((line[i - n] + above[i]) shr 1)) and 0xffff
        }
        var all = 0
        for (value in line) all = all or value
        if (all ushr (precision - shift) != 0) throw tiff.damaged("its JPEG data leave $precision bits")
    }

    companion object {
        /** Number of bytes required after an image. */
        const val SLACK = 24
        private const val FF: Byte = -1
        private const val ZERO: Byte = 0
    }
}

/**
 * A Huffman table of difference categories, arranged so that many bits are read at once.
 *
 * An entry consists of the number of bits to drop (bits 0 to 4), the number of difference bits still to read
 * (bits 5 to 9), and, if that is 0, the difference itself (bits 16 to 31). An entry of 0 means that no such code
 * exists.
 *
 * @property stored its bytes in the file: the number of codes of each length 1 to 16, then their categories.
 * @property entries indexed by the next [BITS] bits; also 0 for longer codes.
 */
internal class Huffman private constructor(
    val stored: ByteArray,
    val entries: IntArray,
    private val extraBits: Boolean,
) {
    /** The entry of a code longer than [BITS], from the next 16 bits. */
    fun long(bits: Int): Int {
        var code = 0
        var index = 16
        for (length in 1..16) {
            val codes = stored[length - 1].toInt()
            val place = (bits ushr (16 - length)) - code
            if (place < codes) return if (place < 0) 0 else entry(length, stored[index + place].toInt())
            code = (code + codes) shl 1
            index += codes
        }
        return 0
    }

    private fun entry(length: Int, category: Int): Int = when {
        category == 0 -> length
        category == 16 && !extraBits -> length or (-32768 shl 16)
        else -> length or (category shl 5)
    }

    private fun fill(): Boolean {
        var code = 0
        var index = 16
        val categories = HashSet<Int>()
        for (length in 1..16) {
            repeat(stored[length - 1].toInt()) {
                val category = stored[index++].toInt()
                if (category !in 0..16 || code >= 1 shl length || !categories.add(category)) return false
                if (length <= BITS) fill(code, length, category)
                code++
            }
            code = code shl 1
        }
        return true
    }

    private fun fill(code: Int, length: Int, category: Int) {
        val free = BITS - length
        val entry = entry(length, category)
        val bits = (entry shr 5) and 31
        for (rest in 0 until (1 shl free)) {
            entries[(code shl free) + rest] =
                if (bits == 0 || bits > free) {
                    entry
                } else {
                    (length + bits) or (extend(rest ushr (free - bits), bits) shl 16)
                }
        }
    }

    companion object {
        /** Number of bits per lookup. */
        const val BITS = 12

        /** The table; null if it is invalid. */
        fun of(stored: ByteArray, extraBits: Boolean): Huffman? =
            Huffman(stored, IntArray(1 shl BITS), extraBits).takeIf { it.fill() }

        /** The difference that the `bits` bits of `value` encode. T.81 F.2.2.1, EXTEND. */
        fun extend(value: Int, bits: Int): Int = value + (((value ushr (bits - 1)) - 1) and (1 - (1 shl bits)))
    }
}
