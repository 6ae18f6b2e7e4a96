package org.camssf.photo.dng

import org.camssf.photo.Region
import java.nio.ByteOrder

/**
 * One form of DNG that a phone or converter may write, and what must come out of it.
 *
 * @property area the active area.
 * @property table the LinearizationTable, or null.
 */
internal class Variant(
    val name: String,
    val writer: DngWriter,
    val area: Region = Region(0, 0, writer.width, writer.height),
    val table: IntArray? = null,
) {
    val bytes: ByteArray by lazy { writer.encode() }

    /** The sample that was written at column x, row y of the active area, linearised. */
    fun expected(x: Int, y: Int): Int {
        val stored = writer.samples[(area.top + y) * writer.width + area.left + x]
        return if (table == null) stored else table[minOf(stored, table.size - 1)]
    }
}

/** Every line of what the reader must read; small pictures, deterministic. */
internal object Variants {
    private const val WIDTH = 52
    private const val HEIGHT = 38
    private val BIG = ByteOrder.BIG_ENDIAN
    private val LITTLE = ByteOrder.LITTLE_ENDIAN

    /** Every value of `bits`, without order. */
    fun noise(bits: Int, width: Int = WIDTH, height: Int = HEIGHT): IntArray = IntArray(width * height) {
        var hash = it * -0x61c88647 + 0x3c6ef372
        hash = (hash xor (hash ushr 15)) * 0x2c1b3c6d
        hash = (hash xor (hash ushr 12)) * 0x297a2d39
        (hash xor (hash ushr 15)) ushr (32 - bits)
    }

    /** A slope with a little noise, as photos have. */
    fun smooth(bits: Int, width: Int = WIDTH, height: Int = HEIGHT): IntArray {
        val most = (1 shl bits) - 1
        val noise = noise(4, width, height)
        return IntArray(width * height) {
            val slope = most / 4 + it % width * most / (4 * width) + it / width * most / (5 * height)
            (slope + noise[it]).coerceAtMost(most)
        }
    }

    private fun writer(
        samples: IntArray,
        bits: Int,
        order: ByteOrder = LITTLE,
        compression: Int = 1,
        tile: Pair<Int, Int>? = null,
        rowsPerStrip: Int? = null,
        reversePieces: Boolean = false,
        place: Place = Place.FIRST,
        cfa: String = "RGGB",
        predictor: Int = 1,
        raw: Tags = emptyMap(),
        first: Tags = emptyMap(),
        jpeg: (Int) -> JpegWriter = { JpegWriter(bits, it) },
    ) = DngWriter(
        WIDTH, HEIGHT, samples, bits, order, compression, tile, rowsPerStrip, reversePieces, place, cfa, predictor,
        jpeg, raw, first,
    )

    val all: List<Variant> by lazy { plain() + layouts() + areas() + talkative() + tables() + jpegs() + deflated() }

    private fun plain(): List<Variant> = (8..16).flatMap { bits ->
        listOf(LITTLE, BIG).map { order ->
            val letters = if (order == BIG) "MM" else "II"
            Variant("plain-$bits-$letters", writer(noise(bits), bits, order))
        }
    }

    private fun layouts(): List<Variant> = listOf(
        Variant("strips", writer(noise(16), 16, rowsPerStrip = 7)),
        Variant("strips-10-bit", writer(noise(10), 10, BIG, rowsPerStrip = 5)),
        Variant("strips-backwards", writer(noise(12), 12, rowsPerStrip = 9, reversePieces = true)),
        Variant("tiles", writer(noise(16), 16, tile = 16 to 16)),
        Variant("tiles-12-bit-backwards", writer(noise(12), 12, BIG, tile = 20 to 16, reversePieces = true)),
        Variant("tiles-11-bit-odd", writer(noise(11), 11, tile = 13 to 7)),
        Variant("tile-larger-than-picture", writer(noise(16), 16, tile = 64 to 48)),
        Variant("chain", writer(noise(14), 14, place = Place.CHAIN)),
        Variant("child", writer(noise(14), 14, BIG, place = Place.CHILD)),
        Variant("grandchild", writer(noise(14), 14, place = Place.GRANDCHILD)),
    )

