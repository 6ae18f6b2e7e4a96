package org.camssf.golden

import org.camssf.finder.ChartFinder
import org.camssf.finder.Found
import org.camssf.finder.Picture
import org.camssf.finder.Plane
import java.io.File

/**
 * Charts in raw pictures, one process for all, for `python -m benchmarks finder`: arguments are the rounds and then files
 * `name.WIDTHxHEIGHT.rgb` (red, green, blue of each pixel). For each file a line: name, findings, kind, mirrored, seen,
 * confidence, eight numbers of corners; then milliseconds, the least and the median of the rounds.
 */
internal object Finding {
    @JvmStatic
    fun main(arguments: Array<String>) {
        val rounds = arguments[0].toInt()
        val finder = ChartFinder()
        val pictures = arguments.drop(1).map { File(it) }.associateWith { picture(it) }
        // The compiler learns on all of them first.
        repeat(if (rounds > 1) 20 else 0) { pictures.values.forEach { finder.find(it) } }
        for ((file, picture) in pictures) {
            var found: Found? = null
            val times = DoubleArray(rounds) {
                val start = System.nanoTime()
                found = finder.find(picture)
                (System.nanoTime() - start) / 1e6
            }
            times.sort()
            println(line(file.name, found!!, listOf(times[0], times[rounds / 2])))
        }
    }

    private fun line(name: String, found: Found, times: List<Double>): String {
        val seen = found.candidate
        val chart = if (seen == null) {
            listOf("none", false, 0, 0.0) + List(8) { 0.0 }
        } else {
            listOf(seen.kind.layouts[0], seen.mirrored, seen.seen, seen.confidence) + seen.corners.toArray().toList()
        }
        val findings = found.findings.joinToString("+") { it.name.lowercase() }
        return (listOf(name, findings) + chart + times).joinToString("\t")
    }

    private fun picture(file: File): Picture {
        val (width, height) = file.name.split('.').dropLast(1).last().split('x').map { it.toInt() }
        val all = file.readBytes()
        val planes = List(3) { c -> Plane(ByteArray(width * height) { all[3 * it + c] }, width) }
        return Picture.rgb(planes[0], planes[1], planes[2], width, height)
    }
}
