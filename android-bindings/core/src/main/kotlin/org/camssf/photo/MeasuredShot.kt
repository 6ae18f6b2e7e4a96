package org.camssf.photo

import org.camssf.frozen
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp

/**
 * One measured shot. It is small, so an app can measure right after taking the photo and solve later.
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

    /**
     * The shot as text ("camssf-shot/1"; 13 kB, up to 93 kB under a lamp known only by kind), for a file or an
     * activity's saved state. It contains the photo's name and, if the file has them, the camera's serial number and
     * the capture time.
     */
    public fun toText(): String = SavedShot.write(this)

    override fun toString(): String = "MeasuredShot($photo, ${lamp.name})"

    public companion object {
        /**
         * Reads a shot that [toText] wrote; all numbers are equal bit for bit.
         *
         * @throws org.camssf.InvalidArgument the text is not a saved shot, has another version, or is damaged.
         */
        @JvmStatic
        public fun fromText(text: String): MeasuredShot = SavedShot.read(text)
    }
}

/**
 * k measured shots of one chart with one camera: the input of `SsfCalibrator.solve`.
 *
 * @property chart the chart's table.
 * @property whiteReflectance reflectance of the white frame's target, one number; null for a perfect diffuser.
 * @property files SHA-256 by role and name of further files that the result depends on.
 */
public class MeasuredCapture internal constructor(
    shots: List<MeasuredShot>,
    public val chart: ChartTable,
    public val whiteReflectance: Double?,
    internal val files: Map<String, String> = emptyMap(),
) {
    /** The shots, k of them. */
    public val shots: List<MeasuredShot> = shots.frozen()

    override fun toString(): String = "MeasuredCapture($chart, $shots)"
}
