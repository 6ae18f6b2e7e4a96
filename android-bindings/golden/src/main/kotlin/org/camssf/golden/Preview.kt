package org.camssf.golden

import org.camssf.colour.RawPixels
import org.camssf.colour.Space
import org.camssf.photo.Mosaic
import org.camssf.photo.Region
import java.io.File
import kotlin.system.exitProcess
import kotlin.system.measureNanoTime

/**
 * How long colours take: the folder of the golden cases, a case of the stage colour, samples a side of the mosaic, runs
 * (`python -m benchmarks speed`). One line: milliseconds to read the mosaic's cells and to give their Lab, medians of
 * the runs after as many to warm up; and the pixels.
 */
internal object Preview {
    @JvmStatic
    fun main(arguments: Array<String>) {
        val files = GoldenFiles.of(File(arguments[0]))
        val (side, runs) = arguments.drop(2).map { it.toInt() }
        val standardiser = Colours(Photos(files)).standardiser(Forms(files).case(arguments[1]))
        val samples = ShortArray(side * side) { (600 + it * 7919L % 9000).toShort() }
        val region = Region(0, 0, side, side)
        val sensor = Mosaic.Sensor("RGGB", DoubleArray(4) { 512.0 }, 16383.0)
        val photo = Mosaic(Mosaic.Origin("preview"), side, side, region, samples, sensor)
        val pixels = RawPixels.of(region)
        val raw = FloatArray(3 * pixels.rows * pixels.columns)
        val into = FloatArray(raw.size)
        val reading = median(runs) { pixels.read(photo, raw) }
        val lab = median(runs) { standardiser.standardise(raw, into, Space.LAB) }
        if (!into.all { it.isFinite() }) exitProcess(1)
        println("$reading $lab ${raw.size / 3}")
    }

    private fun median(runs: Int, work: () -> Unit): Double {
        repeat(runs) { work() }
        return DoubleArray(runs) { measureNanoTime(work) / 1e6 }.sorted()[runs / 2]
    }
}
