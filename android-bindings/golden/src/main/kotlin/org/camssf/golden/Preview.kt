package org.camssf.golden

import org.camssf.colour.RawPixels
import org.camssf.colour.RelativeSignals
import org.camssf.colour.Space
import org.camssf.colour.Standardiser
import org.camssf.photo.Mosaic
import org.camssf.photo.Region
import java.io.File
import kotlin.system.exitProcess

/**
 * How long colours take: the folder of the golden cases, a case of the stage colour, samples a side of the mosaic, runs
 * (`python -m benchmarks speed`). One line: milliseconds to the first colour in this process; to make the
 * standardiser and its tables, for the colour of one surface, to read the mosaic's cells and to give their XYZ and Lab,
 * medians of the runs after as many to warm up; and the pixels.
 */
internal object Preview {
    @JvmStatic
    fun main(arguments: Array<String>) {
        val files = GoldenFiles.of(File(arguments[0]))
        val (side, runs) = arguments.drop(2).map { it.toInt() }
        val forms = Forms(files)
        val colours = Colours(Photos(files))
        val case = forms.case(arguments[1])
        lateinit var made: Standardiser
        val surface = RelativeSignals(doubleArrayOf(0.4, 0.3, 0.2), DoubleArray(3) { 0.002 })
        val first = timed { made = colours.standardiser(case).also { it.colourOf(surface) } }
        val making = median(runs / 20) { made = colours.standardiser(case).also { it.standardise(FloatArray(3)) } }
        val one = median(runs) { made.colourOf(surface) }
        val samples = ShortArray(side * side) { (600 + it * 7919L % 9000).toShort() }
        val region = Region(0, 0, side, side)
        val sensor = Mosaic.Sensor("RGGB", DoubleArray(4) { 512.0 }, 16383.0)
        val photo = Mosaic(Mosaic.Origin("preview"), side, side, region, samples, sensor)
        val pixels = RawPixels.of(region)
        val raw = FloatArray(3 * pixels.rows * pixels.columns)
        val into = FloatArray(raw.size)
        val reading = median(runs) { pixels.read(photo, raw) }
        val xyz = median(runs) { made.standardise(raw, into, Space.XYZ) }
        val lab = median(runs) { made.standardise(raw, into, Space.LAB) }
        if (!into.all { it.isFinite() }) exitProcess(1)
        println("$first $making $one $reading $xyz $lab ${raw.size / 3}")
    }

    private fun median(runs: Int, work: () -> Unit): Double {
        repeat(runs) { work() }
        return DoubleArray(runs) { timed(work) }.sorted()[runs / 2]
    }

    /** Milliseconds. */
    private fun timed(work: () -> Unit): Double {
        val start = System.nanoTime()
        work()
        return (System.nanoTime() - start) / 1e6
    }
}
