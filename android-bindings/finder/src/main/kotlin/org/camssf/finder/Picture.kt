package org.camssf.finder

import org.camssf.InvalidArgument
import org.camssf.photo.Mosaic
import java.nio.ByteBuffer

/**
 * One 8-bit plane of a picture, with the strides of Android's `Image.Plane`.
 *
 * Bytes are read from the buffer itself, from its index 0 and independent of its position. The plane keeps no copy.
 *
 * @property bytes values from 0 to 255, unsigned.
 * @property rowStride bytes from one row to the next.
 * @property pixelStride bytes from one pixel to the next in a row.
 */
public class Plane @JvmOverloads constructor(
    public val bytes: ByteBuffer,
    public val rowStride: Int,
    public val pixelStride: Int = 1,
) {
    @JvmOverloads
    public constructor(bytes: ByteArray, rowStride: Int, pixelStride: Int = 1) :
        this(ByteBuffer.wrap(bytes), rowStride, pixelStride)

    override fun toString(): String = "Plane(rowStride=$rowStride, pixelStride=$pixelStride)"

    /**
     * Copies the first `count` pixels of row y; `reader` is a duplicate of this plane's buffer, so its position may
     * change.
     */
    internal fun row(reader: ByteBuffer, y: Int, count: Int, into: ByteArray) {
        if (pixelStride == 1) {
            reader.position(y * rowStride)
            reader.get(into, 0, count)
        } else {
            var at = y * rowStride
            for (x in 0 until count) {
                into[x] = reader.get(at)
                at += pixelStride
            }
        }
    }

    internal fun check(width: Int, height: Int) {
        val last = (height - 1L) * rowStride + (width - 1L) * pixelStride
        if (rowStride < 0 || pixelStride < 1 || last >= bytes.limit()) {
            throw InvalidArgument(
                "A plane of ${bytes.limit()} bytes, $rowStride a row and $pixelStride a pixel, is no picture of " +
                    "$width × $height px.",
                "Give the plane with the strides that its image has.",
            )
        }
    }
}

/** The data that a picture was made from. */
internal sealed class Source {
    /** One plane of luma, three of red, green and blue, or three of y, u and v. */
    class Bytes(val planes: List<Plane>, val yuv: Boolean) : Source()

    class Light(val planes: List<FloatArray>, val rowStride: Int) : Source()

    class Raw(val mosaic: Mosaic) : Source()
}

/**
 * A picture to be searched.
 *
 * It refers to the data that it was made from, and these are read when it is searched. For a preview: pass the
 * planes, search, then close the image.
 *
 * @property width px.
 * @property height px.
 */
public class Picture private constructor(
    public val width: Int,
    public val height: Int,
    internal val source: Source,
) {
    override fun toString(): String = "Picture($width × $height)"

    public companion object {
        private val smallest get() = FinderFile.limits.smallest

        /**
         * A picture of luma alone, 8 bits as for a display. Without colours, a chart in uneven light is found less
         * often.
         *
         * @throws InvalidArgument the picture is too small, or the plane is too short.
         */
        @JvmStatic
        public fun luma(plane: Plane, width: Int, height: Int): Picture = bytes(width, height, false, plane)

        /**
         * A picture in `YUV_420_888`: u and v have half the resolution along both axes. BT.601, full range, as
         * cameras give it.
         *
         * @throws InvalidArgument the picture is too small, or a plane is too short.
         */
        @JvmStatic
        public fun yuv(y: Plane, u: Plane, v: Plane, width: Int, height: Int): Picture =
            bytes(width, height, true, y, u, v)

        /**
         * A picture of red, green and blue, 8 bits as for a display, for example three planes over the bytes of a
         * bitmap.
         *
         * @throws InvalidArgument the picture is too small, or a plane is too short.
         */
        @JvmStatic
        public fun rgb(red: Plane, green: Plane, blue: Plane, width: Int, height: Int): Picture =
            bytes(width, height, false, red, green, blue)

        /**
         * A picture of linear light, in any unit in which black is 0: one plane, or red, green and blue.
         *
         * @param rowStride numbers from one row to the next.
         * @throws InvalidArgument the picture is too small, or the planes do not fit its size.
         */
        @JvmStatic
        @JvmOverloads
        public fun light(planes: List<FloatArray>, width: Int, height: Int, rowStride: Int = width): Picture {
            check(width, height)
            val last = (height - 1L) * rowStride + width
            if (planes.size !in setOf(1, 3) || rowStride < width || planes.any { it.size < last }) {
                throw InvalidArgument(
                    "${planes.size} planes, $rowStride numbers a row, are no picture of $width × $height px.",
                    "Give one plane, or red, green and blue, of $last numbers or more.",
                )
            }
            return Picture(width, height, Source.Light(planes, rowStride))
        }

        /**
         * The part of a photo that a mosaic holds; found points are px of the active area.
         *
         * @throws InvalidArgument the part is too small.
         */
        @JvmStatic
        public fun of(mosaic: Mosaic): Picture {
            val region = mosaic.region
            check((region.right - region.left - 1) / 2, (region.bottom - region.top - 1) / 2)
            return Picture(mosaic.width, mosaic.height, Source.Raw(mosaic))
        }

        private fun bytes(width: Int, height: Int, yuv: Boolean, vararg planes: Plane): Picture {
            check(width, height)
            for ((i, plane) in planes.withIndex()) {
                if (yuv && i > 0) plane.check((width + 1) / 2, (height + 1) / 2) else plane.check(width, height)
            }
            return Picture(width, height, Source.Bytes(planes.toList(), yuv))
        }

        private fun check(width: Int, height: Int) {
            if (minOf(width, height) < smallest) {
                throw InvalidArgument(
                    "A picture of $width × $height px is too small to find a chart in.",
                    "Give one of $smallest px a side at least, better 640 × 480; of a mosaic, colour filter cells count.",
                )
            }
        }
    }
}
