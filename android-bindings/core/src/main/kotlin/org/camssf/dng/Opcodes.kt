package org.camssf.dng

import org.camssf.BadPixels
import org.camssf.GainMap
import org.camssf.Region
import java.nio.ByteBuffer

private const val FIX_BAD_CONSTANT = 4
private const val FIX_BAD_LIST = 5
private const val GAIN_MAP = 9
private const val OPTIONAL = 1
private const val MAX_LIST = 64 shl 20

/** What the three opcode lists hold. DNG 1.7, chapter "Opcode List Processing"; big-endian in every file. */
internal class Opcodes(private val tiff: Tiff, raw: Directory) {
    val gainMaps = ArrayList<GainMap>()
    val badPixels = ArrayList<BadPixels>()

    /** Numbers of the operations that are neither of the above nor optional. */
    val unknown = ArrayList<Int>()

    init {
        list(raw, Tag.OPCODES_1, 1)
        list(raw, Tag.OPCODES_2, 2)
        list(raw, Tag.OPCODES_3, 3)
    }

    private fun list(raw: Directory, tag: Int, list: Int) {
        val data = tiff.raw(raw, tag, MAX_LIST)
        if (data.isEmpty()) return
        val buffer = ByteBuffer.wrap(data)
        wanted(buffer, 4, tag)
        var left = buffer.getInt().toLong() and 0xffffffffL
        while (left-- > 0) {
            wanted(buffer, 16, tag)
            val number = buffer.getInt()
            buffer.getInt() // the version that it needs
            val flags = buffer.getInt()
            val length = buffer.getInt().toLong() and 0xffffffffL
            wanted(buffer, length, tag)
            val content = buffer.slice()
            content.limit(length.toInt())
            when (number) {
                GAIN_MAP -> gainMaps.add(gainMap(content, list, tag))
                FIX_BAD_CONSTANT, FIX_BAD_LIST -> badPixels.add(badPixels(content, number, list, tag))
                else -> if (flags and OPTIONAL == 0 && unknown.size < 64) unknown.add(number)
            }
            buffer.position(buffer.position() + length.toInt())
        }
    }

    private fun wanted(buffer: ByteBuffer, bytes: Long, tag: Int) {
        if (buffer.remaining() < bytes) throw tiff.damaged("opcode list $tag ends early")
    }

    private fun gainMap(content: ByteBuffer, list: Int, tag: Int): GainMap {
        wanted(content, 76, tag)
        val area = region(content)
        val numbers = IntArray(6) { content.getInt() } // plane, planes, row and column pitch, points down and across
        val places = DoubleArray(4) { content.getDouble() } // spacing down and across, origin down and across
        val planes = content.getInt()
        val (pointsV, pointsH) = numbers.copyOfRange(4, 6)
        val sound = numbers[0] >= 0 && numbers.drop(1).all { it >= 1 } && planes >= 1 && places.all { it.isFinite() }
        val most = content.remaining() / 4
        if (!sound || pointsV > most || pointsH > most || pointsV.toLong() * pointsH > most || planes > most ||
            pointsV.toLong() * pointsH * planes > most
        ) {
            throw tiff.damaged("a lens-shading map in opcode list $tag")
        }
        val gains = FloatArray(pointsV * pointsH * planes) { content.getFloat() }
        if (gains.any { !it.isFinite() }) throw tiff.damaged("a lens-shading map in opcode list $tag")
        return GainMap(
            list, area, numbers[0], numbers[1], numbers[2], numbers[3], pointsV, pointsH,
            places[0], places[1], places[2], places[3], planes, gains,
        )
    }

    private fun badPixels(content: ByteBuffer, number: Int, list: Int, tag: Int): BadPixels {
        wanted(content, 8, tag)
        if (number == FIX_BAD_CONSTANT) return BadPixels(list, content.getInt(), IntArray(0), emptyList())
        content.getInt() // the phase of the colour filters
        wanted(content, 8, tag)
        val points = content.getInt().toLong() and 0xffffffffL
        val areas = content.getInt().toLong() and 0xffffffffL
        wanted(content, 8 * points + 16 * areas, tag)
        val places = IntArray(2 * points.toInt()) { content.getInt() }
        return BadPixels(list, null, places, List(areas.toInt()) { region(content) })
    }

    /** Top, left, bottom, right as stored. */
    private fun region(content: ByteBuffer): Region {
        val (top, left, bottom, right) = IntArray(4) { content.getInt() }
        return Region(left, top, right, bottom)
    }
}
