package org.camssf.colour

import org.camssf.CalibrationException
import org.camssf.ChartNotFound
import org.camssf.InvalidArgument
import org.camssf.Overexposed
import org.camssf.Rules
import org.camssf.percent
import org.camssf.photo.ChartPose
import org.camssf.photo.LensShading
import org.camssf.photo.Mosaic
import org.camssf.photo.PatchMeans
import org.camssf.photo.Region
import kotlin.math.hypot

/**
 * A rectangle's raw signals.
 *
 * @property area where it lies, px of the active area as the sensor stores it.
 */
public class RawRegion internal constructor(
    public val area: Region,
    internal val sharedRaw: DoubleArray,
    internal val sharedError: DoubleArray,
) {
    /** (3) R, G, B, DN above black or dark frame; a copy at each call. */
    public val raw: DoubleArray get() = sharedRaw.copyOf()

    /** (3) standard error of [raw], DN; a copy at each call. */
    public val standardError: DoubleArray get() = sharedError.copyOf()

    public companion object {
        /**
         * Measures rectangles of one photo as patches are (docs/patches.md): dust and hot pixels are left out, the noise
         * comes from the samples themselves. The mosaic is a DNG's or that of a Camera2 frame; it must hold the areas.
         *
         * @param areas 12 × 12 pixels or more each.
         * @param dark a dark frame of the same settings, whose samples are taken off instead of the black level.
         * @throws InvalidArgument an area that leaves the photo or holds too few samples; lens shading that shall be
         *   applied and is not there.
         * @throws Overexposed samples at the ceiling.
         * @throws CalibrationException a dark frame of other settings, and gain maps that camssf does not apply.
         */
        @JvmStatic
        @JvmOverloads
        public fun measure(
            photo: Mosaic,
            areas: List<Region>,
            dark: Mosaic? = null,
            lensShading: LensShading = LensShading.AS_STORED,
        ): List<RawRegion> {
            if (areas.isEmpty()) return emptyList()
            val quads = DoubleArray(8 * areas.size)
            areas.forEachIndexed { i, area -> quad(photo, area, i + 1).copyInto(quads, 8 * i) }
            val pose = ChartPose("regions", quads.copyOf(8), quads, 0, "by hand", 1.0, emptyList())
            val means = try {
                PatchMeans.measure(photo, pose, null, dark, lensShading)
            } catch (error: ChartNotFound) {
                throw InvalidArgument(
                    "A region holds fewer than ${Rules.shipped.whole("patches.fewest")} good samples of a colour.",
                    "Give 12 × 12 pixels or more.",
                    cause = error,
                )
            }
            return areas.mapIndexed { i, area ->
                val clipped = (3 * i..3 * i + 2).maxOf { means.chart.clipped[it] }
                val limit = Rules.shipped.number("signals.clipped")
                if (clipped > limit) {
                    throw Overexposed(
                        "Region ${i + 1}: ${percent(clipped, 1)} of its samples are at the ceiling.",
                        "Take the photo again with less exposure.",
                        clipped,
                        limit,
                    )
                }
                val night = means.dark
                RawRegion(
                    area,
                    DoubleArray(3) {
                        means.chart.mean[3 * i + it] - (night?.mean?.get(3 * i + it) ?: means.black[it])
                    },
                    DoubleArray(3) {
                        hypot(means.chart.standardError[3 * i + it], night?.standardError?.get(3 * i + it) ?: 0.0)
                    },
                )
            }
        }

        /** Corners (4, 2) of which measuring takes the inner part: the pixels' borders lie half a pixel outside. */
        private fun quad(photo: Mosaic, area: Region, number: Int): DoubleArray {
            if (area.width <= 0 || area.height <= 0) {
                throw InvalidArgument("Region $number is empty.", "Give columns and rows, the last ones exclusive.")
            }
            if (area.left < 0 || area.top < 0 || area.right > photo.width || area.bottom > photo.height) {
                throw InvalidArgument(
                    "Region $number leaves the photo, which is ${photo.width} × ${photo.height}.",
                    "Pixels are counted in the sensor's own orientation, from its top left.",
                )
            }
            val left = area.left.toDouble()
            val top = area.top.toDouble()
            val right = area.right - 1.0
            val bottom = area.bottom - 1.0
            val corners = doubleArrayOf(left, top, right, top, right, bottom, left, bottom)
            val centre = DoubleArray(2) {
                ((corners[it] + corners[2 + it]) + (corners[4 + it] + corners[6 + it])) *
                    0.25
            }
            val shrink = Rules.shipped.number("patches.shrink")
            return DoubleArray(8) { centre[it % 2] + (corners[it] - centre[it % 2]) / shrink }
        }
    }
}
