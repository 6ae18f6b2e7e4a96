package org.camssf.finder

import org.camssf.photo.Corners
import org.camssf.photo.Point

/**
 * A chart in a picture. Points are px of the [Picture] that was searched, where the centre of its first pixel is (0, 0).
 *
 * @property corners outer corners of the block of patches, named as on the chart as printed: the top left is the first
 *   patch's (dark skin, A1), the bottom right the last one's. In a mirror they run anticlockwise.
 * @property kind which grid and colours.
 * @property mirrored the colours agree as seen in a mirror: a mirror, a front camera, a flipped picture.
 * @property confidence agreement with the chart's colours, 0 to 1: their correlation, whatever cast and exposure. Below
 *   0.75 nothing is called a chart; above 0.9 the light is even and the chart in focus. A printed copy of the same
 *   colours agrees as well: it cannot be told from a chart.
 * @property patches centres of the patches, in the chart's reading order.
 * @property seen how many of the patches stood out by themselves; where the others lie follows from these.
 */
public class Sighting internal constructor(
    public val corners: Corners,
    public val kind: ChartKind,
    public val mirrored: Boolean,
    public val confidence: Double,
    public val patches: List<Point>,
    public val seen: Int,
)

/** What an app should know of a search beside where the chart lies. */
public enum class Finding {
    /** No chart was found. */
    NONE,

    /** The best sighting is mirrored. */
    MIRRORED,

    /** More than one chart is in view; the first sighting agrees best. */
    TWO_CHARTS,
}

/**
 * What [ChartFinder.find] found.
 *
 * @property sightings the charts, best first; empty if there is none.
 * @property findings what to know beside.
 */
public class Found internal constructor(public val sightings: List<Sighting>, public val findings: Set<Finding>) {
    /** The best one, or null. */
    public val sighting: Sighting? get() = sightings.firstOrNull()
}
