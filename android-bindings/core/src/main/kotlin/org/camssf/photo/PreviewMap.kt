package org.camssf.photo

import org.camssf.InvalidArgument
import kotlin.math.max
import kotlin.math.min

/** How a picture fills a view of another aspect ratio; always centred. */
public enum class PreviewFit {
    /** Each axis has its own scale, so the corners coincide: a stream scaled separately, a stretched view. */
    STRETCH,

    /** The whole picture is visible, with empty margins: `FIT_CENTER` of CameraX's PreviewView. */
    INSIDE,

    /** The whole view is filled, and the picture is cropped: `FILL_CENTER`, PreviewView's default. */
    FILL,
}

/**
 * The part of the mosaic that a picture shows. The coordinates are those of [Point], but they denote borders: a crop
 * of the whole active area of w × h samples extends from -0.5 to w - 0.5. [of] converts from samples.
 *
 * @property left first border, px of the active area.
 * @property top first border.
 * @property right last border.
 * @property bottom last border.
 * @throws InvalidArgument the crop is empty, or a number is not finite.
 */
public class PreviewCrop(
    public val left: Double,
    public val top: Double,
    public val right: Double,
    public val bottom: Double,
) {
    init {
        if (!listOf(left, top, right, bottom).all { it.isFinite() } || right <= left || bottom <= top) {
            throw InvalidArgument(
                "A crop from ($left, $top) to ($right, $bottom) is empty.",
                "Give the part of the active area that the picture shows, left before right and top before bottom.",
            )
        }
    }

    private fun parts() = listOf(left, top, right, bottom)

    override fun equals(other: Any?): Boolean = other is PreviewCrop && parts() == other.parts()

    override fun hashCode(): Int = parts().hashCode()

    override fun toString(): String = "PreviewCrop(left=$left, top=$top, right=$right, bottom=$bottom)"

    /** Width, px. */
    public val width: Double get() = right - left

    /** Height, px. */
    public val height: Double get() = bottom - top

    /**
     * The part of this crop that a stream of another aspect ratio shows. A camera takes each stream from the centre
     * of its crop region, as large as the aspect ratio allows: a 16 : 9 stream lacks the top and bottom of a 4 : 3
     * sensor.
     *
     * @param width of the stream, px.
     * @param height of the stream, px.
     */
    public fun shapedAs(width: Int, height: Int): PreviewCrop {
        if (width < 1 || height < 1) throw InvalidArgument("A stream of $width × $height px.", "Give its size.")
        val scale = min(this.width / width, this.height / height)
        val x = (this.width - scale * width) / 2
        val y = (this.height - scale * height) / 2
        return PreviewCrop(left + x, top + y, right - x, bottom - y)
    }

    /**
     * The central part of this crop at a zoom ratio (`CONTROL_ZOOM_RATIO`).
     *
     * @param ratio above 0; 2 shows half the width and height, 0.5 twice as much.
     */
    public fun zoomed(ratio: Double): PreviewCrop {
        if (!(ratio > 0 && ratio.isFinite())) throw InvalidArgument("A zoom of $ratio.", "Give a ratio above 0.")
        val x = width * (1 - 1 / ratio) / 2
        val y = height * (1 - 1 / ratio) / 2
        return PreviewCrop(left + x, top + y, right - x, bottom - y)
    }

    public companion object {
        /**
         * The crop of a rectangle of samples: the active array, a DNG's DefaultCrop (its origin and size), a crop
         * region.
         */
        @JvmStatic
        public fun of(samples: Region): PreviewCrop =
            PreviewCrop(samples.left - 0.5, samples.top - 0.5, samples.right - 0.5, samples.bottom - 0.5)

        /** The crop of the whole active area. */
        @JvmStatic
        public fun of(mosaic: Mosaic): PreviewCrop = of(Region(0, 0, mosaic.width, mosaic.height))
    }
}

/**
 * Maps points between a preview and the mosaic. A part of the active area is cropped, rotated clockwise by
 * [rotation], exchanged left and right if [mirrored], and scaled to a view. Nothing is rounded: mapping there and
 * back returns the same point to 1e-9 px. Safe to pass between threads.
 *
 * There are two kinds; to map between them, go through the mosaic. [ofView] is for touch positions. [ofPicture] is
 * for the frames of an `ImageReader` or of CameraX's `ImageAnalysis`, which have the sensor's orientation and are
 * counted in pixels.
 *
 * The map is exact if the camera only crops and scales. If the camera corrects lens distortion in the preview, which
 * it never does in RAW, points are off by that correction; camssf still moves rough corners to the printed borders.
 *
 * @property crop the visible part of the active area, before rotation.
 * @property rotation clockwise rotation of the sensor's picture to upright, degrees: 0, 90, 180 or 270.
 * @property mirrored true if left and right of the rotated picture are exchanged, as in front cameras' previews.
 */