    private fun areas(): List<Variant> = listOf("RGGB", "GRBG", "GBRG", "BGGR").flatMap { cfa ->
        listOf(Region(4, 2, 50, 36), Region(3, 2, 50, 36), Region(4, 1, 51, 38), Region(5, 3, 52, 37)).map {
            val tags: Tags = mapOf(50829 to Value.long(it.top, it.left, it.bottom, it.right))
            val name = "area-$cfa-${it.left}-${it.top}"
            Variant(name, writer(noise(12), 12, cfa = cfa, raw = tags), it)
        }
    }

    /** All that a phone says beside the samples. */
    private fun talkative(): List<Variant> = listOf(LITTLE, BIG).map { order ->
        val area = Region(4, 2, 52, 38)
        val map = OpcodeWriter.content(0, 1, 35, 47, 0, 1, 2, 2, 2, 2, 1.0, 1.0, 0.0, 0.0, 1, 1f, 1.5f, 2f, 1.25f)
        val places = OpcodeWriter.content(0, 2, 1, 3, 4, 5, 6, 7, 8, 9, 10)
        val raw: Tags = mapOf(
            50829 to Value.long(area.top, area.left, area.bottom, area.right),
            50830 to Value.long(0, 0, 2, 52, 2, 0, 38, 4),
            50713 to Value.short(2, 2),
            50714 to Value.rational(256, 1, 1025, 4, 2060, 8, 259, 1),
            50715 to Value.srational(*IntArray(2 * area.width) { if (it % 2 == 0) it % 7 - 3 else 4 }),
            50716 to Value.srational(*IntArray(2 * area.height) { if (it % 2 == 0) it % 5 - 2 else 8 }),
            50717 to Value.long(4000),
            51008 to OpcodeWriter.list(OpcodeWriter.opcode(5, places)),
            51009 to
                OpcodeWriter.list(OpcodeWriter.opcode(9, map), OpcodeWriter.opcode(4, ByteArray(8))),
            51022 to OpcodeWriter.list(OpcodeWriter.opcode(1, ByteArray(60), optional = true)),
        )
        val first: Tags = mapOf(
            274 to Value.short(6),
            50721 to Value.srational(*IntArray(18) { if (it % 2 == 0) it - 8 else 10 }),
            50722 to Value.srational(*IntArray(18) { if (it % 2 == 0) it + 3 else 10 }),
            50728 to Value.rational(1, 2, 1, 1, 5, 8),
            50729 to Value.rational(3127, 10000, 3290, 10000),
            51041 to Value.double(2e-4, 1e-6),
        )
        val exif: Tags = mapOf(33434 to Value.rational(1, 125), 34855 to Value.short(400))
        val letters = if (order == BIG) "MM" else "II"
        val dng = DngWriter(
            WIDTH, HEIGHT, smooth(12), 12, order, place = Place.CHILD, raw = raw, first = first, exif = exif,
        )
        Variant("talkative-$letters", dng, area)
    }

    private fun tables(): List<Variant> {
        val curve = IntArray(1024) { it * it / 16 }
        val short = IntArray(200) { 65535 - 300 * it }
        fun tags(table: IntArray): Tags = mapOf(50712 to Value.short(*table))
        return listOf(
            Variant("table-10-bit", writer(noise(10), 10, raw = tags(curve)), table = curve),
            Variant("table-too-short", writer(noise(8), 8, raw = tags(short)), table = short),
            Variant("table-jpeg", writer(noise(10), 10, compression = 7, raw = tags(curve)), table = curve),
            Variant("table-deflate", writer(noise(16), 16, compression = 8, raw = tags(short)), table = short),
        )
    }

    private fun jpeg(
        name: String, bits: Int, samples: IntArray = smooth(bits), tile: Pair<Int, Int>? = null,
        rowsPerStrip: Int? = null, order: ByteOrder = LITTLE, first: Tags = emptyMap(), jpeg: (Int) -> JpegWriter,
    ) = Variant(
        "jpeg-$name",
        writer(samples, bits, order, 7, tile, rowsPerStrip, first = first, place = Place.CHILD, jpeg = jpeg),
    )

