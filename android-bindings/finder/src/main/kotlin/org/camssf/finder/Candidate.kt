package org.camssf.finder

import org.camssf.photo.Corners
import org.camssf.photo.Point

/**
 * A chart in a picture. Points are px of the searched [Picture], where the centre of its first pixel is (0, 0).
 *
 * @property corners outer corners of the block of patches: top left, top right, bottom right, bottom left as printed.
 *   The first patch (dark skin, A1) is at the top left, the last one at the bottom right. The corners of a mirrored
 *   chart run anticlockwise.
 * @property kind the grid and its colours.
 * @property mirrored true if the colours agree with the chart seen in a mirror: a mirror, a front camera or a flipped
 *   picture.
 * @property confidence agreement with the chart's colours, 0 to 1: their correlation, independent of colour cast and
 *   exposure. Below 0.75 (0.85 without colour) nothing is reported; above 0.9 the light is even and the chart in
 *   focus. A printed copy with the same colours cannot be distinguished from a chart.
 * @property patches centres of the patches, in the chart's reading order.
 * @property seen number of patches found as blobs; the positions of the others follow from these.
 */
public class Candidate internal constructor(
    public val corners: Corners,
    public val kind: ChartKind,
    public val mirrored: Boolean,
    public val confidence: Double,
    public val patches: List<Point>,
    public val seen: Int,
) {
    override fun toString(): String =
        "Candidate($kind, $corners, confidence=$confidence, mirrored=$mirrored, seen=$seen)"
}

/** A remark about a search. */
public enum class Finding {
    /** No chart was found. */
    NONE,

    /** The best candidate is mirrored. */
    MIRRORED,

    /** More than one chart is in view; the first candidate agrees best. */
    TWO_CHARTS,
}

/**
 * The result of [ChartFinder.find].
 *
 * @property candidates the charts, best first; empty if there is none.
 * @property findings remarks about the search.
 */
public class Found internal constructor(public val candidates: List<Candidate>, public val findings: Set<Finding>) {
    /** The best candidate, or null. */
    public val candidate: Candidate? get() = candidates.firstOrNull()

    override fun toString(): String = "Found($candidates, $findings)"
}
