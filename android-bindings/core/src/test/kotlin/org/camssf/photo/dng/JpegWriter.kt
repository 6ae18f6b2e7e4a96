package org.camssf.photo.dng

import java.io.ByteArrayOutputStream

/**
 * A plain encoder of lossless JPEG (ITU-T T.81, process 14), written from the standard for the tests: slow, one bit
 * at a time, and without a table that the decoder shares.
 *
 * @property selector predictor 1 to 7.
 * @property components samples a column.
 * @property columns of the image; a line has columns × components samples.
 * @property restart lines between restart markers, 0 for none.
 * @property shift the point transform.
 * @property lengths code length of each category 0 to 16, one list a component or one for all; 0: no code.
 * @property extraBits write 16 bits behind category 16, as DNG before 1.1 did.
 */
internal class JpegWriter(
    val precision: Int,
    val columns: Int,
    val selector: Int = 1,
    val components: Int = 1,
    val restart: Int = 0,
    val shift: Int = 0,
    val lengths: List<List<Int>> = listOf(EVEN),
    val extraBits: Boolean = false,
    val extraMarkers: Boolean = false,
    val filling: Int = 0,
) {
    private val out = ByteArrayOutputStream()
    private var held = ""

    /** (lines × columns × components) samples, row-major, lowest `shift` bits zero. */
    fun encode(samples: IntArray): ByteArray {
        val width = columns * components
        val lines = samples.size / width
        require(lines * width == samples.size) { "${samples.size} samples in lines of $width" }
        header(lines)
        val codes = List(components) { codes(lengths[it % lengths.size]) }
        for (line in 0 until lines) {
            val fresh = if (restart == 0) line == 0 else line % restart == 0
            if (fresh && line > 0) {
                pad()
                out.write(byteArrayOf(-1, (0xd0 + (line / restart - 1) % 8).toByte()))
            }
            for (i in 0 until width) {
                fun at(y: Int, x: Int) = samples[y * width + x] shr shift
                val left = i - components
                val guess = when {
                    fresh && left < 0 -> 1 shl (precision - shift - 1)
                    fresh -> at(line, left)
                    left < 0 -> at(line - 1, i)
                    else -> guess(at(line, left), at(line - 1, i), at(line - 1, left))
                }
                difference(at(line, i) - guess, codes[i % components])
            }
        }
        pad()
        repeat(filling) { out.write(0) }
        out.write(byteArrayOf(-1, 0xd9.toByte()))
        return out.toByteArray()
    }

    /** Table H.1. */
    private fun guess(a: Int, b: Int, c: Int): Int = when (selector) {
        1 -> a
        2 -> b
        3 -> c
        4 -> a + b - c
        5 -> a + Math.floorDiv(b - c, 2)
        6 -> b + Math.floorDiv(a - c, 2)
        else -> (a + b) / 2
    }

    private fun header(lines: Int) {
        out.write(byteArrayOf(-1, 0xd8.toByte()))
        if (extraMarkers) {
            marker(0xe0, "camssf".map { it.code })
            out.write(0xff) // a fill byte before a marker
            marker(0xfe, listOf(0xff, 0xc0, 0xff, 0xd9))
        }
        val tables = lengths.flatMapIndexed { number, list -> listOf(number) + table(list) }
        marker(0xc4, tables)
        val parts = (0 until components).flatMap { listOf(it + 1, 0x11, 0) }
        marker(0xc3, listOf(precision) + two(lines) + two(columns) + listOf(components) + parts)
        if (restart > 0) marker(0xdd, two(restart * columns))
        val scan = (0 until components).flatMap { listOf(it + 1, (it % lengths.size) shl 4) }
        marker(0xda, listOf(components) + scan + listOf(selector, 0, shift))
    }

    private fun two(value: Int) = listOf(value shr 8, value and 0xff)

    private fun marker(code: Int, content: List<Int>) {
        out.write(byteArrayOf(-1, code.toByte()))
        (two(content.size + 2) + content).forEach { out.write(it) }
    }

    /** The difference modulo 2^16 as its category's code and its own bits. Table H.2. */
    private fun difference(value: Int, codes: Map<Int, String>) {
        val short = value.toShort().toInt() // -32768 to 32767
        val size = if (short ==
            -32768
        ) {
            16
        } else {
            Integer.toBinaryString(Math.abs(short)).length.takeIf { short != 0 } ?: 0
        }
        bits(codes.getValue(size))
        when {
            size == 16 -> if (extraBits) bits("0" + "1".repeat(15))

            // -2^15 by the rule of other categories
            size > 0 -> bits((if (short > 0) short else short + (1 shl size) - 1).toString(2).padStart(size, '0'))
        }
    }

    private fun bits(more: String) {
        held += more
        while (held.length >= 8) {
            val byte = held.take(8).toInt(2)
            out.write(byte)
            if (byte == 0xff) out.write(0)
            held = held.drop(8)
        }
    }

    private fun pad() {
        if (held.isNotEmpty()) bits("1".repeat(8 - held.length))
    }

    companion object {
        /** All 17 categories with codes of 5 bits. */
        val EVEN = List(17) { 5 }

        /** 1, 2, 3, ... 16 and 16 bits: category 0 has the shortest code. */
        val STEEP = List(17) { minOf(it + 1, 16) }

        /** The same the other way round: small differences have codes beyond any lookup table. */
        val REVERSED = STEEP.reversed()

        /** BITS and HUFFVAL. */
        private fun table(lengths: List<Int>): List<Int> =
            (1..16).map { bits -> lengths.count { it == bits } } +
                (1..16).flatMap { bits -> lengths.indices.filter { lengths[it] == bits } }

        /** Codes in order of length, each the next free string of 0 and 1. Annex C. */
        private fun codes(lengths: List<Int>): Map<Int, String> {
            val found = HashMap<Int, String>()
            var next = 0L // the code as a 16-bit fraction
            for (category in lengths.indices.filter { lengths[it] > 0 }.sortedBy { lengths[it] }) {
                val bits = lengths[category]
                found[category] = (next shr (16 - bits)).toString(2).padStart(bits, '0')
                next += 1L shl (16 - bits)
            }
            require(next <= 1L shl 16) { "no prefix code has the lengths $lengths" }
            return found
        }
    }
}
