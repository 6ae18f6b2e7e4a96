package org.camssf.finder

import org.camssf.InvalidArgument
import org.camssf.photo.Mosaic
import java.nio.ByteBuffer

/**
 * One 8-bit plane of a picture, as Android's `Image.Plane` has it. Bytes are read where they stand, from the buffer's
 * beginning, whatever its position; nothing is kept.
 *
 * @property bytes 0 to 255, unsigned.
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

    /** Row y's first `count` pixels; `reader` is this plane's buffer, whose position is free to move. */
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

/** What a picture was made of. */
internal sealed class Source {
    /** One plane of luma, three of red, green and blue, or y, u and v. */
    class Bytes(val planes: List<Plane>, val yuv: Boolean) : Source()

    class Light(val planes: List<FloatArray>, val rowStride: Int) : Source()

    class Raw(val mosaic: Mosaic) : Source()
}

/**
 * A picture to be searched. It holds on to what it was made of and reads it when it is searched: give a preview's planes,
 * search, then close the image.
 *
 * @property width px.
 * @property height px.
 */
public class Picture private constructor(
    public val width: Int,
    public val height: Int,
    internal val source: Source,
) {
    public companion object {
        private const val SMALLEST = 32

        /** Brightness alone, 8 bits as on a display. Without colours a chart in uneven light is found less often. */
        @JvmStatic
        public fun luma(plane: Plane, width: Int, height: Int): Picture = bytes(width, height, false, plane)

        /** `YUV_420_888`: u and v have half as many pixels a side. BT.601, full range, as cameras give it. */
        @JvmStatic
        public fun yuv(y: Plane, u: Plane, v: Plane, width: Int, height: Int): Picture =
            bytes(width, height, true, y, u, v)

        /** Red, green and blue, 8 bits as on a display, for example three planes over the bytes of a bitmap. */
        @JvmStatic
        public fun rgb(red: Plane, green: Plane, blue: Plane, width: Int, height: Int): Picture =
            bytes(width, height, false, red, green, blue)

        /**
         * Linear light, in any unit in which black is 0: one plane, or red, green and blue.
         *
         * @param rowStride numbers from one row to the next.
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

        /** What a mosaic holds of its photo; found points are px of the active area, as everywhere. */
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
            if (minOf(width, height) < SMALLEST) {
                throw InvalidArgument(
                    "A picture of $width × $height px is too small to find a chart in.",
                    "Give one of $SMALLEST px a side at least, better 640 × 480; of a mosaic, colour filter cells count.",
                )
            }
        }
    }
}
