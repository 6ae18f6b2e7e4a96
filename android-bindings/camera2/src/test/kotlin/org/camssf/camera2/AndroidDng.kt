package org.camssf.camera2

import java.nio.ByteBuffer
import java.nio.ByteOrder

/**
 * A DNG laid out as the platform's own writer does it (android_hardware_camera2_DngCreator.cpp), of the frame in
 * [RawFramesTest]: uncompressed, active area, black level in 1/100, noise a colour, four GainMaps in OpcodeList2.
 */
internal fun androidDng(width: Int, height: Int, sample: (Int, Int) -> Int): ByteArray {
    val strip = buffer(2 * width * height)
    for (y in 0 until height) for (x in 0 until width) strip.putShort(sample(x, y).toShort())
    val noise = buffer(48)
    for (i in listOf(2, 4, 3)) noise.putDouble(1e-4 * i).putDouble(1e-6 * i)
    val own = buffer(72)
    for (i in 0..8) own.putInt(if (i % 4 == 0) 10 + i else 0).putInt(10)
    val fields = listOf(
        longs(254, 0), longs(256, width), longs(257, height), shorts(258, 16), shorts(259, 1), shorts(262, 32803),
        longs(273, 0), shorts(274, 6), shorts(277, 1), longs(278, height), longs(279, 2 * width * height),
        shorts(284, 1), rationals(33434, 10_000_000 to 1_000_000_000), shorts(33421, 2, 2), bytes(33422, 1, 0, 2, 1),
        shorts(34855, 200), bytes(50706, 1, 4, 0, 0), shorts(50713, 2, 2),
        rationals(50714, 6425 to 100, 6350 to 100, 6475 to 100, 6500 to 100), longs(50717, 1023),
        Field(50721, 10, 9, buffer(72).apply { for (value in MATRIX) putInt(value).putInt(10_000) }.array()),
        Field(50723, 10, 9, own.array()), shorts(50778, 21), shorts(50779, 17),
        rationals(50728, 433 to 1000, 1 to 1, 1105 to 1000), longs(50829, 2, 2, 6, 8),
        bytes(51009, *gainMaps()),
        Field(51041, 12, 6, noise.array()),
    ).sortedBy { it.tag }
    val start = 8 + 2 + 12 * fields.size + 4
    val behind = fields.map { it.bytes.size }.filter { it > 4 }.sumOf { it + it % 2 }
    val total = start + behind + strip.capacity()
    val file = buffer(total)
    file.put(byteArrayOf(0x49, 0x49, 42, 0)).putInt(8).putShort(fields.size.toShort())
    var at = start
    for (field in fields) {
        val value = if (field.tag == 273) buffer(4).putInt(total - strip.capacity()).array() else field.bytes
        file.putShort(field.tag.toShort()).putShort(field.type.toShort()).putInt(field.count)
        if (value.size <= 4) {
            file.put(value.copyOf(4))
        } else {
            file.putInt(at)
            value.forEachIndexed { i, byte -> file.put(at + i, byte) }
            at += value.size + value.size % 2
        }
    }
    strip.array().forEachIndexed { i, byte -> file.put(total - strip.capacity() + i, byte) }
    return file.array()
}

/** A phone's colour matrix, in 1/10,000. */
internal val MATRIX = intArrayOf(9599, -1936, -1469, -6018, 14024, 1557, -3651, 5602, 6610)

private class Field(val tag: Int, val type: Int, val count: Int, val bytes: ByteArray)

private fun buffer(size: Int) = ByteBuffer.allocate(size).order(ByteOrder.LITTLE_ENDIAN)

private fun bytes(tag: Int, vararg values: Byte) = Field(tag, 1, values.size, values)

private fun shorts(tag: Int, vararg values: Int) =
    Field(tag, 3, values.size, buffer(2 * values.size).apply { for (v in values) putShort(v.toShort()) }.array())

private fun longs(tag: Int, vararg values: Int) =
    Field(tag, 4, values.size, buffer(4 * values.size).apply { for (v in values) putInt(v) }.array())

private fun rationals(tag: Int, vararg values: Pair<Int, Int>) =
    Field(tag, 5, values.size, buffer(8 * values.size).apply { for ((n, d) in values) putInt(n).putInt(d) }.array())

/** Big-endian, for GRBG: R at row 0, column 1; green at 0, 0; green at 1, 1; B at 1, 0. */
private fun gainMaps(): ByteArray {
    val list = ByteBuffer.allocate(4 + 4 * (16 + 76 + 24))
    list.putInt(4)
    listOf(0 to 1, 0 to 0, 1 to 1, 1 to 0).forEachIndexed { channel, (top, left) ->
        list.putInt(9).put(byteArrayOf(1, 3, 0, 0)).putInt(1).putInt(76 + 24)
        for (value in intArrayOf(top, left, 4, 6, 0, 1, 2, 2, 2, 3)) list.putInt(value)
        for (value in doubleArrayOf(1.0, 0.5, 0.0, 0.0)) list.putDouble(value)
        list.putInt(1)
        for (point in 0 until 6) list.putFloat(1f + point + channel / 10f)
    }
    return list.array()
}
