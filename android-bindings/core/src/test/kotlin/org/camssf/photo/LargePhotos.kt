package org.camssf.photo

import org.camssf.Recovered
import org.camssf.SsfCalibrator
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import java.io.BufferedOutputStream
import java.io.File
import java.nio.ByteBuffer
import java.nio.ByteOrder
import kotlin.system.exitProcess

/** Photos of a chart that are too large for a small heap, drawn row by row; what a phone writes: one strip, 16 bits. */
internal object LargePhotos {
    private const val BLACK = 512
    private const val WHITE = 16383
    val chart: ChartTable = ChartTable.read("classic24")

    /** Outer corners of the block of patches in a photo of `width` × `height`: 90 % of its width, and upright. */
    fun corners(width: Int, height: Int): Corners {
        val (left, top, right, bottom) = block(width, height)
        return Corners.of(left, top, right, top, right, bottom, left, bottom)
    }

    private fun block(width: Int, height: Int): DoubleArray {
        val layout = chart.layout
        val pitch = 0.9 * width / (layout.columns - 1 + layout.sideX)
        val high = pitch * (layout.rows - 1 + layout.sideY)
        return doubleArrayOf(0.05 * width, (height - high) / 2, 0.95 * width, (height + high) / 2)
    }

    /** A chart on a dark ground, a white card, or a lens cap, each with a little noise. */
    fun write(file: File, kind: String, width: Int, height: Int) {
        val layout = chart.layout
        val (left, top, right, _) = block(width, height)
        val pitch = (right - left) / (layout.columns - 1 + layout.sideX)
        val signals = chart.genericSignals()
        fun signal(x: Int, y: Int): Double {
            if (kind == "dark") return 0.0
            if (kind == "white") return 0.8
            val u = (x - left) / pitch
            val v = (y - top) / pitch
            val inside = u >= 0 && v >= 0 && u % 1 < layout.sideX && v % 1 < layout.sideY
            if (!inside || u >= layout.columns || v >= layout.rows) return 0.02
            val colour = intArrayOf(0, 1, 1, 2)[y % 2 * 2 + x % 2]
            return 0.8 * signals[3 * (v.toInt() * layout.columns + u.toInt()) + colour]
        }
        BufferedOutputStream(file.outputStream(), 1 shl 20).use { out ->
            out.write(head(width, height))
            val row = ByteBuffer.allocate(2 * width).order(ByteOrder.LITTLE_ENDIAN)
            var seed = kind.hashCode()
            val levels = arrayOfNulls<DoubleArray>(2) // of the last even and the last odd row
            val bands = arrayOfNulls<Int>(2)
            for (y in 0 until height) {
                row.clear()
                val v = (y - top) / pitch
                val band = if (v >= 0 && v % 1 < layout.sideY) v.toInt() else -1
                if (bands[y % 2] != band) {
                    levels[y % 2] = DoubleArray(width) { x -> BLACK + (WHITE - BLACK) * signal(x, y) }
                    bands[y % 2] = band
                }
                for (level in levels[y % 2]!!) {
                    seed = seed * 1664525 + 1013904223
                    row.putShort((level + (seed ushr 28)).toInt().toShort())
                }
                out.write(row.array())
            }
        }
    }

    private fun head(width: Int, height: Int): ByteArray {
        val make = "Drawn\u0000\u0000\u0000"
        val entries = listOf(
            intArrayOf(254, 4, 1, 0), intArrayOf(256, 4, 1, width), intArrayOf(257, 4, 1, height),
            intArrayOf(258, 3, 1, 16), intArrayOf(259, 3, 1, 1), intArrayOf(262, 3, 1, 32803),
            intArrayOf(271, 2, 6, 8), intArrayOf(273, 4, 1, HEAD), intArrayOf(274, 3, 1, 1), intArrayOf(277, 3, 1, 1),
            intArrayOf(278, 4, 1, height), intArrayOf(279, 4, 1, 2 * width * height),
            intArrayOf(33421, 3, 2, 0x20002), intArrayOf(33422, 1, 4, 0x02010100), intArrayOf(50706, 1, 4, 0x401),
            intArrayOf(50714, 3, 1, BLACK), intArrayOf(50717, 3, 1, WHITE),
        )
        val buffer = ByteBuffer.allocate(HEAD).order(ByteOrder.LITTLE_ENDIAN)
        buffer.put("II*\u0000".toByteArray()).putInt(16).put(make.toByteArray()).putShort(entries.size.toShort())
        for ((tag, kind, count, value) in entries) {
            buffer.putShort(tag.toShort()).putShort(kind.toShort()).putInt(count).putInt(value)
        }
        buffer.putInt(0)
        return buffer.array()
    }

    private const val HEAD = 512
    const val BY_REGION = "--by-region"

    /** A shot of files that [write] made: chart, or chart, white and dark. */
    fun shot(files: List<File>, width: Int, height: Int, byRegion: Boolean = false): Shot {
        val sources = files.map { file ->
            val source = PhotoSource.of(file)
            if (byRegion) PhotoSource { source.read(it) } else source // as Camera2's frames are
        }
        return Shot(sources[0], Lamp.read("E"), corners(width, height), sources.getOrNull(1), sources.getOrNull(2))
    }

    /** `[--by-region] width height chart [white dark]`: calibrates, and prints what came of it. */
    @JvmStatic
    fun main(arguments: Array<String>) {
        val words = arguments.filter { it != BY_REGION }
        val (width, height) = words.take(2).map { it.toInt() }
        val shot = shot(words.drop(2).map { File(it) }, width, height, BY_REGION in arguments)
        SsfCalibrator.openBlocking().use { calibrator ->
            val start = System.nanoTime()
            val found = calibrator.calibrateBlocking(Capture(shot, chart))
            val memory = Runtime.getRuntime().maxMemory() shr 20
            println("${found.verdict.outcome} of $memory MB in ${(System.nanoTime() - start) / 1_000_000} ms")
            found.verdict.reasons.forEach { println("${it.code}: ${it.message}") }
            if (found is Recovered) println(found.capture.shots[0].means.chart.sharedMean.joinToString())
            exitProcess(if (found is Recovered) 0 else 1)
        }
    }
}