public class PreviewMap private constructor(
    public val crop: PreviewCrop,
    public val rotation: Int,
    public val mirrored: Boolean,
    private val forth: DoubleArray,
) {
    private val back = inverse(forth)

    override fun toString(): String = "PreviewMap(crop=$crop, rotation=$rotation, mirrored=$mirrored)"

    /** Maps a point of the mosaic to the view or picture. */
    public fun fromMosaic(place: Point): Point = map(forth, place)

    /** Maps a point of the view or picture to the mosaic. */
    public fun toMosaic(place: Point): Point = map(back, place)

    /** Maps each corner to the view or picture; their names stay, because they are the chart's. */
    public fun fromMosaic(corners: Corners): Corners = corners.each { map(forth, it) }

    /**
     * Maps each corner to the mosaic; their names stay, because they are the chart's. For taps in any order use
     * [Corners.around].
     */
    public fun toMosaic(corners: Corners): Corners = corners.each { map(back, it) }

    /** Scale, view px per mosaic px; the mean of both axes if they differ. */
    public val scale: Double
        get() {
            val x = Math.hypot(forth[0], forth[3])
            val y = Math.hypot(forth[1], forth[4])
            return (x + y) / 2
        }

    public companion object {
        /** As the other `ofView`, of a view that the picture fills ([PreviewFit.FILL]). */
        @JvmStatic
        public fun ofView(crop: PreviewCrop, rotation: Int, mirrored: Boolean, width: Int, height: Int): PreviewMap =
            ofView(crop, rotation, mirrored, width, height, PreviewFit.FILL)

        /**
         * Creates a map to a view. Its coordinates are 0 at the view's left and top border, as in `MotionEvent`.
         *
         * @param crop the part of the active area that the view's stream shows: [PreviewCrop.of] the active array,
         *   `zoomed`, then `shapedAs` the stream.
         * @param rotation degrees clockwise: 0, 90, 180 or 270; see [rotationOf].
         * @param mirrored true if the view exchanges left and right, as a front camera's preview does.
         * @param width of the view, px.
         * @param height of the view, px.
         * @param fit how the rotated picture fills the view.
         * @throws InvalidArgument another rotation, or a view without an area.
         */
        @JvmStatic
        public fun ofView(
            crop: PreviewCrop,
            rotation: Int,
            mirrored: Boolean,
            width: Int,
            height: Int,
            fit: PreviewFit,
        ): PreviewMap = of(crop, rotation, mirrored, width, height, fit, 0.0)

        /** As the other `ofPicture`, of a camera's frame: neither rotated nor mirrored. */
        @JvmStatic
        public fun ofPicture(crop: PreviewCrop, width: Int, height: Int): PreviewMap =
            ofPicture(crop, width, height, 0, false)

        /**
         * Creates a map to a picture that shows exactly the crop. The centre of its first pixel is 0, as in a mosaic.
         *
         * @param crop the part of the active area that the picture shows.
         * @param width of the picture, px.
         * @param height of the picture, px.
         * @param rotation rotation already applied to the picture, degrees clockwise; 0 for a camera's frames.
         * @param mirrored true if the picture is already mirrored; false for a camera's frames.
         * @throws InvalidArgument another rotation, or a picture without an area.
         */
        @JvmStatic
        public fun ofPicture(
            crop: PreviewCrop,
            width: Int,
            height: Int,
            rotation: Int,
            mirrored: Boolean,
        ): PreviewMap = of(crop, rotation, mirrored, width, height, PreviewFit.STRETCH, -0.5)

        /**
         * Clockwise rotation of a preview to upright, degrees.
         *
         * @param sensor `SENSOR_ORIENTATION`: 0, 90, 180 or 270.
         * @param display rotation of the screen, degrees (`Display.getRotation`: ROTATION_90 is 90).
         * @param front true if the camera faces the same direction as the screen.
         */
        @JvmStatic
        public fun rotationOf(sensor: Int, display: Int, front: Boolean): Int {
            checkRotation(sensor)
            checkRotation(display)
            return (if (front) sensor + display else sensor - display + FULL) % FULL
        }

        private const val FULL = 360

        private fun checkRotation(degrees: Int) {
            if (degrees !in setOf(0, 90, 180, 270)) {
                throw InvalidArgument("A rotation of $degrees degrees.", "Give 0, 90, 180 or 270, clockwise.")
            }
        }

        /** @param origin the coordinate of the view's left and top border. */
        private fun of(
            crop: PreviewCrop,
            rotation: Int,
            mirrored: Boolean,
            width: Int,
            height: Int,
            fit: PreviewFit,
            origin: Double,
        ): PreviewMap {
            checkRotation(rotation)
            if (width < 1 || height < 1) {
                throw InvalidArgument("A view of $width × $height px.", "Wait until it has been laid out.")
            }
            // Rotation about the centre: cos and sin of quarter turns are whole numbers, so nothing is rounded.
            val (cos, sin) = listOf(1 to 0, 0 to 1, -1 to 0, 0 to -1)[rotation / 90]
            val (turnedWidth, turnedHeight) =
                if (sin == 0) crop.width to crop.height else crop.height to crop.width
            val (x, y) = width / turnedWidth to height / turnedHeight
            val (across, down) = when (fit) {
                PreviewFit.STRETCH -> x to y
                PreviewFit.INSIDE -> min(x, y).let { it to it }
                PreviewFit.FILL -> max(x, y).let { it to it }
            }
            val side = if (mirrored) -across else across
            val (a, b) = side * cos to -side * sin
            val (c, d) = down * sin to down * cos
            val (middleX, middleY) = (crop.left + crop.right) / 2 to (crop.top + crop.bottom) / 2
            val forth = doubleArrayOf(
                a, b, origin + width / 2.0 - a * middleX - b * middleY,
                c, d, origin + height / 2.0 - c * middleX - d * middleY,
            )
            return PreviewMap(crop, rotation, mirrored, forth)
        }

        private fun map(m: DoubleArray, place: Point): Point =
            Point(m[0] * place.x + m[1] * place.y + m[2], m[3] * place.x + m[4] * place.y + m[5])

        private fun inverse(m: DoubleArray): DoubleArray {
            val determinant = m[0] * m[4] - m[1] * m[3]
            val (a, b) = m[4] / determinant to -m[1] / determinant
            val (c, d) = -m[3] / determinant to m[0] / determinant
            return doubleArrayOf(a, b, -a * m[2] - b * m[5], c, d, -c * m[2] - d * m[5])
        }
    }
}

private fun Corners.each(map: (Point) -> Point) =
    Corners(map(topLeft), map(topRight), map(bottomRight), map(bottomLeft))
