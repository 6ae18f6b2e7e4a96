package org.camssf.packaging

import kotlinx.coroutines.runBlocking
import org.camssf.Recovered
import org.camssf.SsfCalibrator
import org.camssf.colour.LightWatch
import org.camssf.colour.RawPixels
import org.camssf.colour.RawRegion
import org.camssf.colour.Reference
import org.camssf.colour.Standardiser
import org.camssf.photo.Capture
import org.camssf.photo.Corners
import org.camssf.photo.PhotoSource
import org.camssf.photo.Region
import org.camssf.photo.Shot
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import java.io.File
import kotlin.math.abs

/** An app's coroutine and its colours, for the shrunk jar: `DNG x,y,x,y,x,y,x,y OUTPUT`. */
internal object Suspending {
    @JvmStatic
    fun main(words: Array<String>) {
        val corners = Corners.of(*words[1].split(",").map { it.toDouble() }.toDoubleArray())
        val shot = Shot(PhotoSource.of(File(words[0])), Lamp.read("D55"), corners)
        val capture = Capture(shot, ChartTable.read("classic24"))
        val found = runBlocking { SsfCalibrator.open().use { it.calibrate(capture) } }
        File(words[2]).writeText(found.toJson())
        if (found is Recovered) colours(found, File(words[0]))
    }

    /** The chart's own white beside itself, in a watched light, and a preview of it. */
    private fun colours(found: Recovered, photo: File) {
        val mosaic = PhotoSource.of(photo).read(null)
        val area = Region.ofSize(left = 22, top = 94, width = 16, height = 16)
        val (white, same) = RawRegion.measure(mosaic, listOf(area, area))
        val standardiser = Standardiser.of(found, Lamp.read("D55"), Reference(white))
        val live = LightWatch(standardiser).look(listOf(same), white)
        val lightness = live.colours.single().lab[0]
        val pixels = standardiser.standardise(mosaic, RawPixels.of(area))
        check(live.guidance.isEmpty()) { "${live.guidance}" }
        check(abs(lightness - 100) < 0.25 && pixels.all { it.isFinite() }) { "L* of white is $lightness" }
    }
}
