package org.camssf.sample

import android.Manifest
import android.content.pm.PackageManager
import android.os.Bundle
import androidx.activity.ComponentActivity
import androidx.activity.compose.setContent
import androidx.activity.result.contract.ActivityResultContracts
import androidx.camera.core.CameraSelector
import androidx.camera.core.ImageAnalysis
import androidx.camera.core.Preview
import androidx.camera.lifecycle.ProcessCameraProvider
import androidx.compose.foundation.layout.fillMaxSize
import androidx.compose.runtime.LaunchedEffect
import androidx.compose.runtime.getValue
import androidx.compose.runtime.mutableStateOf
import androidx.compose.runtime.remember
import androidx.compose.runtime.setValue
import androidx.compose.ui.Modifier
import org.camssf.camerax.ChartCamera
import org.camssf.guide.Guidance

/** The viewfinder alone, in Compose; [SampleActivity] has what comes after it. */
class ViewfinderActivity : ComponentActivity() {
    private val permission = registerForActivityResult(ActivityResultContracts.RequestPermission()) { allowed ->
        if (allowed) start() else finish()
    }

    override fun onCreate(savedInstanceState: Bundle?) {
        super.onCreate(savedInstanceState)
        val allowed = checkSelfPermission(Manifest.permission.CAMERA) == PackageManager.PERMISSION_GRANTED
        if (allowed) start() else permission.launch(Manifest.permission.CAMERA)
    }

    private fun start() {
        val provider = ProcessCameraProvider.getInstance(this)
        provider.addListener({ show(provider.get()) }, ::runOnUiThread)
    }

    private fun show(provider: ProcessCameraProvider) {
        val back = CameraSelector.DEFAULT_BACK_CAMERA
        val camera = ChartCamera(this, provider.getCameraInfo(back))
        val preview = Preview.Builder().build()
        val analysis = ImageAnalysis.Builder().build()
        provider.bindToLifecycle(this, back, preview, analysis)
        setContent {
            var guidance by remember { mutableStateOf<Guidance?>(null) }
            LaunchedEffect(analysis) { camera.guidance(analysis).collect { guidance = it } }
            Viewfinder(camera.characteristics, preview, analysis, guidance, display = 0, Modifier.fillMaxSize())
        }
    }
}
