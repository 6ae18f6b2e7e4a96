package org.camssf.colour

import org.camssf.InvalidArgument
import org.camssf.photo.Mosaic
import org.camssf.photo.Region

/** Converts a mosaic to pixels of a live preview without demosaicing: each pixel is the mean of whole CFA cells. */
public class RawPixels private constructor(
    /** The part that is read, px of the active area in the sensor's orientation; its borders lie on whole cells. */
    public val area: Region,
    private val cells: Int,
) {
    override fun toString(): String = "RawPixels($area, $rows × $columns)"

    /** Number of pixels in a row. */
    public val columns: Int get() = area.width / (2 * cells)

    /** Number of rows of pixels. */
    public val rows: Int get() = area.height / (2 * cells)

    /**
     * Computes R, G, B of each pixel, row by row, DN above black. A pixel with a clipped sample is NaN.
     *
     * @param photo a photo whose region contains [area].
     * @param into receives 3 · [rows] · [columns] numbers; a preview can reuse it for every frame.
     * @throws InvalidArgument an array of another size, or a photo that does not contain [area].
     */
    @JvmOverloads
    public fun read(photo: Mosaic, into: FloatArray = FloatArray(3 * rows * columns)): FloatArray {
        if (into.size != 3 * rows * columns) {
            throw InvalidArgument(
                "${into.size} numbers are not $rows rows of $columns pixels.",
                "Give three numbers a pixel.",
            )
        }
        val held = photo.region
        if (area.left < held.left || area.top < held.top || area.right > held.right || area.bottom > held.bottom) {
            throw InvalidArgument("$area leaves the samples of ${photo.name}, $held.", "Read that part too.")
        }
        val order = photo.sensor.cfa
        val black = photo.sensor.sharedBlack
        // Position of red and blue in the cell; the other two are green.
        val red = order.indexOf('R')
        val blue = order.indexOf('B')
        val greens = (black[red xor 1] + black[blue xor 1]) / 2
        val samples = photo.samples
        val share = 1f / (cells * cells)
        for (pixel in 0 until rows * columns) {
            val left = area.left + pixel % columns * 2 * cells - held.left
            val top = area.top + pixel / columns * 2 * cells - held.top
            var r = 0
            var g = 0
            var b = 0
            var most = 0
            for (cell in 0 until cells * cells) {
                val at = (top + cell / cells * 2) * held.width + left + cell % cells * 2
                for (place in 0..3) {
                    val value = samples[at + (place shr 1) * held.width + (place and 1)].toInt() and 0xffff
                    when (place) {
                        red -> r += value
                        blue -> b += value
                        else -> g += value
                    }
                    if (value > most) most = value
                }
            }
            val full = most >= photo.sensor.white
            into[3 * pixel] = if (full) Float.NaN else (r * share - black[red]).toFloat()
            into[3 * pixel + 1] = if (full) Float.NaN else (g * share / 2 - greens).toFloat()
            into[3 * pixel + 2] = if (full) Float.NaN else (b * share - black[blue]).toFloat()
        }
        return into
    }

    public companion object {
        /**
         * Creates a reader of an area, with `cells` × `cells` CFA cells per pixel.
         *
         * @param area cropped to whole pixels.
         * @throws InvalidArgument the area contains no whole pixel, or `cells` is not 1 to 64.
         */
        @JvmStatic
        @JvmOverloads
        public fun of(area: Region, cells: Int = 1): RawPixels {
            val left = area.left + (area.left and 1)
            val top = area.top + (area.top and 1)
            val columns = if (cells in 1..MOST) (area.right - left) / (2 * cells) else 0
            val rows = if (cells in 1..MOST) (area.bottom - top) / (2 * cells) else 0
            if (area.left < 0 || area.top < 0 || columns < 1 || rows < 1) {
                throw InvalidArgument(
                    "There is no pixel of $cells × $cells cells in $area.",
                    "Give a larger area, and 1 to $MOST cells.",
                )
            }
            return RawPixels(Region(left, top, left + 2 * cells * columns, top + 2 * cells * rows), cells)
        }

        /** Limit of `cells`, so that the sum of a pixel's samples does not overflow an Int. */
        private const val MOST = 64
    }
}
