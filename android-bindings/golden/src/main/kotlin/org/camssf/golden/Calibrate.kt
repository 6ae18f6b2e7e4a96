package org.camssf.golden

import org.camssf.CalibrationException
import org.camssf.CalibrationOptions
import org.camssf.Refused
import org.camssf.SavedResult
import org.camssf.SsfCalibrator
import org.camssf.photo.Capture
import org.camssf.photo.Corners
import org.camssf.photo.LensShading
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.MeasuredShot
import org.camssf.photo.PhotoSource
import org.camssf.photo.Shot
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import java.io.Closeable
import java.io.File
import kotlin.system.exitProcess

/**
 * The library as a command, for comparison with Python's: `calibrate photo.dng ... --lamp D55 ... --corners x,y,... ...
 * -o result.json`, options repeated for several shots in the photos' order. With `--write capture` it only measures: each
 * shot by itself, saved and restored as an app would, then joined.
 *
 * With `--serve` alone, every line on standard input holds such arguments, parted by tabs; the answer is a line with the
 * status (0, 2 for a wrong call, 5 for a refusal), the seconds it took, and those of `toJson`. Models stay open between
 * them. A line `--open BASIS` opens and closes the models of a basis; its answer holds the seconds of opening.
 */
public class Calibrate private constructor() : Closeable {
    private val calibrators = HashMap<String, SsfCalibrator>()
    private var toJson = 0L

    private fun serve(words: List<String>): String {
        val start = System.nanoTime()
        if (words[0] == "--open") {
            return SsfCalibrator.Builder().basis(words[1]).openBlocking().use {
                "0 ${(System.nanoTime() - start) / NANO}"
            }
        }
        val status = run(words)
        return "$status ${(System.nanoTime() - start) / NANO} ${toJson / NANO}"
    }

    private fun run(arguments: List<String>): Int {
        try {
            return calibrate(Arguments(arguments))
        } catch (error: CalibrationException) {
            System.err.println(error)
        } catch (error: IllegalArgumentException) {
            System.err.println("${error.message}\n$USAGE")
        }
        return 2
    }

    private fun calibrate(given: Arguments): Int {
        val output = File(requireNotNull(given.one("-o")) { "-o is missing" })
        val basis = given.one("--basis") ?: "auto"
        val capture = Capture(given.shots(), chart(given), given.one("--white-reflectance")?.toDouble())
        val calibrator = calibrators.getOrPut(basis) { SsfCalibrator.Builder().basis(basis).openBlocking() }
        if (given.one("--write") == "capture") {
            val shots = capture.shots.map { restored(calibrator.measureBlocking(it, capture.chart), capture.chart) }
            write(output, MeasuredCapture.of(shots, capture.chart, capture.whiteReflectance).toJson())
            return 0
        }
        val options = CalibrationOptions.Builder()
            .fit(given.one("--fit")?.split("-")?.let { (first, last) -> (first.toInt()..last.toInt()).toList() })
            .l2(given.one("--l2")?.toDouble())
            .gamma(given.one("--gamma")?.toDouble())
            .previous(given.one("--previous")?.let { File(it) }?.let { SavedResult.read(it.readText(), it.name) })
            .build()
        val found = calibrator.calibrateBlocking(capture, options)
        val start = System.nanoTime()
        val text = found.toJson()
        toJson = System.nanoTime() - start
        write(output, text)
        if (found !is Refused) return 0
        System.err.println(found.error)
        return 5
    }

    /** A measured shot, saved and read again. */
    private fun restored(shot: MeasuredShot, chart: ChartTable): MeasuredShot =
        MeasuredCapture.fromJson(MeasuredCapture.of(listOf(shot), chart).toJson()).shots[0]

    private fun write(output: File, text: String) {
        val partial = File(output.path + ".partial")
        partial.writeText(text)
        check(partial.renameTo(output)) { "cannot write $output" }
    }

    private fun chart(given: Arguments): ChartTable {
        val name = given.one("--chart") ?: "classic24"
        val file = File(name.substringAfter(':'))
        val layout = name.substringBefore(':', "").ifEmpty { null }
        return if (file.isFile) ChartTable.parse(file.name, file.readBytes(), layout) else ChartTable.read(name)
    }

    override fun close() {
        calibrators.values.forEach { it.close() }
    }

    private class Arguments(words: List<String>) {
        private val photos = ArrayList<String>()
        private val options = HashMap<String, ArrayList<String>>()

        init {
            val rest = words.iterator()
            while (rest.hasNext()) {
                val word = rest.next()
                if (word.startsWith("-")) {
                    require(word in VALUES && rest.hasNext()) { "there is no option $word, or its value is missing" }
                    options.getOrPut(word) { ArrayList() } += rest.next()
                } else {
                    photos += word
                }
            }
        }

        fun one(name: String): String? = options[name]?.last()

        fun shots(): List<Shot> = photos.mapIndexed { j, photo ->
            fun own(name: String): String? = options[name]?.getOrNull(j)
            val corners = requireNotNull(own("--corners")) { "give corners a photo" }
            val lamp = lamp(own("--lamp") ?: AUTO)
            Shot(
                PhotoSource.of(File(photo)),
                own("--lamp-tolerance")?.let { lamp.withTolerance(it) } ?: lamp,
                Corners.of(*corners.split(",").map { it.toDouble() }.toDoubleArray()),
                own("--white")?.let { PhotoSource.of(File(it)) },
                own("--dark")?.let { PhotoSource.of(File(it)) },
                LensShading.of(one("--lens-shading") ?: LensShading.AS_STORED.word),
            )
        }

        private fun lamp(name: String): Lamp {
            val file = File(name)
            return when {
                file.isFile -> Lamp.parse(file.name, file.readBytes())
                name == AUTO -> Lamp.auto()
                name == "torch" -> Lamp.torch()
                else -> Lamp.read(name)
            }
        }
    }

    public companion object {
        private const val AUTO = "auto"
        private const val NANO = 1e9
        private const val USAGE =
            "calibrate PHOTO... [--lamp NAME|auto] --corners x,y,x,y,x,y,x,y [--white DNG] [--dark DNG] " +
                "[--lamp-tolerance T] [--chart NAME] [--white-reflectance R] [--lens-shading as-stored|apply] " +
                "[--basis NAME] [--l2 V] [--gamma V] [--fit 7-18] [--previous JSON] [--write capture] -o FILE"
        private val VALUES = setOf(
            "--lamp", "--corners", "--white", "--dark", "--lamp-tolerance", "--chart", "--white-reflectance",
            "--lens-shading", "--basis", "--l2", "--gamma", "--fit", "--previous", "--write", "-o",
        )

        @JvmStatic
        public fun main(arguments: Array<String>) {
            val status = Calibrate().use { command ->
                if (arguments.toList() != listOf("--serve")) return@use command.run(arguments.toList())
                while (true) {
                    val line = readlnOrNull() ?: break
                    println(command.serve(line.split("\t")))
                }
                0
            }
            exitProcess(status)
        }
    }
}
