package org.camssf.golden

import org.camssf.CalibrationException
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import java.io.File

/**
 * What becomes of the files that are named on stdin, a line each: of a DNG "read", levels and the samples' SHA-256
 * (as golden cases give it); of a table, named behind "lamp" or "chart" and a tab, "read" and the values' mean
 * square; or the error's code and words. tests/kotlin/test_kotlin.py holds Python's readers beside it.
 */
internal object Codes {
    @JvmStatic
    fun main(arguments: Array<String>) {
        for (line in generateSequence(::readlnOrNull)) {
            val file = File(line.substringAfter('\t'))
            println(
                outcome {
                    when (line.substringBefore('\t', "")) {
                        "lamp" -> table(Lamp.parse(file.name, file.readBytes()).sharedValues)
                        "chart" -> table(ChartTable.parse(file.name, file.readBytes()).sharedValues)
                        else -> photo(file)
                    }
                },
            )
        }
    }

    private fun outcome(read: () -> String): String = try {
        read()
    } catch (error: CalibrationException) {
        "${error.code}\t${error.message.replace(Regex("[\r\n\t]"), " ")}"
    }

    private fun table(values: DoubleArray): String = "read\t${values.sumOf { it * it } / values.size}"

    private fun photo(file: File): String {
        val mosaic = DngSource.of(file).use { DngReader.read(it) }
        val sensor = mosaic.sensor
        val hash = sha256(bytes(mosaic.samples))
        return (listOf("read", hash, sensor.cfa, sensor.white) + sensor.sharedBlack.toList()).joinToString("\t")
    }
}
