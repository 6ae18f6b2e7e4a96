package org.camssf.photo

import org.camssf.frozen
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp

/**
 * One photo of the chart under one lamp, with its white and dark frames where they exist. Nothing is read before use.
 *
 * @property photo of the chart.
 * @property lamp its light; [Lamp.auto] where it is unknown.
 * @property corners rough outer corners of the block of patches, see [ChartPose.refine].
 * @property white the white frame, taken like the photo; all shots of a capture have one, or none.
 * @property dark the dark frame, likewise.
 * @property lensShading what is done about the shading that the photo's file describes.
 */
public class Shot @JvmOverloads constructor(
    public val photo: PhotoSource,
    public val lamp: Lamp,
    public val corners: Corners,
    public val white: PhotoSource? = null,
    public val dark: PhotoSource? = null,
    public val lensShading: LensShading = LensShading.AS_STORED,
) {
    /** A shot whose light is unknown: its lamp is [Lamp.auto]. */
    @JvmOverloads
    public constructor(
        photo: PhotoSource,
        corners: Corners,
        white: PhotoSource? = null,
        dark: PhotoSource? = null,
        lensShading: LensShading = LensShading.AS_STORED,
    ) : this(photo, Lamp.auto(), corners, white, dark, lensShading)
}

/**
 * k shots of one chart with one camera.
 *
 * @param shots k of them; copied.
 * @property chart the chart's table.
 * @property whiteReflectance of the white frame's card, one number; null for a perfect diffuser.
 */
public class Capture @JvmOverloads constructor(
    shots: List<Shot>,
    public val chart: ChartTable,
    public val whiteReflectance: Double? = null,
) {
    /** The shots, k of them. */
    public val shots: List<Shot> = shots.frozen()

    /** One shot. */
    public constructor(shot: Shot, chart: ChartTable) : this(listOf(shot), chart)
}
