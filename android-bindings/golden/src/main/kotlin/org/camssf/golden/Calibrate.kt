package org.camssf.golden

import org.camssf.Calibrated
import org.camssf.Calibration
import org.camssf.CalibrationException
import org.camssf.Capture
import org.camssf.ChartTable
import org.camssf.Frame
import org.camssf.Lamp
import org.camssf.LensShading
import org.camssf.Refused
import org.camssf.Settings
import org.camssf.Shot
import org.camssf.SsfCalibrator
import java.io.File
import kotlin.system.exitProcess

/**
 * The library as a command, for comparison with Python's: `calibrate photo.dng ... --lamp D55 ... --corners x,y,... ...
 * -o result.json`, options repeated for several shots in the photos' order.
 *
 * With `--serve` it calibrates once for every line on standard input and prints the seconds each took.
 */
public object Calibrate {
    private const val USAGE = "calibrate PHOTO... --lamp NAME --corners x,y,x,y,x,y,x,y [--white DNG] [--dark DNG] " +
        "[--lamp-tolerance T] [--chart NAME] [--white-reflectance R] [--lens-shading as-stored|apply] " +
        "[--basis NAME] [--l2 V] [--gamma V] [--fit 7-18] [--serve] -o FILE"

    @JvmStatic
    public fun main(arguments: Array<String>) {
        try {
            exitProcess(run(arguments.toList()))
        } catch (error: CalibrationException) {
            System.err.println(error)
            exitProcess(2)
        } catch (error: IllegalArgumentException) {
            System.err.println("${error.message}\n$USAGE")
            exitProcess(2)
        }
    }

    private fun run(arguments: List<String>): Int {
        val photos = ArrayList<String>()
        val options = HashMap<String, ArrayList<String>>()
        val rest = arguments.iterator()
        while (rest.hasNext()) {
            val word = rest.next()
            when {
                word == "--serve" -> options[word] = ArrayList()

                word.startsWith("-") -> {
                    require(word in VALUES && rest.hasNext()) { "there is no option $word, or its value is missing" }
                    options.getOrPut(word) { ArrayList() } += rest.next()
                }

                else -> photos += word
            }
        }
        fun all(name: String): List<String> = options[name].orEmpty()
        fun one(name: String): String? = all(name).lastOrNull()
        fun frame(name: String, shot: Int): Frame? = all(name).getOrNull(shot)?.let { Frame.of(File(it)) }
        val shading = one("--lens-shading") ?: LensShading.AS_STORED.word
        val shots = photos.mapIndexed { j, photo ->
            require(j < all("--lamp").size && j < all("--corners").size) { "give a lamp and corners a photo" }
            val lamp = lamp(all("--lamp")[j])
            Shot(
                Frame.of(File(photo)),
                all("--lamp-tolerance").getOrNull(j)?.let { lamp.withTolerance(it) } ?: lamp,
                all("--corners")[j].split(",").map { it.toDouble() }.toDoubleArray(),
                frame("--white", j),
                frame("--dark", j),
                LensShading.of(shading),
            )
        }
        val chart = (one("--chart") ?: "classic24").let { name ->
            val file = File(name.substringAfter(':'))
            val layout = name.substringBefore(':', "").ifEmpty { null }
            if (file.isFile) ChartTable.parse(file.name, file.readBytes(), layout) else ChartTable.read(name)
        }
        val settings = Settings(
            one("--fit")?.split("-")?.let { (first, last) -> (first.toInt()..last.toInt()).toList() },
            one("--l2")?.toDouble(),
            one("--gamma")?.toDouble(),
        )
        val capture = Capture(shots, chart, one("--white-reflectance")?.toDouble())
        val output = File(requireNotNull(one("-o")) { "-o is missing" })
        SsfCalibrator.open(one("--basis") ?: "cameras").use { calibrator ->
            var found = calibrate(calibrator, capture, settings, output)
            if ("--serve" in options) {
                while (readlnOrNull() != null) {
                    val start = System.nanoTime()
                    found = calibrate(calibrator, capture, settings, output)
                    println((System.nanoTime() - start) / 1e9)
                }
            }
            return when (found) {
                is Calibrated -> 0

                is Refused -> {
                    System.err.println(found.error)
                    5
                }
            }
        }
    }

    private fun lamp(name: String): Lamp {
        val file = File(name)
        return if (file.isFile) Lamp.parse(file.name, file.readBytes()) else Lamp.read(name)
    }

    private fun calibrate(calibrator: SsfCalibrator, capture: Capture, settings: Settings, into: File): Calibration {
        val found = calibrator.calibrate(capture, settings)
        val partial = File(into.path + ".partial")
        partial.writeText(found.toJson())
        check(partial.renameTo(into)) { "cannot write $into" }
        return found
    }

    private val VALUES = setOf(
        "--lamp", "--corners", "--white", "--dark", "--lamp-tolerance", "--chart", "--white-reflectance",
        "--lens-shading", "--basis", "--l2", "--gamma", "--fit", "-o",
    )
}
