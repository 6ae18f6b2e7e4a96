package org.camssf.photo

import org.camssf.frozen
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp

/**
 * One measured shot: small, so that an app may measure right after the photo and solve later.
 *
 * @property lamp its light.
 * @property photo what the chart photo's file says.
 * @property white what the white frame's file says, or null.
 * @property dark what the dark frame's file says, or null.
 * @property pose where the chart lies in the photo.
 * @property means the patch statistics of all frames.
 * @property lensShading what was done about the shading that the file describes.
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
    /** The same under another lamp. */
    internal fun under(lamp: Lamp): MeasuredShot = MeasuredShot(lamp, photo, white, dark, pose, means, lensShading)

    /**
     * The shot as text ("camssf-shot/1"; 13 kB, under a lamp known by kind up to 93), for a file or an activity's saved
     * state: an app may measure right after the photo and solve when it is started again. It holds the photo's name, and
     * the camera's serial number and the time where the file tells them.
     */
    public fun toText(): String = SavedShot.write(this)

    public companion object {
        /**
         * The shot that [toText] wrote, equal to the last bit.
         *
         * @throws org.camssf.InvalidArgument another text, a later version's, or damage.
         */
        @JvmStatic
        public fun fromText(text: String): MeasuredShot = SavedShot.read(text)
    }
}

/**
 * k measured shots of one chart with one camera: what `SsfCalibrator.solve` needs.
 *
 * @property chart the chart's table.
 * @property whiteReflectance of the white frame's card, one number; null for a perfect diffuser.
 */
public class MeasuredCapture internal constructor(
    shots: List<MeasuredShot>,
    public val chart: ChartTable,
    public val whiteReflectance: Double?,
) {
    /** The shots, k of them. */
    public val shots: List<MeasuredShot> = shots.frozen()
}
