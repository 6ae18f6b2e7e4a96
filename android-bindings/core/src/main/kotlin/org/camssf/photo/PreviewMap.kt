package org.camssf.photo

import org.camssf.InvalidArgument
import kotlin.math.max
import kotlin.math.min

/** How a picture of one shape fills a view of another; in every case about the middle. */
public enum class PreviewFit {
    /** Both axes by their own factor, so that the corners meet: a stream scaled by itself, a stretched view. */
    STRETCH,

    /** All of the picture is seen, with empty stripes beside it: `FIT_CENTER` of CameraX's PreviewView. */
    INSIDE,

    /** The whole view is filled, and the picture's ends are cut: `FILL_CENTER`, PreviewView's own choice. */
    FILL,
}

/**
 * Where a picture lies in the mosaic, in places as [Point] counts them, but of borders: a crop of the whole active area
 * of w × h samples goes from -0.5 to w - 0.5. [of] takes samples.
 *
 * @property left first border, px of the active area.
 * @property top first border.
 * @property right last border.
 * @property bottom last border.
 * @throws InvalidArgument it is empty, or a number is not finite.
 */
public data class PreviewCrop(
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

    /** px across. */
    public val width: Double get() = right - left

    /** px down. */
    public val height: Double get() = bottom - top

    /**
     * The part of this crop that a stream of another shape shows. A camera cuts each stream out of its crop region's
     * middle, as large as its shape allows: a stream of 16 : 9 lacks top and bottom of a sensor of 4 : 3.
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
     * The middle of this crop, magnified: `CONTROL_ZOOM_RATIO`.
     *
     * @param ratio 1 or more shows less, 0.5 twice as much.
     */
    public fun zoomed(ratio: Double): PreviewCrop {
        if (!(ratio > 0 && ratio.isFinite())) throw InvalidArgument("A zoom of $ratio.", "Give a ratio above 0.")
        val x = width * (1 - 1 / ratio) / 2
        val y = height * (1 - 1 / ratio) / 2
        return PreviewCrop(left + x, top + y, right - x, bottom - y)
    }

    public companion object {
        /** Of samples: the active array, a DNG's DefaultCrop (its origin and size), a crop region. */
        @JvmStatic
        public fun of(samples: Region): PreviewCrop =
            PreviewCrop(samples.left - 0.5, samples.top - 0.5, samples.right - 0.5, samples.bottom - 0.5)

        /** Of the whole active area. */
        @JvmStatic
        public fun of(mosaic: Mosaic): PreviewCrop = of(Region(0, 0, mosaic.width, mosaic.height))
    }
}

/**
 * The way from a preview to the mosaic and back: a part of the active area is cut out, turned clockwise by [rotation],
 * exchanged left and right where [mirrored], and scaled into a view. Nothing is rounded: there and back again is the same
 * place to 1e-9 px. Safe to pass between threads.
 *
 * Two are made, and the way from one to the other leads over the mosaic: [ofView] for what a finger taps, [ofPicture]
 * for the frame of an `ImageReader` or of CameraX's `ImageAnalysis`, which is as the sensor lies, in pixels.
 *
 * It is exact where the camera only cuts and scales. Where it straightens the lens' distortion in the preview, which it
 * never does in RAW, a place is off by as much: camssf moves rough corners to the printed borders all the same.
 *
 * @property crop the part of the active area that is seen, before it is turned.
 * @property rotation 0, 90, 180 or 270: by how many degrees clockwise the sensor's picture is turned to be seen upright.
 * @property mirrored whether left and right of the turned picture are exchanged, as front cameras' previews are.
 */
public class PreviewMap private constructor(
    public val crop: PreviewCrop,
    public val rotation: Int,
    public val mirrored: Boolean,
    private val forth: DoubleArray,
) {
    private val back = inverse(forth)

    /** The place in the view, or in the picture, of a place in the mosaic. */
    public fun fromMosaic(place: Point): Point = map(forth, place)

    /** The place in the mosaic of a place in the view, or in the picture. */
    public fun toMosaic(place: Point): Point = map(back, place)

    /** Each of the four; their names stay, since they are the chart's. */
    public fun fromMosaic(corners: Corners): Corners = corners.each { map(forth, it) }

    /** Each of the four; their names stay, since they are the chart's. Of taps in any order: [Corners.around]. */
    public fun toMosaic(corners: Corners): Corners = corners.each { map(back, it) }

    /** px of the view a px of the mosaic, the mean of both axes where they differ. */
    public val scale: Double
        get() {
            val x = Math.hypot(forth[0], forth[3])
            val y = Math.hypot(forth[1], forth[4])
            return (x + y) / 2
        }

    public companion object {
        /**
         * To a view, in its own coordinates: 0 is the view's left or top border, as `MotionEvent` counts.
         *
         * @param crop the part of the active area that the view's stream shows: [PreviewCrop.of] the active array,
         *   `zoomed`, then `shapedAs` the stream.
         * @param rotation degrees clockwise: 0, 90, 180 or 270. [rotationOf] computes it.
         * @param mirrored whether the view exchanges left and right: of a front camera's preview it does.
         * @param width of the view, px.
         * @param height of the view, px.
         * @param fit how the turned picture fills it.
         * @throws InvalidArgument another rotation, or a view without an area.
         */
        @JvmStatic
        @JvmOverloads
        public fun ofView(
            crop: PreviewCrop,
            rotation: Int,
            mirrored: Boolean,
            width: Int,
            height: Int,
            fit: PreviewFit = PreviewFit.FILL,
        ): PreviewMap = of(crop, rotation, mirrored, width, height, fit, 0.0)

        /**
         * To a picture of which the centre of the first pixel is 0, as of a mosaic, and all of which the crop fills.
         *
         * @param crop the part of the active area that the picture shows.
         * @param width of the picture, px.
         * @param height of the picture, px.
         * @param rotation by which it has been turned already; a camera's frames are not.
         * @param mirrored whether it has been mirrored already; a camera's frames are not.
         * @throws InvalidArgument another rotation, or a picture without an area.
         */
        @JvmStatic
        @JvmOverloads
        public fun ofPicture(
            crop: PreviewCrop,
            width: Int,
            height: Int,
            rotation: Int = 0,
            mirrored: Boolean = false,
        ): PreviewMap = of(crop, rotation, mirrored, width, height, PreviewFit.STRETCH, -0.5)

        /**
         * By how much a preview is turned clockwise to be seen upright.
         *
         * @param sensor `SENSOR_ORIENTATION`: 0, 90, 180 or 270.
         * @param display by how many degrees the screen is turned (`Display.getRotation`: ROTATION_90 is 90).
         * @param front whether the camera looks the way the screen does.
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
            // About the middle: cos and sin of quarter turns are whole numbers, so nothing is rounded.
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
