package org.camssf.golden

import org.camssf.CalibrationException
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import java.io.File
import java.security.MessageDigest

/**
 * What becomes of the DNGs that are named on stdin, a line each: "read", levels and the samples' SHA-256 (as golden cases give
 * it), or the error's code and words. tests/test_kotlin.py holds Python's reader beside it on damaged files.
 */
internal object Codes {
    @JvmStatic
    fun main(arguments: Array<String>) {
        for (path in generateSequence(::readlnOrNull)) println(outcome(File(path)))
    }

    private fun outcome(file: File): String = try {
        val mosaic = DngSource.of(file).use { DngReader.read(it) }
        val bytes = ByteArray(2 * mosaic.samples.size)
        for ((i, value) in mosaic.samples.withIndex()) {
            bytes[2 * i] = value.toByte()
            bytes[2 * i + 1] = (value.toInt() shr 8).toByte()
        }
        val digest = MessageDigest.getInstance("SHA-256").digest(bytes)
        val hash = digest.joinToString("") { (it.toInt() and 0xff).toString(16).padStart(2, '0') }
        val sensor = mosaic.sensor
        (listOf("read", hash, sensor.cfa, sensor.white) + sensor.black.toList()).joinToString("\t")
    } catch (error: CalibrationException) {
        "${error.code}\t${error.message.replace(Regex("[\r\n\t]"), " ")}"
    }
}
