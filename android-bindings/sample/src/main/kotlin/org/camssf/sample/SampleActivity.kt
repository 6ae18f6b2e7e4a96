package org.camssf.sample

import android.Manifest
import android.content.pm.PackageManager
import android.graphics.Color
import android.os.Bundle
import android.view.Gravity
import android.widget.FrameLayout
import android.widget.TextView
import androidx.activity.ComponentActivity
import androidx.camera.core.CameraSelector
import androidx.camera.core.ImageAnalysis
import androidx.camera.core.ImageCapture
import androidx.camera.core.Preview
import androidx.camera.lifecycle.ProcessCameraProvider
import androidx.camera.view.PreviewView
import androidx.lifecycle.lifecycleScope
import kotlinx.coroutines.launch
import org.camssf.CalibrationException
import org.camssf.CalibrationResult
import org.camssf.Channel
import org.camssf.Grid
import org.camssf.Recovered
import org.camssf.Refused
import org.camssf.RunState
import org.camssf.SsfCalibrator
import org.camssf.camerax.ChartCamera
import org.camssf.photo.Capture
import org.camssf.photo.Shot
import org.camssf.spectra.ChartTable
import org.camssf.verdict.Status
import java.io.File
import java.util.Locale

/**
 * One screen: the preview with the guide's advice, then the photo, then the result. After a doubtful result a tap
 * adds a photo, which should be taken in another light; after any other it begins again.
 */
class SampleActivity : ComponentActivity() {
    private lateinit var view: PreviewView
    private lateinit var text: TextView

    /** The photos that the next one is added to. */
    private val shots = ArrayList<Shot>()

    override fun onCreate(savedInstanceState: Bundle?) {
        super.onCreate(savedInstanceState)
        view = PreviewView(this)
        text = TextView(this).apply {
            textSize = 20f
            setPadding(32, 32, 32, 96)
            setTextColor(Color.WHITE)
            setBackgroundColor(Color.argb(160, 0, 0, 0))
        }
        setContentView(
            FrameLayout(this).apply {
                addView(view)
                addView(text, FrameLayout.LayoutParams(MATCH, WRAP, Gravity.BOTTOM))
            },
        )
        if (allowed()) start() else requestPermissions(arrayOf(Manifest.permission.CAMERA), CAMERA)
    }

    override fun onRequestPermissionsResult(requestCode: Int, permissions: Array<String>, grantResults: IntArray) {
        super.onRequestPermissionsResult(requestCode, permissions, grantResults)
        if (allowed()) start() else text.text = "Without the camera there is nothing to calibrate."
    }

    private fun allowed() = checkSelfPermission(Manifest.permission.CAMERA) == PackageManager.PERMISSION_GRANTED

    private fun start() {
        val provider = ProcessCameraProvider.getInstance(this)
        provider.addListener({ bind(provider.get()) }, ::runOnUiThread)
    }

    private fun bind(provider: ProcessCameraProvider) {
        val back = CameraSelector.DEFAULT_BACK_CAMERA
        val camera = ChartCamera(this, provider.getCameraInfo(back))
        val capture = try {
            camera.imageCapture()
        } catch (error: CalibrationException) { // no RAW photos
            text.text = "${error.message} ${error.advice}"
            return
        }
        val analysis = ImageAnalysis.Builder().build()
        val preview = Preview.Builder().build()
        preview.setSurfaceProvider(view.surfaceProvider)
        provider.bindToLifecycle(this, back, preview, analysis, capture)
        photograph(camera, analysis, capture)
    }

    private fun photograph(camera: ChartCamera, analysis: ImageAnalysis, capture: ImageCapture) {
        text.setOnClickListener(null)
        lifecycleScope.launch {
            val file = File(cacheDir, "chart-${shots.size + 1}.dng") // read again with the next photo
            text.text = try {
                val corners = camera.awaitChart(analysis) { text.text = it.words }
                text.text = "Taking the photo …"
                val all = shots + Shot(camera.takeDng(capture, file), corners)
                val found = calibrate(all)
                shots.clear()
                val doubtful = found is Recovered && found.verdict.outcome == Status.DOUBTFUL
                if (doubtful && all.size < MOST_SHOTS) {
                    shots += all
                } else {
                    for (number in 1..all.size) File(cacheDir, "chart-$number.dng").delete()
                }
                words(found)
            } catch (error: CalibrationException) { // no photo, or no ONNX Runtime
                "${error.message} ${error.advice}"
            }
            text.setOnClickListener { photograph(camera, analysis, capture) }
        }
    }

    private suspend fun calibrate(shots: List<Shot>): CalibrationResult = SsfCalibrator.open().use {
        lateinit var found: CalibrationResult
        it.calibrationFlow(Capture(shots, ChartTable.read("classic24"))).collect { state ->
            when (state) {
                is RunState.Running -> text.text = "${(100 * state.progress.part).toInt()} %"
                is RunState.Finished -> found = state.result
            }
        }
        found
    }

    private fun words(found: CalibrationResult): String = when (found) {
        is Recovered -> "${found.verdict.outcome.word}\n${peaks(found)}${advice(found)}"
        is Refused -> "${found.error.message} ${found.error.advice}"
    }

    private fun peaks(found: Recovered) = Channel.entries.joinToString("\n") { channel ->
        val curve = found.curve(channel)
        val peak = Grid.wavelengths.maxByOrNull { curve.at(it) }
        String.format(Locale.ROOT, "%s: peak at %.0f nm", channel.name.lowercase(Locale.ROOT), peak)
    }

    /** What to do next, for example one more photo in another light; empty if the answer was accepted. */
    private fun advice(found: Recovered) = found.verdict.reasons.joinToString("") { "\n${it.advice}" }

    private companion object {
        const val CAMERA = 1
        const val MOST_SHOTS = 3 // without a named lamp
        const val MATCH = FrameLayout.LayoutParams.MATCH_PARENT
        const val WRAP = FrameLayout.LayoutParams.WRAP_CONTENT
    }
}
