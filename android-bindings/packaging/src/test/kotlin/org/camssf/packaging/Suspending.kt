package org.camssf.packaging

import kotlinx.coroutines.runBlocking
import org.camssf.SsfCalibrator
import org.camssf.photo.Capture
import org.camssf.photo.Corners
import org.camssf.photo.PhotoSource
import org.camssf.photo.Shot
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import java.io.File

/** An app's coroutine, for the shrunk jar: `DNG x,y,x,y,x,y,x,y OUTPUT`. */
internal object Suspending {
    @JvmStatic
    fun main(words: Array<String>) {
        val corners = Corners.of(*words[1].split(",").map { it.toDouble() }.toDoubleArray())
        val shot = Shot(PhotoSource.of(File(words[0])), Lamp.read("D55"), corners)
        val capture = Capture(shot, ChartTable.read("classic24"))
        val found = SsfCalibrator.open().use { runBlocking { it.calibrateSuspending(capture) } }
        File(words[2]).writeText(found.toJson())
    }
}