    private fun jpegs(): List<Variant> {
        val made = ArrayList<Variant>()
        for (selector in 1..7) {
            made += jpeg("predictor-$selector", 14) { JpegWriter(14, it, selector) }
            made += jpeg("predictor-$selector-noise", 16, noise(16)) { JpegWriter(16, it / 2, selector, 2) }
            made +=
                jpeg("predictor-$selector-restart", 12, tile = 16 to 16) { JpegWriter(12, it / 2, selector, 2, 3) }
        }
        for (components in listOf(1, 2, 4)) {
            made += jpeg("components-$components", 12) { JpegWriter(12, it / components, 6, components) }
        }
        made += jpeg("components-3", 12, tile = 24 to 16) { JpegWriter(12, it / 3, 4, 3) }
        for (bits in listOf(8, 9, 10, 11, 13, 15)) {
            made += jpeg("$bits-bit", bits, noise(bits), order = BIG) { JpegWriter(bits, it / 2, 1, 2) }
        }
        val extremes = IntArray(WIDTH * HEIGHT) { if (it / 3 % 2 == 0) 0 else 32768 }
        made += jpeg("category-16", 16, extremes) { JpegWriter(16, it, 1) }
        made +=
            jpeg("category-16-long-codes", 16, extremes) { JpegWriter(16, it, 2, lengths = listOf(JpegWriter.STEEP)) }
        made += jpeg("category-16-dng-1.0", 16, extremes, first = mapOf(50706 to Value.bytes(1, 0, 0, 0))) {
            JpegWriter(16, it, 1, extraBits = true)
        }
        made += jpeg("codes-steep", 14) { JpegWriter(14, it, 1, lengths = listOf(JpegWriter.STEEP)) }
        made += jpeg("codes-reversed", 14) { JpegWriter(14, it, 1, lengths = listOf(JpegWriter.REVERSED)) }
        made += jpeg("codes-of-each-component", 14) {
            JpegWriter(14, it / 2, 1, 2, lengths = listOf(JpegWriter.STEEP, JpegWriter.EVEN))
        }
        made += jpeg("restart-each-line", 14) { JpegWriter(14, it / 2, 1, 2, 1) }
        val even = smooth(14).map { it and 3.inv() }.toIntArray()
        made += jpeg("point-transform", 14, even) { JpegWriter(14, it / 2, 1, 2, shift = 2) }
        made += jpeg("point-transform-predictor-7", 14, even) { JpegWriter(14, it, 7, shift = 2) }
        made += jpeg("tiles", 10, tile = 24 to 16) { JpegWriter(10, it / 2, 1, 2) }
        made += jpeg("tiles-of-long-lines", 12, tile = 16 to 16) { JpegWriter(12, it * 2, 1, 2) }
        made += jpeg("lines-of-half-a-row", 12) { JpegWriter(12, it / 2, 1) }
        made += jpeg("strips", 12, rowsPerStrip = 10) { JpegWriter(12, it / 2, 1, 2) }
        made += jpeg("markers", 12) { JpegWriter(12, it / 2, 1, 2, extraMarkers = true) }
        made += jpeg("filled-up", 12, tile = 32 to 32) { JpegWriter(12, it / 2, 1, 2, filling = 3) }
        return made
    }

    private fun deflated(): List<Variant> {
        val made = ArrayList<Variant>()
        for (order in listOf(LITTLE, BIG)) {
            val letters = if (order == BIG) "MM" else "II"
            for (bits in listOf(8, 16)) {
                for (predictor in listOf(1, 2)) {
                    val dng = writer(smooth(bits), bits, order, 8, predictor = predictor, rowsPerStrip = 11)
                    made += Variant("deflate-$bits-$letters-predictor-$predictor", dng)
                }
            }
        }
        made += Variant("deflate-tiles", writer(noise(16), 16, compression = 8, tile = 16 to 16, predictor = 2))
        made += Variant("deflate-12-bit-packed", writer(noise(12), 12, compression = 8, tile = 20 to 16))
        return made
    }
}
