package org.camssf.photo

import org.camssf.spectra.Lamp

/**
 * One measured shot. It is small, so an app can measure right after taking the photo and solve later, also after it was
 * saved ([MeasuredCapture.toJson]).
 *
 * @property lamp its light.
 * @property photo metadata of the chart photo.
 * @property white metadata of the white frame, or null.
 * @property dark metadata of the dark frame, or null.
 * @property pose the chart's position in the photo.
 * @property means the patch statistics of all frames.
 * @property lensShading treatment of the shading that the file describes.
 */
public class MeasuredShot internal constructor(
    public val lamp: Lamp,
    public val photo: Photo,
    public val white: Photo?,
    public val dark: Photo?,
    public val pose: ChartPose,
    public val means: PatchMeans,
    public val lensShading: LensShading,
) {
    /** The same measurement with another lamp. */
    internal fun under(lamp: Lamp): MeasuredShot = MeasuredShot(lamp, photo, white, dark, pose, means, lensShading)

    override fun toString(): String = "MeasuredShot($photo, ${lamp.name})"
}
