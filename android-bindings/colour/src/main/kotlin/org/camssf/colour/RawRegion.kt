package org.camssf.colour

import org.camssf.CalibrationException
import org.camssf.ChartNotFound
import org.camssf.InvalidArgument
import org.camssf.Overexposed
import org.camssf.Refusal
import org.camssf.Rows
import org.camssf.Rules
import org.camssf.photo.ChartPose
import org.camssf.photo.LensShading
import org.camssf.photo.Mosaic
import org.camssf.photo.PatchMeans
import org.camssf.photo.Region
import org.camssf.short
import kotlin.math.hypot
import kotlin.math.sqrt

/**
 * A rectangle's raw signals, and the photo that they come from.
 *
 * @property area its position, px of the active area in the sensor's orientation.
 */
public class RawRegion internal constructor(
    public val area: Region,
    internal val sharedRaw: DoubleArray,
    internal val sharedError: DoubleArray,
    internal val source: SignalSource,
    /** (3) variance of a sample over the light of its photo, DN; null if it is not known. */
    internal val sharedPhotonNoise: DoubleArray? = null,
    /** (3) what was subtracted besides black, DN: the light of a dark photo. */
    private val sharedDark: DoubleArray = DoubleArray(3),
) {
    /** (3) R, G, B, DN above black or dark frame. */
    public val raw: Rows get() = Rows(sharedRaw, 3)

    /** (3) standard error of [raw], DN. */
    public val standardError: Rows get() = Rows(sharedError, 3)

    /** (3) signal of a pixel over its noise, that of a dark photo among it; null if the noise is not known. */
    public val signalToNoise: Rows?
        get() = sharedPhotonNoise?.let { noise ->
            val ratios = DoubleArray(3) { sharedRaw[it] / sqrt(noise[it] * (sharedRaw[it] + 2 * sharedDark[it])) }
            Rows(ratios, 3)
        }

    override fun toString(): String = "RawRegion($area, raw=${sharedRaw.joinToString { short(it) }})"

    public companion object {
        /**
         * Measures rectangles of one photo in the same way as chart patches (docs/patches.md): dust and hot pixels
         * are left out, and the noise is estimated from the samples. The mosaic comes from a DNG or a Camera2 frame;
         * it must contain the areas.
         *
         * Threads: any but the main one.
         *
         * @param areas rectangles of at least 12 × 12 pixels.
         * @param dark with the same settings, subtracted instead of the black level: a photo with the lens covered; or
         *   of the same view with the torch off, for the signals in the torch's light alone.
         * @throws InvalidArgument an area that extends beyond the photo or holds too few samples; `lensShading` is
         *   APPLY, but the file holds no gain maps.
         * @throws Overexposed clipped samples.
         * @throws CalibrationException a dark frame with other settings, or gain maps that camssf cannot apply.
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
            val source = SignalSource(photo.facts, lensShading)
            return areas.mapIndexed { i, area ->
                val clipped = (3 * i..3 * i + 2).maxOf { means.chart.sharedClipped[it] }
                val limit = Rules.shipped.number("signals.clipped")
                if (clipped > limit) {
                    throw Refusal.of(
                        "overexposed.region", "region" to i + 1, "share" to clipped, value = clipped,
                        threshold = limit,
                    )
                }
                val darkFrame = means.dark
                val light = DoubleArray(3) { means.chart.sharedMean[3 * i + it] - means.sharedBlack[it] }
                val darkLight = DoubleArray(3) {
                    if (darkFrame == null) 0.0 else darkFrame.sharedMean[3 * i + it] - means.sharedBlack[it]
                }
                RawRegion(
                    area,
                    DoubleArray(3) { light[it] - darkLight[it] },
                    DoubleArray(3) {
                        hypot(means.chart.sharedError[3 * i + it], darkFrame?.sharedError?.get(3 * i + it) ?: 0.0)
                    },
                    source,
                    DoubleArray(3) {
                        val error = means.chart.sharedError[3 * i + it]
                        error * error * means.chart.sharedCount[3 * i + it] / light[it]
                    },
                    darkLight,
                )
            }
        }

        /** Corners (4, 2), enlarged so that the inner part that is measured is exactly the area's samples. */
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
