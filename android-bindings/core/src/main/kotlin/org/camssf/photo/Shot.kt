package org.camssf.photo

import org.camssf.frozen
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp

/**
 * One photo of the chart under one lamp, with its white and dark frames if they exist. No file is read before use.
 * Immutable; safe to pass between threads.
 *
 * @property photo of the chart.
 * @property lamp its light; [Lamp.auto] if it is unknown.
 * @property corners rough outer corners of the block of patches, see [ChartPose.refine].
 * @property white the white frame, taken with the same settings as the photo; all or none of a capture's shots have
 *   one.
 * @property dark the dark frame, also with these settings.
 * @property lensShading treatment of the shading that the photo's file describes.
 */
public class Shot internal constructor(
    public val photo: PhotoSource,
    public val lamp: Lamp,
    public val corners: Corners,
    public val white: PhotoSource? = null,
    public val dark: PhotoSource? = null,
    public val lensShading: LensShading = LensShading.AS_STORED,
) {
    /** A shot without white and dark frame. */
    public constructor(photo: PhotoSource, lamp: Lamp, corners: Corners) :
        this(photo, lamp, corners, null, null, LensShading.AS_STORED)

    /** A shot whose light is unknown: its lamp is [Lamp.auto]. */
    public constructor(photo: PhotoSource, corners: Corners) : this(photo, Lamp.auto(), corners)

    /** The same shot with this white frame; null for none. */
    public fun withWhite(photo: PhotoSource?): Shot = Shot(this.photo, lamp, corners, photo, dark, lensShading)

    /** The same shot with this dark frame; null for none. */
    public fun withDark(photo: PhotoSource?): Shot = Shot(this.photo, lamp, corners, white, photo, lensShading)

    /** The same shot with another treatment of the file's lens shading. */
    public fun withLensShading(shading: LensShading): Shot = Shot(photo, lamp, corners, white, dark, shading)

    override fun toString(): String =
        "Shot(${lamp.name}, $corners, white=${white != null}, dark=${dark != null}, lensShading=$lensShading)"
}

/**
 * k shots of one chart with one camera. Immutable; safe to pass between threads.
 *
 * @param shots k of them; copied.
 * @property chart the chart's table.
 * @property whiteReflectance reflectance of the white frame's target, one number; null for a perfect diffuser.
 */
public class Capture internal constructor(
    shots: List<Shot>,
    public val chart: ChartTable,
    public val whiteReflectance: Double?,
) {
    /** The shots, k of them. */
    public val shots: List<Shot> = shots.frozen()

    /** A capture of several shots, whose white frames, if any, show a perfect diffuser. */
    public constructor(shots: List<Shot>, chart: ChartTable) : this(shots, chart, null)

    /** A capture of one shot. */
    public constructor(shot: Shot, chart: ChartTable) : this(listOf(shot), chart)

    /** The same capture, whose white frames show a target of this reflectance, 90 % is 0.9; null for a diffuser. */
    public fun withWhiteReflectance(reflectance: Double?): Capture = Capture(shots, chart, reflectance)

    override fun toString(): String = "Capture($chart, $shots)"
}
