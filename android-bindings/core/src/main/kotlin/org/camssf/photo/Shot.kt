package org.camssf.photo

import org.camssf.frozen
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp

/** One photo of the chart under one lamp, with its white and dark frames where they exist. Nothing is read before use. */
public class Shot private constructor(
    /** The photo of the chart. */
    public val photo: PhotoSource,
    /** Its light. */
    public val lamp: Lamp,
    private val given: DoubleArray,
    /** The white frame, taken like the photo; all shots of a capture have one, or none. */
    public val white: PhotoSource?,
    /** The dark frame, likewise. */
    public val dark: PhotoSource?,
    /** What is done about the shading that the photo's file describes. */
    public val lensShading: LensShading,
    @Suppress("UNUSED_PARAMETER") unlikeThePublicOnes: Unit,
) {
    /**
     * A shot.
     *
     * @param photo of the chart.
     * @param lamp its light; [Lamp.auto] where nobody knows it.
     * @param corners rough outer corners of the block of patches, see [ChartPose.refine].
     * @param white the white frame, taken like the photo; all shots of a capture have one, or none.
     * @param dark the dark frame, likewise.
     * @param lensShading what is done about the shading that the photo's file describes.
     */
    @JvmOverloads
    public constructor(
        photo: PhotoSource,
        lamp: Lamp,
        corners: Corners,
        white: PhotoSource? = null,
        dark: PhotoSource? = null,
        lensShading: LensShading = LensShading.AS_STORED,
    ) : this(photo, lamp, corners.toArray(), white, dark, lensShading, Unit)

    /**
     * A shot in a light that nobody named ([Lamp.auto]).
     *
     * @param photo of the chart.
     * @param corners rough outer corners of the block of patches, see [ChartPose.refine].
     * @param white the white frame, taken like the photo; all shots of a capture have one, or none.
     * @param dark the dark frame, likewise.
     * @param lensShading what is done about the shading that the photo's file describes.
     */
    @JvmOverloads
    public constructor(
        photo: PhotoSource,
        corners: Corners,
        white: PhotoSource? = null,
        dark: PhotoSource? = null,
        lensShading: LensShading = LensShading.AS_STORED,
    ) : this(photo, Lamp.auto(), corners.toArray(), white, dark, lensShading, Unit)

    /** A shot whose corners (4, 2) are eight numbers x, y; they are copied, and checked when they are used. */
    @Deprecated("Corners are a type: Corners.of(x, y, ...). Goes with the next release.")
    @JvmOverloads
    public constructor(
        photo: PhotoSource,
        lamp: Lamp,
        corners: DoubleArray,
        white: PhotoSource? = null,
        dark: PhotoSource? = null,
        lensShading: LensShading = LensShading.AS_STORED,
    ) : this(photo, lamp, corners.copyOf(), white, dark, lensShading, Unit)

    /**
     * Rough outer corners of the block of patches.
     *
     * @throws org.camssf.InvalidArgument they were given as numbers that are no four points.
     */
    public val outline: Corners get() = Corners.of(*given)

    /** (4, 2) the same as numbers; a copy at each call. */
    @Deprecated("Corners are a type.", ReplaceWith("outline.toArray()"))
    public val corners: DoubleArray get() = given.copyOf()
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
