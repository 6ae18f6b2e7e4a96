package org.camssf.photo.dng

import java.io.File

/**
 * Decodes what it is told on stdin and answers on stdout, for benchmarks that compare with LibRaw in one run.
 *
 * `decode PATH`: opening, directories and samples; `read PATH`: all of [DngReader.read], the file's hash included.
 * The answer is nanoseconds and the sum of the samples.
 */
internal object DecodeServer {
    @JvmStatic
    fun main(arguments: Array<String>) {
        for (line in generateSequence(::readlnOrNull)) {
            val (what, path) = line.split(' ', limit = 2)
            val start = System.nanoTime()
            val samples = DngSource.of(File(path)).use {
                if (what ==
                    "read"
                ) {
                    DngReader.read(it).samples
                } else {
                    decode(it)
                }
            }
            val time = System.nanoTime() - start
            println("$time ${samples.sumOf { it.toLong() and 0xffff }}")
        }
    }

    private fun decode(source: DngSource): ShortArray {
        val tiff = Tiff(source)
        val raw = rawDirectory(tiff)
        val picture = storedPicture(tiff, raw)
        val window = Window(picture.area, linearization(tiff, raw))
        decode(tiff, picture, window, false)
        return window.samples
    }
}
