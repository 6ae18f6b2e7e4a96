package org.camssf.colour

import org.camssf.Camssf
import java.io.ByteArrayOutputStream
import java.io.Closeable
import java.io.DataOutputStream
import java.io.OutputStream
import java.util.zip.CRC32
import java.util.zip.Deflater
import kotlin.math.round

/**
 * Writes a PNG of RGB row by row (Portable Network Graphics, Third Edition, W3C 2025). Its stream stays open.
 *
 * @param bits of a sample, 8 or 16.
 */
internal class PngWriter(out: OutputStream, private val width: Int, private val height: Int, private val bits: Int) :
    Closeable {
    private val out = DataOutputStream(out)
    private val deflater = Deflater(LEVEL)
    private val packed = ByteArray(PACKED)
    private val row = ByteArray(3 * width * bits / 8)
    private val above = ByteArray(row.size)
    private val line = ByteArray(row.size + 1).also { it[0] = FILTER_UP }

    /** What stands before the pixels: sizes, an ICC profile or null, and a text or "". */
    fun head(profile: ByteArray?, description: String) {
        out.write(SIGNATURE)
        chunk("IHDR") {
            it.writeInt(width)
            it.writeInt(height)
            it.write(byteArrayOf(bits.toByte(), RGB, 0, 0, 0))
        }
        if (profile != null) {
            chunk("iCCP") {
                it.write("ICC profile\u0000\u0000".encodeToByteArray())
                it.write(compressed(profile))
            }
        }
        text("Software", "camssf ${Camssf.VERSION}")
        if (description.isNotEmpty()) text("Description", description)
    }

    /** The next rows, unsigned 16-bit numbers (any, width, 3). */
    fun rows(numbers: ShortArray) {
        for (start in numbers.indices step 3 * width) {
            for (i in 0 until 3 * width) {
                val number = numbers[start + i].toInt() and 0xffff
                if (bits == 16) {
                    row[2 * i] = (number shr 8).toByte()
                    row[2 * i + 1] = number.toByte()
                } else {
                    row[i] = round(number / STEPS).toInt().toByte()
                }
            }
            for (i in row.indices) line[i + 1] = (row[i] - above[i]).toByte()
            row.copyInto(above)
            deflater.setInput(line)
            pack { !deflater.needsInput() }
        }
    }

    /** What stands after the pixels. */
    fun end() {
        deflater.finish()
        pack { !deflater.finished() }
        chunk("IDAT") { it.write(packed, 0, filled) }
        chunk("IEND") {}
        out.flush()
    }

    private var filled = 0

    /** Compresses while there is more; a full buffer becomes a chunk. */
    private inline fun pack(more: () -> Boolean) {
        while (more()) {
            filled += deflater.deflate(packed, filled, packed.size - filled)
            if (filled == packed.size) {
                chunk("IDAT") { it.write(packed, 0, filled) }
                filled = 0
            }
        }
    }

    private fun text(key: String, value: String) = chunk("iTXt") {
        it.write("$key\u0000\u0000\u0000\u0000\u0000$value".encodeToByteArray())
    }

    private fun chunk(name: String, content: (DataOutputStream) -> Unit) {
        val bytes = ByteArrayOutputStream()
        DataOutputStream(bytes).use {
            it.write(name.encodeToByteArray())
            content(it)
        }
        val all = bytes.toByteArray()
        out.writeInt(all.size - name.length)
        out.write(all)
        out.writeInt(CRC32().apply { update(all) }.value.toInt())
    }

    private fun compressed(content: ByteArray): ByteArray {
        val once = Deflater()
        try {
            once.setInput(content)
            once.finish()
            val bytes = ByteArrayOutputStream()
            while (!once.finished()) bytes.write(packed, 0, once.deflate(packed))
            return bytes.toByteArray()
        } finally {
            once.end()
        }
    }

    override fun close() = deflater.end()

    private companion object {
        val SIGNATURE = byteArrayOf(0x89.toByte(), 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a)
        const val RGB: Byte = 2

        /** The filter of the difference from the row above. */
        const val FILTER_UP: Byte = 2

        /** Of compression, as in Python. */
        const val LEVEL = 6

        /** Bytes of a chunk of pixels. */
        const val PACKED = 1 shl 16

        /** Steps of 16 bits in one of 8. */
        const val STEPS = 257.0
    }
}
