package org.camssf.camerax

import androidx.camera.core.ImageInfo
import androidx.camera.core.ImageProxy
import org.camssf.photo.Corners
import org.camssf.photo.Point
import org.mockito.Mockito.mock
import org.mockito.Mockito.`when`
import java.nio.ByteBuffer
import kotlin.math.roundToInt

/** A preview frame of a Classic with these corners, as CameraX hands it to an analyzer: YUV_420_888 in padded rows. */
internal class Painted(corners: Corners?) {
    private val luma = ByteArray(STRIDE * HEIGHT)
    private val blue = ByteArray(STRIDE * HEIGHT / 2)
    private val red = ByteArray(STRIDE * HEIGHT / 2)

    init {
        for (y in 0 until HEIGHT) {
            for (x in 0 until WIDTH) {
                val (r, g, b) = corners?.let { colour(place(it, x.toDouble(), y.toDouble())) } ?: WALL
                luma[STRIDE * y + x] = (0.299 * r + 0.587 * g + 0.114 * b).roundToInt().toByte()
                if (x % 2 != 0 || y % 2 != 0) continue
                val at = STRIDE * (y / 2) + x
                blue[at] = (128 - 0.168736 * r - 0.331264 * g + 0.5 * b).roundToInt().toByte()
                red[at] = (128 + 0.5 * r - 0.418688 * g - 0.081312 * b).roundToInt().toByte()
            }
        }
    }

    fun image(time: Long): ImageProxy {
        val planes = listOf(luma to 1, blue to 2, red to 2).map { (bytes, step) ->
            val plane = mock(ImageProxy.PlaneProxy::class.java)
            `when`(plane.buffer).thenReturn(ByteBuffer.wrap(bytes))
            `when`(plane.rowStride).thenReturn(STRIDE)
            `when`(plane.pixelStride).thenReturn(step)
            plane
        }
        val info = mock(ImageInfo::class.java)
        `when`(info.timestamp).thenReturn(time)
        val image = mock(ImageProxy::class.java)
        `when`(image.planes).thenReturn(planes.toTypedArray())
        `when`(image.width).thenReturn(WIDTH)
        `when`(image.height).thenReturn(HEIGHT)
        `when`(image.imageInfo).thenReturn(info)
        return image
    }

    /** The place on the block of patches, 0 to 1 each way: the corners' bilinear map, inverted by Newton's steps. */
    private fun place(corners: Corners, x: Double, y: Double): Pair<Double, Double> {
        val (a, b, c, d) = corners
        var u = 0.5
        var v = 0.5
        repeat(4) {
            fun mix(f: (Point) -> Double) =
                (1 - v) * ((1 - u) * f(a) + u * f(b)) + v * ((1 - u) * f(d) + u * f(c))
            fun alongU(f: (Point) -> Double) = (1 - v) * (f(b) - f(a)) + v * (f(c) - f(d))
            fun alongV(f: (Point) -> Double) = (1 - u) * (f(d) - f(a)) + u * (f(c) - f(b))
            val (dx, dy) = x - mix { it.x } to y - mix { it.y }
            val (xu, xv) = alongU { it.x } to alongV { it.x }
            val (yu, yv) = alongU { it.y } to alongV { it.y }
            val determinant = xu * yv - xv * yu
            u += (dx * yv - dy * xv) / determinant
            v += (dy * xu - dx * yu) / determinant
        }
        return u to v
    }

    private fun colour(place: Pair<Double, Double>): List<Int> {
        // In patch widths: the block ends at the outer borders of its outer patches, 0.12 lie between two of them.
        val (u, v) = place.first * (6 - GAP) to place.second * (4 - GAP)
        if (u < -MARGIN || v < -MARGIN || u > 6 - GAP + MARGIN || v > 4 - GAP + MARGIN) return WALL
        val (column, row) = u.toInt() to v.toInt()
        val onPatch = u >= 0 && v >= 0 && column < 6 && row < 4 && u - column < 1 - GAP && v - row < 1 - GAP
        return if (onPatch) CHART[6 * row + column] else FRAME
    }

    internal companion object {
        const val WIDTH = 640
        const val HEIGHT = 480
        private const val STRIDE = 704
        private const val GAP = 0.12
        private const val MARGIN = 0.25
        private val WALL = listOf(120, 120, 120)
        private val FRAME = listOf(38, 38, 38)

        /** sRGB of the Classic's patches, a fifth darker than on paper. */
        private val CHART = (
            "735244 c29682 627a9d 576c43 8580b1 67bdaa d67e2c 505ba6 c15a63 5e3c6c 9dbc40 e0a32e " +
                "383d96 469449 af363c e7c71f bb5695 0885a1 f3f3f2 c8c8c8 a0a0a0 7a7a79 555555 343434"
            ).split(" ").map { hex -> hex.chunked(2).map { (it.toInt(16) * 0.9).roundToInt() } }
    }
}
