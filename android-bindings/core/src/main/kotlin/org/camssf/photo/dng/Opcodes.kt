package org.camssf.photo.dng

import org.camssf.Refusal
import org.camssf.UnsupportedRaw
import org.camssf.photo.BadPixels
import org.camssf.photo.GainMap
import org.camssf.photo.Region
import java.nio.ByteBuffer

private const val FIX_BAD_CONSTANT = 4
private const val FIX_BAD_LIST = 5
private const val GAIN_MAP = 9
private const val GAIN_MAP_HEAD = 76
private const val OPTIONAL = 1
private const val MAX_LIST = 16 shl 20
private const val MAX_OPCODES = 1024L

/** Opcodes that may be left out even if the file requires them: docs/raw.md says why. */
private val HARMLESS = setOf(1, 2, 3, FIX_BAD_CONSTANT, FIX_BAD_LIST, 6, GAIN_MAP, 14)

/** Names of the opcodes that change the samples' values. */
private val NAMES = mapOf(
    7 to "MapTable", 8 to "MapPolynomial",
    10 to "DeltaPerRow", 11 to "DeltaPerColumn", 12 to "ScalePerRow", 13 to "ScalePerColumn",
)

/**
 * The contents of the three opcode lists. DNG 1.7, chapter "Opcode List Processing"; big-endian in every file.
 *
 * @throws UnsupportedRaw an opcode that may not be skipped and is not applied.
 */
internal class Opcodes(private val tiff: Tiff, raw: Directory) {
    val gainMaps = ArrayList<GainMap>()
    val badPixels = ArrayList<BadPixels>()

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
        if (left > MAX_OPCODES) throw tiff.damaged("opcode list $tag of $left operations")
        while (left-- > 0) {
            wanted(buffer, 16, tag)
            val number = buffer.getInt()
            buffer.getInt() // the required DNG version
            val flags = buffer.getInt()
            val length = buffer.getInt().toLong() and 0xffffffffL
            wanted(buffer, length, tag)
            val content = buffer.slice()
            content.limit(length.toInt())
            when (number) {
                GAIN_MAP -> gainMaps.add(gainMap(content, list, tag))
                FIX_BAD_CONSTANT, FIX_BAD_LIST -> badPixels.add(badPixels(content, number, list, tag))
                else -> if (number !in HARMLESS && flags and OPTIONAL == 0) throw required(number, list)
            }
            buffer.position(buffer.position() + length.toInt())
        }
    }

    private fun required(number: Int, list: Int) = Refusal.of(
        "unsupported_raw.opcode", "file" to tiff.name, "opcode" to (number.toLong() and 0xffffffffL),
        "name" to (NAMES[number] ?: "unknown"), "list" to list,
    )

    private fun wanted(buffer: ByteBuffer, bytes: Long, tag: Int) {
        if (buffer.remaining() < bytes) throw tiff.damaged("opcode list $tag ends early")
    }

    /** Reads a gain map, with the same checks as in Python. */
    private fun gainMap(content: ByteBuffer, list: Int, tag: Int): GainMap {
        fun damaged() = tiff.damaged("opcode list $tag holds a lens-shading map that breaks its format")
        if (content.remaining() < GAIN_MAP_HEAD) throw damaged()
        val area = region(content)
        val (plane, planes, rowPitch, columnPitch) = IntArray(4) { unsigned(content) }
        val (pointsV, pointsH) = IntArray(2) { unsigned(content) }
        val (spacingV, spacingH, originV, originH) = DoubleArray(4) { content.getDouble() }
        val mapPlanes = unsigned(content)
        val most = content.remaining() / 4
        val few = pointsV in 1..most && pointsH in 1..most && mapPlanes in 1..most
        if (!few || pointsV.toLong() * pointsH * mapPlanes * 4 != content.remaining().toLong()) throw damaged()
        val gains = FloatArray(pointsV * pointsH * mapPlanes) { content.getFloat() }
        val net = GainMap.Net(
            pointsV,
            pointsH,
            // as in Adobe's reader: a single point has no spacing
            if (pointsV == 1) 1.0 else spacingV,
            if (pointsH == 1) 1.0 else spacingH,
            if (pointsV == 1) 0.0 else originV,
            if (pointsH == 1) 0.0 else originH,
            mapPlanes,
            gains,
        )
        val places = doubleArrayOf(net.spacingV, net.spacingH, net.originV, net.originH)
        val sound = rowPitch > 0 && columnPitch > 0 && net.spacingV > 0 && net.spacingH > 0
        if (!sound || !places.all { it.isFinite() } || !gains.all { it.isFinite() && it > 0 }) throw damaged()
        return GainMap(list, area, plane, planes, rowPitch, columnPitch, net)
    }

    private fun badPixels(content: ByteBuffer, number: Int, list: Int, tag: Int): BadPixels {
        wanted(content, 8, tag)
        if (number == FIX_BAD_CONSTANT) return BadPixels(list, content.getInt(), IntArray(0), emptyList())
        content.getInt() // the Bayer phase, which is not used
        wanted(content, 8, tag)
        val points = content.getInt().toLong() and 0xffffffffL
        val areas = content.getInt().toLong() and 0xffffffffL
        wanted(content, 8 * points + 16 * areas, tag)
        val places = IntArray(2 * points.toInt()) { unsigned(content) }
        return BadPixels(list, null, places, List(areas.toInt()) { region(content) })
    }

    /** Top, left, bottom, right as stored. */
    private fun region(content: ByteBuffer): Region {
        val (top, left, bottom, right) = IntArray(4) { unsigned(content) }
        return Region(left, top, right, bottom)
    }

    /** An unsigned number; larger values become the largest Int. */
    private fun unsigned(content: ByteBuffer): Int = content.getInt().let { if (it < 0) Int.MAX_VALUE else it }
}
