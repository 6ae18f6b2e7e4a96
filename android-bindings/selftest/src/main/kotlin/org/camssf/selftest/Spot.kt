package org.camssf.selftest

import org.camssf.InvalidArgument
import org.camssf.Recovered
import org.camssf.colour.RawRegion
import org.camssf.colour.Reference
import org.camssf.colour.StandardColour
import org.camssf.colour.Standardiser
import org.camssf.photo.ChartPose
import org.camssf.photo.Corners
import org.camssf.photo.Mosaic
import org.camssf.photo.Point
import org.camssf.photo.Region
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import kotlin.math.roundToInt

/**
 * Computes the standard colour of places in the photo that a camera was calibrated from, relative to the chart's
 * white.
 */
internal class Spot(
    private val mosaic: Mosaic,
    corners: Corners,
    chart: ChartTable,
    found: Recovered,
    lamp: String,
) {
    private val standardiser: Standardiser

    init {
        val patch = ChartPose.refine(mosaic, corners, chart).patches[chart.white]
        val middle = Point(patch.points.sumOf { it.x } / 4, patch.points.sumOf { it.y } / 4)
        val white = RawRegion.measure(mosaic, listOf(around(middle))).single()
        standardiser = Standardiser.of(found, Lamp.read(lamp), Reference(white, WHITE))
    }

    /** The colour of the 12 × 12 samples around a place in the mosaic. */
    fun at(place: Point): StandardColour =
        standardiser.colourOf(RawRegion.measure(mosaic, listOf(around(place))).single())

    private fun around(place: Point): Region {
        val left = (place.x - SIDE / 2).roundToInt()
        val top = (place.y - SIDE / 2).roundToInt()
        if (left < 0 || top < 0 || left + SIDE > mosaic.width || top + SIDE > mosaic.height) {
            throw InvalidArgument("The spot reaches beyond the photo.", "Tap further inside.")
        }
        return Region.ofSize(left, top, width = SIDE, height = SIDE)
    }

    companion object {
        private const val SIDE = 12

        /** Reflectance of a ColorChecker's white patch. */
        private const val WHITE = 0.9

        /** A colour as one line for the screen. */
        fun words(colour: StandardColour): String {
            val (l, a, b) = colour.lab.map { (10 * it).roundToInt() / 10.0 }
            return "L* $l, a* $a, b* $b, relative to the lamp"
        }
    }
}
