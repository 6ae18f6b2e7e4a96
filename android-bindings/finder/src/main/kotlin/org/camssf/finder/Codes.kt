package org.camssf.finder

import org.camssf.photo.Mosaic
import kotlin.math.floor
import kotlin.math.max
import kotlin.math.sqrt

/**
 * A picture to be searched: codes from 0 to 4095 on a square-root scale, plane by plane.
 *
 * Codes are whole numbers, so that Python gives the same result to the last bit. The arrays are reused from picture
 * to picture.
 */
internal class Codes {
    var width = 0
        private set
    var height = 0
        private set
    var channels = 0
        private set

    /** One pixel covers step × step px of the source; the first of them is at (left, top). */
    var step = 1
        private set
    private var left = 0
    private var top = 0
    var values = IntArray(0)
        private set
    private var light = DoubleArray(0)
    private var rows = Array(3) { ByteArray(0) }

    /** Coordinate x or y (axis 0 or 1) in px of the source. */
    fun toSource(place: Double, axis: Int): Double =
        place * step + (step - 1) / 2.0 + (if (axis == 0) left else top)

    private fun shape(width: Int, height: Int, channels: Int, step: Int) {
        this.width = width
        this.height = height
        this.channels = channels
        this.step = step
        val size = width * height * channels
        if (values.size < size) values = IntArray(size)
        values.fill(0, 0, size)
    }

    fun read(picture: Picture) {
        left = 0
        top = 0
        when (val source = picture.source) {
            is Source.Bytes -> read(source, picture.width, picture.height)
            is Source.Light -> read(source, picture.width, picture.height)
            is Source.Raw -> read(source.mosaic)
        }
    }

    /** Sets this to the means of 2 × 2 pixels of `other`. */
    fun halve(other: Codes) {
        shape(other.width / 2, other.height / 2, other.channels, 2 * other.step)
        left = other.left
        top = other.top
        for (c in 0 until channels) {
            for (y in 0 until height) {
                var from = c * other.width * other.height + 2 * y * other.width
                var at = (c * height + y) * width
                repeat(width) {
                    val total = other.values[from] + other.values[from + 1] + other.values[from + other.width] +
                        other.values[from + other.width + 1]
                    values[at++] = (total + 2) / 4
                    from += 2
                }
            }
        }
    }

    private fun read(source: Source.Bytes, width: Int, height: Int) {
        val factor = factor(height, width)
        val colours = if (source.planes.size == 1) 1 else 3
        shape(width / factor, height / factor, colours, factor)
        val readers = source.planes.map { it.bytes.duplicate() }
        val size = this.width * this.height
        for (y in 0 until this.height * factor) {
            for (i in readers.indices) {
                val chroma = source.yuv && i > 0
                val count = if (chroma) (width + 1) / 2 else width
                if (rows[i].size < width) rows[i] = ByteArray(width)
                source.planes[i].row(readers[i], if (chroma) y / 2 else y, count, rows[i])
            }
            val start = y / factor * this.width
            if (source.yuv) {
                addColours(start, size, factor)
            } else {
                for (c in 0 until colours) add(rows[c], start + c * size, factor)
            }
        }
        val parts = factor * factor
        val all = values
        if (parts == 1) {
            for (i in 0 until size * colours) all[i] = 16 * all[i]
        } else {
            for (i in 0 until size * colours) all[i] = (16 * all[i] + parts / 2) / parts
        }
    }

    /** Adds a line of one colour to the codes from index `start` on. */
    private fun add(line: ByteArray, start: Int, factor: Int) {
        val all = values
        if (factor == 1) {
            for (x in 0 until width) all[start + x] += line[x].toInt() and 0xff
            return
        }
        var at = 0
        for (x in 0 until width) repeat(factor) { all[start + x] += line[at++].toInt() and 0xff }
    }

    /**
     * Adds a line of luma, cb and cr (BT.601, full range) as red, green and blue, whose planes are `size` codes
     * apart.
     */
    private fun addColours(start: Int, size: Int, factor: Int) {
        val all = values
        val (lumas, blues, reds) = rows
        var at = 0
        for (x in start until start + width) {
            repeat(factor) {
                val luma = (lumas[at].toInt() and 0xff) shl 16
                val cb = (blues[at shr 1].toInt() and 0xff) - 128
                val cr = (reds[at shr 1].toInt() and 0xff) - 128
                all[x] += byte(luma + 91881 * cr)
                all[x + size] += byte(luma - 22554 * cb - 46802 * cr)
                all[x + 2 * size] += byte(luma + 116130 * cb)
                at++
            }
        }
    }

    private fun read(source: Source.Light, width: Int, height: Int) {
        val factor = factor(height, width)
        shape(width / factor, height / factor, source.planes.size, factor)
        clear()
        val size = this.width * this.height
        for ((c, plane) in source.planes.withIndex()) {
            for (v in 0 until factor) {
                for (u in 0 until factor) {
                    for (y in 0 until this.height) {
                        for (x in 0 until this.width) {
                            light[c * size + y * this.width + x] +=
                                plane[(y * factor + v) * source.rowStride + x * factor + u].toDouble()
                        }
                    }
                }
            }
        }
        roots()
    }

    private fun read(mosaic: Mosaic) {
        // Begin at the first complete colour filter cell of the region.
        left = (mosaic.region.left + 1) / 2 * 2
        top = (mosaic.region.top + 1) / 2 * 2
        val cells = (mosaic.region.right - left) / 2
        val lines = (mosaic.region.bottom - top) / 2
        val factor = factor(lines, cells)
        shape(cells / factor, lines / factor, 3, 2 * factor)
        clear()
        val size = width * height
        val black = mosaic.sensor.sharedBlack
        val samples = mosaic.samples
        val stride = mosaic.region.width
        for (place in 0..3) {
            val c = "RGB".indexOf(mosaic.sensor.cfa[place])
            val dark = factor * factor * black[place]
            for (y in 0 until height) {
                for (x in 0 until width) {
                    var total = 0L
                    for (v in 0 until factor) {
                        val row = top + 2 * (y * factor + v) + place / 2 - mosaic.region.top
                        var at = row * stride + left + 2 * x * factor + place % 2 - mosaic.region.left
                        repeat(factor) {
                            total += samples[at].toInt() and 0xffff
                            at += 2
                        }
                    }
                    light[c * size + y * width + x] += total - dark
                }
            }
        }
        roots()
    }

    private fun clear() {
        val size = width * height * channels
        if (light.size < size) light = DoubleArray(size)
        light.fill(0.0, 0, size)
    }

    /** Converts light to codes: each colour relative to its largest value. */
    private fun roots() {
        val size = width * height
        val largest = FinderFile.limits.largestCode
        for (c in 0 until channels) {
            var most = 0.0
            for (i in c * size until (c + 1) * size) if (light[i].isFinite()) most = max(most, light[i])
            if (most <= 0.0) continue
            for (i in c * size until (c + 1) * size) {
                val share = (if (light[i].isFinite()) light[i] else 0.0) / most
                values[i] = floor(largest * sqrt(max(share, 0.0))).toInt()
            }
        }
    }

    companion object {
        /** Side of the blocks of pixels that are combined, px. */
        private fun factor(height: Int, width: Int): Int {
            val longest = FinderFile.limits.longest
            return max(1, (max(height, width) + longest - 1) / longest)
        }

        private fun byte(shifted: Int): Int = ((shifted + 32768) shr 16).coerceIn(0, 255)
    }
}
