package org.camssf.selftest

import android.app.Activity
import android.content.Intent
import android.net.Uri
import android.os.Build
import android.os.Bundle
import android.widget.ArrayAdapter
import android.widget.Button
import android.widget.LinearLayout
import android.widget.ScrollView
import android.widget.Spinner
import android.widget.TextView
import org.camssf.CalibrationException
import org.camssf.CalibrationOptions
import org.camssf.CalibrationResult
import org.camssf.Recovered
import org.camssf.Refused
import org.camssf.SsfCalibrator
import org.camssf.camera2.Photos
import org.camssf.golden.GoldenFiles
import org.camssf.golden.GoldenRunner
import org.camssf.golden.Outcome
import org.camssf.photo.Capture
import org.camssf.photo.Corners
import org.camssf.photo.Mosaic
import org.camssf.photo.PhotoSource
import org.camssf.photo.Point
import org.camssf.photo.Shot
import org.camssf.photo.dng.DngReader
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import java.io.IOException
import java.util.concurrent.Executors

/**
 * The first screen: golden vectors, the guide on the live preview ([LiveActivity]), a calibration from a chosen DNG,
 * standard colours of tapped spots, and a JSON report to send back.
 *
 * Everything except drawing runs on one worker thread; its results are posted to the main thread.
 */
public class SelfTestActivity : Activity() {
    private val worker = Executors.newSingleThreadExecutor()
    internal val report by lazy { Report(device()) }
    internal var files = GoldenFiles { path -> assets.open("golden/$path").use { it.readBytes() } }
    private lateinit var said: TextView
    private lateinit var lamps: Spinner
    private lateinit var charts: Spinner
    private lateinit var corners: CornersView
    private lateinit var curves: CurvesView
    private lateinit var buttons: List<Button>

    override fun onCreate(state: Bundle?) {
        super.onCreate(state)
        said = TextView(this)
        lamps = choice(Lamp.names() + UNNAMED, "daylight")
        charts = choice(ChartTable.names(), "classic24")
        corners = CornersView(this)
        curves = CurvesView(this)
        buttons = listOf(
            button("Run the golden vectors", ::runGolden),
            button("Guide on the live picture …") {
                startActivityForResult(Intent(this, LiveActivity::class.java), LIVE)
            },
            button("Calibrate from a DNG …") { ask(Intent.ACTION_OPEN_DOCUMENT, "*/*", OPEN) },
            button("Save the report …") { ask(Intent.ACTION_CREATE_DOCUMENT, "application/json", SAVE) },
        )
        val column = LinearLayout(this).apply { orientation = LinearLayout.VERTICAL }
        column.addView(TextView(this).apply { text = INTRODUCTION })
        column.addView(buttons[0])
        column.addView(buttons[1])
        column.addView(TextView(this).apply { text = "Light, then chart:" })
        for (view in listOf(lamps, charts, buttons[2], corners, curves, buttons[3], said)) column.addView(view)
        setContentView(ScrollView(this).apply { addView(column) })
    }

    override fun onDestroy() {
        worker.shutdownNow()
        super.onDestroy()
    }

    override fun onActivityResult(request: Int, result: Int, data: Intent?) {
        data?.getStringExtra(LiveActivity.LOG)?.takeIf { request == LIVE }?.let { log ->
            report.guide(log)
            tell("What the guide said is in the report.")
        }
        val uri = data?.data ?: return
        if (result == RESULT_OK && request == OPEN) open(uri)
        if (result == RESULT_OK && request == SAVE) save(uri)
    }

    /** Runs all golden cases in the app's assets. */
    internal fun runGolden(): Unit = work("Running the golden vectors …") {
        val start = System.nanoTime()
        val outcomes = ArrayList<Outcome>()
        GoldenRunner(files).use { runner ->
            val names = runner.names()
            for (name in names) {
                outcomes += runner.run(name)
                if (outcomes.size % 10 == 0) tell("${outcomes.size} of ${names.size} cases …")
            }
        }
        val time = (System.nanoTime() - start) / 1_000_000
        val faults = outcomes.flatMap { outcome -> outcome.faults.map { "${outcome.case}: $it" } }
        post {
            report.golden(outcomes, time)
            tell((listOf("${GoldenRunner.summary(outcomes)}, $time ms") + faults).joinToString("\n"))
        }
    }

