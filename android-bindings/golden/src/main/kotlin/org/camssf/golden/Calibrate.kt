package org.camssf.golden

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.jsonObject
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
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import java.io.Closeable
import java.io.File
import kotlin.system.exitProcess

/**
 * The library as a command, for comparison with Python's. Every argument, or every line on standard input where there
 * is none, is a request in JSON: `shots`, each with `photo`, `corners` and perhaps `lamp`, `lamp_tolerance`, `white`,
 * `dark`; `output`; and perhaps `chart`, `white_reflectance`, `basis` and options. With `"write": "capture"` it only
 * measures: each shot by itself, saved and restored as an app would, then joined. `{"read": kind, "file": path}` reads
 * a file alone: a `dng`, or the table of a `lamp` or `chart`.
 *
 * The answer is a line with the status (0, 2 for a wrong request, 5 for a refusal), which is the command's own at the
 * end, the seconds, and behind a tab what was read (of a DNG the samples' SHA-256, as golden cases give it, and the
 * levels; of a table its mean square), or the error's code and words. Models stay open between requests.
 */
public class Calibrate private constructor() : Closeable {
    private val calibrators = HashMap<String, SsfCalibrator>()

    private fun run(request: String): Pair<Int, String> {
        try {
            val none = Forms { throw GoldenError("a request has no files of golden/") }
            val fields = Fields(Json.parseToJsonElement(request).jsonObject, none, "the request")
            if (fields.has("read")) return 0 to read(fields.text("read"), File(fields.text("file")))
            return calibrate(fields) to ""
        } catch (error: CalibrationException) {
            System.err.println(error)
            return 2 to "\t${error.code}\t${error.message.replace(Regex("[\r\n\t]"), " ")}"
        } catch (error: GoldenError) {
            System.err.println(error)
        } catch (error: IllegalArgumentException) { // no JSON, or a value of another kind
            System.err.println(error)
        }
        return 2 to ""
    }

    private fun read(kind: String, file: File): String {
        val table = when (kind) {
            "lamp" -> Lamp.parse(file.name, file.readBytes()).sharedValues
            "chart" -> ChartTable.parse(file.name, file.readBytes()).sharedValues
            else -> null
        }
        if (table != null) return "\tread\t${table.sumOf { it * it } / table.size}"
        val photo = DngSource.of(file).use { DngReader.read(it) }
        val levels = listOf(photo.sensor.white) + photo.sensor.sharedBlack.toList()
        return "\tread\t${sha256(bytes(photo.samples))}\t${photo.sensor.cfa}\t${levels.joinToString("\t")}"
    }

    private fun calibrate(request: Fields): Int {
        val shots = request.parts("shots").map { shot(it) }
        val chart = ChartTable.read(request.findText("chart") ?: "classic24")
        val capture = Capture(shots, chart, request.findNumber("white_reflectance"))
        val basis = request.findText("basis") ?: "auto"
        val options = CalibrationOptions.Builder()
            .fit(request.integers("fit").toList().ifEmpty { null })
            .l2(request.findNumber("l2"))
            .gamma(request.findNumber("gamma"))
            .previous(request.findText("previous")?.let(::File)?.let { SavedResult.read(it.readText(), it.name) })
            .build()
        val output = File(request.text("output"))
        val measures = request.findText("write") == "capture"
        if (request.unread().isNotEmpty()) throw GoldenError("nothing reads ${request.unread()}")
        val calibrator = calibrators.getOrPut(basis) { SsfCalibrator.Builder().basis(basis).openBlocking() }
        if (measures) {
            val restored = shots.map { restored(calibrator.measureBlocking(it, chart), chart) }
            output.writeText(MeasuredCapture.of(restored, chart, capture.whiteReflectance).toJson())
            return 0
        }
        val result = calibrator.calibrateBlocking(capture, options)
        output.writeText(result.toJson())
        if (result is Refused) System.err.println(result.error)
        return if (result is Refused) 5 else 0
    }

    private fun shot(of: Fields): Shot {
        val lamp = of.findText("lamp")?.takeIf { it != "auto" }?.let { Lamp.read(it) } ?: Lamp.auto()
        val (white, dark) = listOf("white", "dark").map { name ->
            of.findText(name)?.let { PhotoSource.of(File(it)) }
        }
        return Shot(
            PhotoSource.of(File(of.text("photo"))),
            of.findText("lamp_tolerance")?.let { lamp.withTolerance(it) } ?: lamp,
            Corners.of(*of.values("corners")), white, dark, LensShading.AS_STORED,
        )
    }

    /** A measured shot, saved and read again. */
    private fun restored(shot: MeasuredShot, chart: ChartTable): MeasuredShot =
        MeasuredCapture.fromJson(MeasuredCapture.of(listOf(shot), chart).toJson()).shots[0]

    override fun close() {
        calibrators.values.forEach { it.close() }
    }

    public companion object {
        @JvmStatic
        public fun main(arguments: Array<String>) {
            var status = 0
            Calibrate().use { command ->
                for (request in arguments.asSequence().ifEmpty { generateSequence(::readlnOrNull) }) {
                    val start = System.nanoTime()
                    val (done, said) = command.run(request)
                    println("$done ${(System.nanoTime() - start) / 1e9}$said")
                    status = done
                }
            }
            exitProcess(status)
        }
    }
}
