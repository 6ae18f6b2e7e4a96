package org.camssf.guide

import org.camssf.finder.Sighting

/**
 * What one frame tells of a capture. Light is counted linear, the frame's values taken for sRGB's: a preview's own tone
 * curve makes stops from it a guide, not a measurement.
 *
 * @property sighting of the chart that was measured.
 * @property size longer side of the block of patches, as a share of the picture's longer side.
 * @property margin from the chart with its border to the picture's nearest border, in patch pitches; below 0 it is cut.
 * @property tilt angle between the chart's normal and the line of sight to its middle, degrees, for the lens told.
 * @property speed of the fastest corner in pitches a second; null in the first frame, and after a pause.
 * @property white the white patch's level, 1 is the frame's full scale; where it is clipped, what other patches tell of it.
 * @property clipped share of the white patch's pixels that are at the ceiling.
 * @property blur standard deviation of the softness of patch borders, px; the worse of both directions. Null where no
 *   border has enough contrast.
 * @property glare indices of the patches on which something shines, in reading order.
 * @property veil the black patch's level over the white one's, null where either is not known or a shadow may
 *   lie on one of them.
 * @property shadow by how much one part of the chart is darker than the rest along an edge, stops; 0 where an even
 *   gradient says it better. Null for a chart of unknown colours (SG).
 * @property gradient from the brightest to the darkest corner of the block, stops, as seen within the patches.
 * @property tint how coloured the surroundings are in the chart's own light: most less least channel of their mean, white
 *   is 1. Null where the frame has no colours.
 */
public class FrameMeasures internal constructor(
    public val sighting: Sighting,
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
)
