package org.camssf.photo

import org.camssf.ChartNotFound
import org.camssf.FramesDiffer
import org.camssf.InvalidArgument
import org.camssf.UnsupportedRaw

/**
 * One shot: the same samples of the chart, white and dark frames. Safe to pass between threads.
 *
 * @property chart statistics of the chart photo.
 * @property white of the white frame, or null.
 * @property dark of the dark frame, or null.
 * @property saturation the white level, DN.
 */
public class PatchMeans internal constructor(
    public val chart: FrameMeans,
    public val white: FrameMeans?,
    public val dark: FrameMeans?,
    internal val sharedBlack: DoubleArray,
    public val saturation: Double,
) {
    /** (3) the file's black level of R, G, B, DN; a copy at each call. */
    public val black: DoubleArray get() = sharedBlack.copyOf()

    public companion object {
        /**
         * Measures the same samples of every patch in all frames of one shot, by the numbered rules of docs/patches.md:
         * sums of whole numbers, so Python and Kotlin give the same to the last bit.
         *
         * @param chart the photo of the chart; its region must hold the patches, and so must the other frames'.
         * @param pose where the chart lies in it.
         * @param white the white frame, taken like the chart photo; null if there is none.
         * @param dark the dark frame, likewise.
         * @throws InvalidArgument lens shading shall be applied and the file holds none.
         * @throws UnsupportedRaw gain maps that camssf does not apply.
         * @throws FramesDiffer size, CFA, camera, levels, exposure or ISO of a frame differ from the chart photo's.
         * @throws ChartNotFound a patch leaves the photo, or holds fewer than 16 samples of a colour.
         */
        @JvmStatic
        @JvmOverloads
        public fun measure(
            chart: Mosaic,
            pose: ChartPose,
            white: Mosaic? = null,
            dark: Mosaic? = null,
            lensShading: LensShading = LensShading.AS_STORED,
        ): PatchMeans {
            if (lensShading == LensShading.APPLY && chart.gainMaps.isEmpty()) {
                throw InvalidArgument(
                    "${chart.name} holds no lens-shading map to apply.",
                    "Leave the samples as stored, or take a white frame.",
                )
            }
            if (white != null) Alike.check(chart, white, "white")
            if (dark != null) Alike.check(chart, dark, "dark")
            val frames = listOfNotNull(chart, white, dark)
            val cells = PatchSamples.cells(chart.cfa)
            val levels = chart.black
            val black = DoubleArray(4) { levels[cells[it]] }
            val quads = pose.sharedQuads
            val joined = frames.map { JoinedPositions(quads.size / 8, black, chart.white) }
            for (patch in 0 until quads.size / 8) {
                val quad = quads.copyOfRange(8 * patch, 8 * patch + 8)
                val shading = if (lensShading == LensShading.APPLY) Shading.of(chart, quad) else null
                for ((position, cell) in cells.withIndex()) {
                    val found = PatchSample.of(frames, quad, cell, patch + 1)
                    val gain = shading?.get(cell) ?: 1.0
                    for ((frame, sample) in joined.zip(found)) frame.put(patch, position, sample, gain)
                }
            }
            val means = joined.map { it.means() }
            return PatchMeans(
                means[0],
                if (white != null) means[1] else null,
                if (dark != null) means.last() else null,
                doubleArrayOf(black[0], (black[1] + black[2]) / 2, black[3]),
                chart.white,
            )
        }
    }
}
