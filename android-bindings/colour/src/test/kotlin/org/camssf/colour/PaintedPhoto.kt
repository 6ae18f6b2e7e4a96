package org.camssf.colour

import org.camssf.photo.Mosaic
import org.camssf.photo.PhysicalCamera
import org.camssf.photo.Region

/** Photos by the camera of [GoldenResult], lit so that a perfect white gives [WHITE] DN of green. */
internal object PaintedPhoto {
    const val BLACK = 64.0
    const val WHITE = 8000.0
    private val gains = doubleArrayOf(0.55, 1.0, 0.7)

    /** A photo of surfaces whose red, green and blue are parts of white's, without noise. */
    fun of(
        width: Int,
        height: Int,
        cfa: String = "RGGB",
        origin: Mosaic.Origin = origin(),
        corrections: Mosaic.Corrections = Mosaic.Corrections(),
        signal: (x: Int, y: Int, channel: Int) -> Double,
    ): Mosaic {
        val samples = ShortArray(width * height) {
            val channel = "RGB".indexOf(cfa[it / width % 2 * 2 + it % width % 2])
            (BLACK + WHITE * gains[channel] * signal(it % width, it / width, channel)).toInt().toShort()
        }
        val sensor = Mosaic.Sensor(cfa, DoubleArray(4) { BLACK }, 16000.0)
        return Mosaic(origin, width, height, Region(0, 0, width, height), samples, sensor, corrections)
    }

    fun origin(
        name: String = "strip.dng",
        model: String = "phone",
        exposure: Double? = 0.01,
        orientation: Int = 1,
        camera: PhysicalCamera = PhysicalCamera("0", "S-1"),
    ) = Mosaic.Origin(name, "golden", model, exposure, 100.0, orientation, camera = camera)

    /** Colours and edges that differ everywhere. */
    fun varied(x: Int, y: Int, channel: Int): Double = 0.05 + (7 * x + 13 * y + 5 * channel) % 31 / 40.0
}
