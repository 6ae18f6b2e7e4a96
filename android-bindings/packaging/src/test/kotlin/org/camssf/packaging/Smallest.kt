package org.camssf.packaging

import org.camssf.CalibrationException
import org.camssf.SsfCalibrator
import org.camssf.photo.Capture
import org.camssf.photo.Corners
import org.camssf.photo.PhotoSource
import org.camssf.photo.Shot
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import java.io.File

/** The smallest app that calibrates, for the shrunk jar: `DNG x,y,x,y,x,y,x,y OUTPUT BASIS`. */
internal object Smallest {
    @JvmStatic
    fun main(words: Array<String>) {
        val corners = Corners.of(*words[1].split(",").map { it.toDouble() }.toDoubleArray())
        val capture =
            Capture(Shot(PhotoSource.of(File(words[0])), Lamp.read("D55"), corners), ChartTable.read("classic24"))
        val text = try {
            SsfCalibrator.Builder().basis(words[3]).openBlocking().use { it.calibrateBlocking(capture) }.toJson()
        } catch (error: CalibrationException) {
            "$error"
        }
        File(words[2]).writeText(text)
    }
}
