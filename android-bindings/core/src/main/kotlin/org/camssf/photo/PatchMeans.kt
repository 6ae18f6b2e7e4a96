package org.camssf.photo

import org.camssf.ChartNotFound
import org.camssf.FramesDiffer
import org.camssf.InvalidArgument
import org.camssf.Rows
import org.camssf.UnsupportedRaw

/**
 * Patch statistics of one shot: the same samples of the chart, white and dark frames. Safe to pass between threads.
 *
 * @property chart statistics of the chart photo.
 * @property white of the white frame, or null.
 * @property dark of the dark frame, or null.
 * @property saturation the white level, DN.
 * @property evened whether [chart] is that of even light already, by a white frame.
 * @property noise how the samples of the chart photo differ from their neighbours; null if it was not measured.
 */
public class PatchMeans internal constructor(
    public val chart: FrameMeans,
    public val white: FrameMeans?,
    public val dark: FrameMeans?,
    internal val sharedBlack: DoubleArray,
    public val saturation: Double,
    internal val evened: Boolean = false,
    internal val noise: SampleNoise? = null,
) {
    /** (3) the file's black level of R, G, B, DN. */
    public val black: Rows get() = Rows(sharedBlack, 3)

    override fun toString(): String = "PatchMeans(chart=$chart, white=$white, dark=$dark)"

    public companion object {
        /** As the other `measure`, without white and dark frame, shading as stored. */
        @JvmStatic
        public fun measure(chart: Mosaic, pose: ChartPose): PatchMeans =
            measure(chart, pose, null, null, LensShading.AS_STORED)

        /**
         * Measures the same samples of every patch in all frames of one shot, by the numbered rules of
         * docs/patches.md. The sums are of whole numbers, so Python's and Kotlin's results are equal bit for bit.
         *
         * Threads: any but the main one.
         *
         * @param chart the photo of the chart; its region must hold the patches, and so must the other frames'.
         * @param pose the chart's position in it.
         * @param white the white frame, taken with the same settings as the chart photo; null if there is none.
         * @param dark the dark frame, also with these settings; null if there is none.
         * @throws InvalidArgument `lensShading` is APPLY, but the file holds no gain maps.
         * @throws UnsupportedRaw the file has gain maps that camssf cannot apply.
         * @throws FramesDiffer size, CFA, camera, levels, exposure or ISO of a frame differ from the chart photo's.
         * @throws org.camssf.UnitDiffers the physical camera or lens of a frame differs.
         * @throws ChartNotFound a patch leaves the photo, or holds fewer than 16 samples of a colour.
         */
        @JvmStatic
        public fun measure(
            chart: Mosaic,
            pose: ChartPose,
            white: Mosaic?,
            dark: Mosaic?,
            lensShading: LensShading,
        ): PatchMeans = measure(Whole(chart), pose, white?.let { Whole(it) }, dark?.let { Whole(it) }, lensShading)

        /** As above, for frames that are read part by part. */
        internal fun measure(
            chart: Reading,
            pose: ChartPose,
            white: Reading?,
            dark: Reading?,
            lensShading: LensShading,
        ): PatchMeans {
            val facts = chart.facts
            if (lensShading == LensShading.APPLY && facts.corrections.gainMaps.isEmpty()) {
                throw InvalidArgument(
                    "${facts.name} holds no lens-shading map to apply.",
                    "Leave the samples as stored, or take a white frame.",
                )
            }
            if (white != null) Alike.check(facts, white.facts, "white")
            if (dark != null) Alike.check(facts, dark.facts, "dark")
            val cells = PatchSamples.cells(facts.sensor.cfa)
            val levels = facts.sensor.sharedBlack
            val black = DoubleArray(4) { levels[cells[it]] }
            val patches = pose.sharedQuads.size / 8
            val quads = List(patches) { pose.sharedQuads.copyOfRange(8 * it, 8 * it + 8) }
            val shading = quads.map { if (lensShading == LensShading.APPLY) Shading.of(facts, it) else null }
            val frames = listOfNotNull(chart, white, dark)
            val joined = frames.map { JoinedPositions(patches, black, facts.sensor.white) }
            val noise = NeighbourNoise(patches, cells, black)
            PatchFrames(frames, quads).each(noise) { patch, position, found ->
                val gain = shading[patch]?.get(cells[position]) ?: 1.0
                for ((frame, sample) in joined.zip(found)) frame.put(patch, position, sample, gain)
            }
            val means = joined.map { it.means() }
            return PatchMeans(
                means[0],
                if (white != null) means[1] else null,
                if (dark != null) means.last() else null,
                doubleArrayOf(black[0], (black[1] + black[2]) / 2, black[3]),
                facts.sensor.white,
                noise = noise.result(),
            )
        }
    }
}
