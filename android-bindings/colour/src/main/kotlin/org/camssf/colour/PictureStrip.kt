package org.camssf.colour

import org.camssf.photo.Shading
import org.camssf.recovery.Tensor
import kotlin.math.abs
import kotlin.math.round

/**
 * One strip of a picture, as the model of a strip takes it: whole CFA cells, red first, with a margin of one cell.
 *
 * @param parts the photo.
 * @param dark what is subtracted from it, of the same size; null for the black level.
 * @param start its first row in the order of [PictureParts]; even.
 * @param shading whether the file's gain maps are applied.
 */
internal class PictureStrip(
    private val parts: PictureParts,
    private val dark: PictureParts?,
    private val start: Int,
    private val shading: Boolean,
) {
    /** Rows of the upright picture. */
    val rows: Int = minOf(parts.step, parts.length - start)

    private val facts = parts.facts
    private val red = facts.sensor.cfa.indexOf('R')
    private val whole = 0 until parts.across
    private val own = start until start + rows
    private val high = if (parts.turned) whole else own
    private val wide = if (parts.turned) own else whole

    // Cells in which red is not first are mirrored: the filters are the same.
    private val down = withMargin(high, facts.height, red / 2 == 1)
    private val right = withMargin(wide, facts.width, red % 2 == 1)

    /** The upright pixels (rows, width, 3), and the uncertainty (rows / 2, width / 2, 3). */
    fun run(white: WhiteSignal, space: PictureSpace, table: PictureTable): Pair<ShortArray, ShortArray> {
        val numbers = SurfaceModels.picture.run(
            cells(white) + table.arrays + mapOf(
                "photon_noise" to Tensor(white.photonNoise, 3),
                "matrix" to space.matrix,
                "curved" to Tensor.scalar(if (space.curved) 1.0 else 0.0),
            ),
        )
        return upright(numbers.getValue("picture"), 1) to upright(numbers.getValue("uncertainty"), 2)
    }

    /** `mosaic`, `clipped`, `dark` and `gains`, (h, 2, w, 2) each. */
    private fun cells(white: WhiteSignal): Map<String, Tensor> {
        val sensor = facts.sensor
        val scale = DoubleArray(4) { white.raw["RGB".indexOf(sensor.cfa[it])] }
        val size = down.size * right.size
        val gains = if (shading) Shading.ofSamples(facts, down, right) else DoubleArray(size) { 1.0 }
        val clipped = DoubleArray(size)
        val mosaic = light(parts, gains, scale, clipped)
        val subtracted = dark?.let { light(it, gains, scale, clipped) } ?: DoubleArray(size)
        for (at in mosaic.indices) mosaic[at] -= subtracted[at]
        return mapOf("mosaic" to mosaic, "clipped" to clipped, "dark" to subtracted, "gains" to gains).mapValues {
            Tensor(it.value, down.size / 2, 2, right.size / 2, 2)
        }
    }

    /** The samples above black, relative to those of white; `clipped` gets 1 where one is clipped. */
    private fun light(of: PictureParts, gains: DoubleArray, white: DoubleArray, clipped: DoubleArray): DoubleArray {
        val photo = of.around(start)
        val sensor = facts.sensor
        val light = DoubleArray(gains.size)
        for (i in down.indices) {
            val row = (down[i] - photo.region.top) * photo.region.width - photo.region.left
            for (j in right.indices) {
                val at = i * right.size + j
                val place = down[i] % 2 * 2 + right[j] % 2
                val sample = photo.samples[row + right[j]].toInt() and 0xffff
                light[at] = (sample - sensor.sharedBlack[place]) * gains[at] / white[place]
                if (sample >= sensor.white) clipped[at] = 1.0
            }
        }
        return light
    }

    /**
     * Numbers of the model in whole steps, unmirrored, without what fills up odd edges, and turned upright.
     *
     * @param numbers of blocks of `side` × `side` pixels, (3, h, w) without the margin.
     */
    private fun upright(numbers: Tensor, side: Int): ShortArray {
        val height = (down.size - 4) / side
        val width = (right.size - 4) / side
        val (first, below) = if (red / 2 == 1) (height - 1) * width to -width else 0 to width
        val (left, next) = if (red % 2 == 1) width - 1 to -1 else 0 to 1
        val vertical = Axis(below, high.count() / side, TURNS[facts.origin.orientation - 1][0] < 0)
        val horizontal = Axis(next, wide.count() / side, TURNS[facts.origin.orientation - 1][1] < 0)
        val (outer, inner) = if (parts.turned) horizontal to vertical else vertical to horizontal
        val origin = first + left + outer.start + inner.start
        val pixels = ShortArray(3 * outer.count * inner.count)
        for (y in 0 until outer.count) {
            for (x in 0 until inner.count) {
                val from = origin + y * outer.step + x * inner.step
                val to = 3 * (y * inner.count + x)
                for (c in 0..2) pixels[to + c] = round(numbers.values[c * height * width + from]).toInt().toShort()
            }
        }
        return pixels
    }

    /**
     * One axis of the sensor as the upright picture goes along it.
     *
     * @param along step from a pixel to the next one on the sensor.
     * @property count number of pixels.
     * @param reversed whether the last one comes first.
     */
    private class Axis(along: Int, val count: Int, reversed: Boolean) {
        val start = if (reversed) (count - 1) * along else 0
        val step = if (reversed) -along else along
    }

    private companion object {
        /** Sense of the sensor's rows and columns in the upright picture, by TIFF orientation from 1 on. */
        val TURNS = listOf(
            intArrayOf(1, 1), intArrayOf(1, -1), intArrayOf(-1, -1), intArrayOf(-1, 1),
            intArrayOf(1, 1), intArrayOf(-1, 1), intArrayOf(-1, -1), intArrayOf(1, -1),
        )

        /**
         * Indices of the cells that hold a part of an axis, with one cell more on each side; beyond the edge those of
         * the samples mirrored at it, which have the same colours.
         */
        fun withMargin(part: IntRange, size: Int, mirrored: Boolean): IntArray {
            val last = part.last + 1
            val indices = IntArray(last + last % 2 + 4 - part.first) { step ->
                val at = abs(part.first - 2 + step) % (2 * size - 2)
                minOf(at, 2 * size - 2 - at)
            }
            return if (mirrored) indices.reversedArray() else indices
        }
    }
}
