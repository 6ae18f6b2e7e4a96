package org.camssf.photo

import org.camssf.frozen
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp

/**
 * One photo of the chart under one lamp, with its white and dark frames if they exist. No file is read before use.
 *
 * @property photo of the chart.
 * @property lamp its light; [Lamp.auto] if it is unknown.
 * @property corners rough outer corners of the block of patches, see [ChartPose.refine].
 * @property white the white frame, taken with the same settings as the photo; all or none of a capture's shots have
 *   one.
 * @property dark the dark frame, also with these settings.
 * @property lensShading treatment of the shading that the photo's file describes.
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

    override fun toString(): String =
        "Shot(${lamp.name}, $corners, white=${white != null}, dark=${dark != null}, lensShading=$lensShading)"
}

/**
 * k shots of one chart with one camera.
 *
 * @param shots k of them; copied.
 * @property chart the chart's table.
 * @property whiteReflectance reflectance of the white frame's target, one number; null for a perfect diffuser.
 */
public class Capture @JvmOverloads constructor(
    shots: List<Shot>,
    public val chart: ChartTable,
    public val whiteReflectance: Double? = null,
) {
    /** The shots, k of them. */
    public val shots: List<Shot> = shots.frozen()

    /** A capture of one shot. */
    public constructor(shot: Shot, chart: ChartTable) : this(listOf(shot), chart)

    override fun toString(): String = "Capture($chart, $shots)"
}
