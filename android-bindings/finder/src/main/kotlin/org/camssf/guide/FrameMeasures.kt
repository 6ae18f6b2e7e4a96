package org.camssf.guide

import org.camssf.finder.Candidate

/**
 * Measures of one frame.
 *
 * Light is linear, on the assumption that the frame's values are sRGB. A preview has its own tone curve, so stops are
 * for guidance only.
 *
 * @property candidate the chart that was measured.
 * @property size longer side of the block of patches / longer side of the picture.
 * @property margin distance from the chart, including its border, to the picture's nearest border, in patch pitches;
 *   below 0 the chart is cut.
 * @property tilt angle between the chart's normal and the line of sight to its centre, degrees, for the focal length
 *   of the guide.
 * @property speed speed of the fastest corner, pitches per second; null in the first frame and after a pause.
 * @property white level of the white patch, where 1 is the frame's full scale; if it is clipped, estimated from other
 *   patches.
 * @property clipped share of the white patch's pixels that are at the ceiling.
 * @property blur standard deviation of the blur of the patch borders, px; the worse of both directions. Null if too
 *   few borders have enough contrast.
 * @property glare indices of the patches with glare, in reading order.
 * @property veil level of the black patch / level of the white patch; null if the chart's colours are unknown,
 *   white is too dark or has glare, or a shadow may lie on the chart.
 * @property shadow how much darker one part of the chart is than the rest, along an edge, stops; 0 if an even
 *   gradient fits about as well. Null for a chart of unknown colours (SG).
 * @property gradient difference between the brightest and the darkest corner of the block, stops, measured within the
 *   patches.
 * @property tint colourfulness of the surroundings in the chart's own light: largest minus smallest channel of their
 *   mean, where white is 1. Null if the frame has no colours.
 */
public class FrameMeasures internal constructor(
    public val candidate: Candidate,
    public val size: Double,
    public val margin: Double,
    public val tilt: Double,
    public val speed: Double?,
    public val white: Double,
    public val clipped: Double,
    public val blur: Double?,
    public val glare: List<Int>,
    public val veil: Double?,
    public val shadow: Double?,
    public val gradient: Double,
    public val tint: Double?,
    internal val pitch: Double,
) {
    override fun toString(): String = "FrameMeasures(size=$size, margin=$margin, tilt=$tilt, speed=$speed, " +
        "white=$white, clipped=$clipped, blur=$blur, glare=$glare, veil=$veil, shadow=$shadow, " +
        "gradient=$gradient, tint=$tint)"
}