    private fun open(uri: Uri) = work("Reading ${Photos.name(contentResolver, uri)} …") {
        val mosaic = Photos.open(contentResolver, uri).use { DngReader.read(it) }
        post {
            tell("Tap the four outer corners of the chart's block of patches.")
            corners.ask(mosaic) { calibrate(uri, mosaic, it) }
        }
    }

    private fun calibrate(uri: Uri, mosaic: Mosaic, corners: Corners) {
        val lamp = lamps.selectedItem as String
        val chart = charts.selectedItem as String
        work("Calibrating …") {
            val start = System.nanoTime()
            val photo = PhotoSource.dng { Nameless(Photos.open(contentResolver, uri)) }
            val light = if (lamp == UNNAMED) Lamp.auto() else Lamp.read(lamp)
            val capture = Capture(Shot(photo, light, corners), ChartTable.read(chart))
            val options = CalibrationOptions.Builder().progress { tell("$it") }.build()
            val found = SsfCalibrator.openBlocking().use { it.calibrateBlocking(capture, options) }
            val time = (System.nanoTime() - start) / 1_000_000
            val memory = Memory.now()
            val spot = (found as? Recovered)?.let { Spot(mosaic, corners, ChartTable.read(chart), it, lamp) }
            post {
                report.calibration(found, time, memory)
                curves.result = found as? Recovered
                tell(words(found, time))
                if (spot != null) this.corners.pick { colour(spot, it) }
            }
        }
    }

    private fun colour(spot: Spot, place: Point) = work("Measuring the spot …") {
        val found = spot.at(place)
        post {
            report.colour(found)
            tell(Spot.words(found))
        }
    }

    private fun words(found: CalibrationResult, time: Long): String {
        val head = when (found) {
            is Recovered -> "${found.verdict.outcome.word}, $time ms"
            is Refused -> "refused, $time ms"
        }
        val reasons = found.verdict.reasons.map { "${it.code}: ${it.message} ${it.advice}" }
        return (listOf(head) + reasons + found.assumptions.map { it.message }).joinToString("\n")
    }

    private fun save(uri: Uri) {
        val text = report.toJson()
        work("Saving …") {
            val stream = contentResolver.openOutputStream(uri) ?: throw IOException("no stream")
            stream.use { it.write(text.toByteArray()) }
            tell("Saved. Send that file back; it holds no photo, and not its name.")
        }
    }

    private fun ask(action: String, type: String, request: Int) {
        val intent = Intent(action).addCategory(Intent.CATEGORY_OPENABLE).setType(type)
        if (request == SAVE) intent.putExtra(Intent.EXTRA_TITLE, "camssf-selftest.json")
        startActivityForResult(intent, request)
    }

    /** Runs a job on the worker thread; its exceptions are shown on the screen. */
    private fun work(what: String, job: () -> Unit) {
        tell(what)
        buttons.forEach { it.isEnabled = false }
        worker.execute {
            try {
                job()
            } catch (error: CalibrationException) {
                tell("${error.code}: ${error.message} ${error.advice}")
            } catch (error: LinkageError) {
                tell("ONNX Runtime's Android library is not in this APK: build it with -Donnxruntime.aar=… ($error)")
            } catch (error: Exception) {
                tell("This is a fault of the app: $error")
            } finally {
                post { buttons.forEach { it.isEnabled = true } }
            }
        }
    }

    private fun tell(words: String) = post { said.text = words }

    private fun post(job: () -> Unit) = runOnUiThread(job)

    private fun button(words: String, then: () -> Unit) = Button(this).apply {
        text = words
        setOnClickListener { then() }
    }

    private fun choice(names: List<String>, first: String) = Spinner(this).apply {
        adapter = ArrayAdapter(this@SelfTestActivity, android.R.layout.simple_spinner_dropdown_item, names)
        setSelection(names.indexOf(first))
    }

    private fun device() = mapOf(
        "manufacturer" to Build.MANUFACTURER,
        "model" to Build.MODEL,
        "android" to Build.VERSION.RELEASE,
        "sdk" to Build.VERSION.SDK_INT.toString(),
        "abis" to Build.SUPPORTED_ABIS.joinToString(),
        "page_size" to Memory.page().toString(),
    ).mapValues { it.value ?: "" }

    private companion object {
        const val OPEN = 1
        const val SAVE = 2
        const val LIVE = 3

        /** Entry in the menu of lamps for an unnamed light. */
        const val UNNAMED = "auto"
        const val INTRODUCTION = "Checks that camssf computes on this phone what it computes on a desktop. " +
            "Nothing leaves the phone but the report that you save and send yourself."
    }
}
