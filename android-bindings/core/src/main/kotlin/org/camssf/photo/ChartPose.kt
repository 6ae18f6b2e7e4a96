package org.camssf.photo

import org.camssf.ChartNotFound
import org.camssf.InvalidArgument
import org.camssf.Refusal
import org.camssf.Rules
import org.camssf.frozen
import org.camssf.json.whole
import org.camssf.short
import org.camssf.spectra.Bundled
import org.camssf.spectra.ChartLayout
import org.camssf.spectra.ChartTable
import kotlin.math.max
import kotlin.math.min

/**
 * Position of the chart in a photo. Points are in pixels of the active area; the centre of the first sample is
 * (0, 0). Safe to pass between threads.
 *
 * @property layout name of the [ChartLayout].
 * @property quarterTurns number of 90° clockwise turns of the chart as photographed, relative to upright: 0 to 3.
 * @property method "detected" or "by hand".
 * @property score agreement with the chart's own colours, 0 to 1 (correlation).
 */
public class ChartPose internal constructor(
    public val layout: String,
    internal val sharedCorners: DoubleArray,
    internal val sharedQuads: DoubleArray,
    public val quarterTurns: Int,
    public val method: String,
    public val score: Double,
    notes: List<String>,
) {
    /** Messages for the user about how the pose was found. */
    public val notes: List<String> = notes.frozen()

    override fun toString(): String = "ChartPose($layout, $corners, score=${short(score)})"

    /** Outer corners of the block of patches (outer borders of the corner patches), named as on the chart. */
    public val corners: Corners by lazy { Corners.of(*sharedCorners) }

    /** Corners of each patch, on its borders, in the chart's reading order. */
    public val patches: List<Corners> by lazy {
        List(sharedQuads.size / 8) { Corners.of(*sharedQuads.copyOfRange(8 * it, 8 * it + 8)) }.frozen()
    }

    public companion object {
        /**
         * Computes the pose from four rough corners (taps, a viewfinder's overlay). The patch colours determine the
         * orientation. The corners are moved to the printed borders if these are found nearby; if not, the corners
         * are kept and `notes` says so. The algorithm is that of Python's `find_chart(mosaic, table, corners=...)`.
         *
         * Threads: any but the main one.
         *
         * @param mosaic the photo of the chart; its region must hold the part that [region] names.
         * @param corners of the block of patches, or the fiducials of its layout, in order around it, starting at any
         *   of them, px of the active area; each is off by half a patch at most.
         * @throws ChartNotFound the colours inside the corners do not agree with the chart, or it is mirrored.
         * @throws InvalidArgument the corners do not form a convex quadrilateral inside the photo, or the table does
         *   not fit its layout.
         */
        @JvmStatic
        public fun refine(mosaic: Mosaic, corners: Corners, chart: ChartTable): ChartPose =
            refine(Whole(mosaic), corners, chart)

        /** As above, for a photo that is read part by part. */
        internal fun refine(photo: Reading, corners: Corners, chart: ChartTable): ChartPose {
            val facts = photo.facts
            val layout = chart.layout
            if (chart.patches.size != layout.columns * layout.rows) {
                throw InvalidArgument(
                    "The chart table '${chart.table}' does not fit the layout ${layout.name}.",
                    "Give a table of ${layout.columns * layout.rows} patches.",
                )
            }
            val smallest = Bundled.limits.whole("smallest_photo")
            if (min(facts.width, facts.height) < smallest) {
                throw Refusal.of(
                    "chart_not_found.small_photo", "file" to facts.name, "width" to facts.width,
                    "height" to facts.height, value = min(facts.width, facts.height).toDouble(),
                    threshold = smallest.toDouble(),
                )
            }
            val rough = corners.toArray()
            check(rough, facts)
            return PoseSearch(photo, layout, chart.genericSignals(), rough).pose()
        }

        /** The part of a photo that [refine] and the patch measurement read; it may extend beyond the photo. */
        @JvmStatic
        public fun region(corners: Corners): Region {
            val (left, right) = reach(corners.points.map { it.x })
            val (top, bottom) = reach(corners.points.map { it.y })
            return Region(left, top, right, bottom)
        }

        /**
         * First pixel and one past the last pixel of the corners' bounding box, widened on each side.
         */
        private fun reach(places: List<Double>): Pair<Int, Int> {
            val rules = Rules.shipped
            val margin =
                rules.number("pose.margin") * (places.max() - places.min()) + rules.number("pose.margin_pixels")
            return max(places.min() - margin, 0.0).toInt() / 2 * 2 to max(places.max() + margin, 1.0).toInt()
        }

        private fun check(corners: DoubleArray, photo: Facts) {
            val last = intArrayOf(photo.width - 1, photo.height - 1)
            if (corners.indices.any { corners[it] < 0 || corners[it] > last[it % 2] }) {
                throw outside(photo.name, photo.width, photo.height)
            }
            if (!Lattice.convex(corners)) {
                throw InvalidArgument("The corners do not go around a convex quadrilateral.", Corners.ADVICE)
            }
        }
    }
}

/** The error for a corner of the chart, or the part around it, that lies outside the photo. */
internal fun outside(name: String, width: Int, height: Int) = InvalidArgument(
    "A corner lies outside $name, a photo of $width × $height px.",
    "Give corners in pixels of the RAW photo, x from 0 to ${width - 1} and y from 0 to ${height - 1}: points on a " +
        "preview must be scaled to it, and turned back where the preview is turned.",
)
