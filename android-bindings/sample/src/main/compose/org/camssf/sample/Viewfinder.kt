package org.camssf.sample

import android.hardware.camera2.CameraCharacteristics
import android.util.Size
import androidx.camera.core.ImageAnalysis
import androidx.camera.core.Preview
import androidx.camera.view.PreviewView
import androidx.compose.foundation.Canvas
import androidx.compose.foundation.background
import androidx.compose.foundation.layout.Box
import androidx.compose.foundation.layout.fillMaxSize
import androidx.compose.foundation.layout.fillMaxWidth
import androidx.compose.foundation.layout.padding
import androidx.compose.foundation.text.BasicText
import androidx.compose.runtime.Composable
import androidx.compose.ui.Alignment
import androidx.compose.ui.Modifier
import androidx.compose.ui.graphics.Color
import androidx.compose.ui.graphics.Path
import androidx.compose.ui.graphics.drawscope.Stroke
import androidx.compose.ui.text.TextStyle
import androidx.compose.ui.unit.dp
import androidx.compose.ui.unit.sp
import androidx.compose.ui.viewinterop.AndroidView
import org.camssf.camera2.PreviewFrames
import org.camssf.guide.Advice
import org.camssf.guide.Guidance
import org.camssf.photo.Corners

private val SHADE = Color.Black.copy(alpha = 0.6f)

/**
 * The camera's preview, the outline of the chart in it, and the guide's advice.
 *
 * @param camera Camera2's description of the camera that both use cases are bound to.
 * @param guidance of the latest frame of [analysis]; null before the first.
 * @param display rotation of the screen: 0, 90, 180 or 270 degrees.
 */
@Composable
fun Viewfinder(
    camera: CameraCharacteristics,
    preview: Preview,
    analysis: ImageAnalysis,
    guidance: Guidance?,
    display: Int,
    modifier: Modifier = Modifier,
) {
    val colour = if (guidance?.advice == Advice.NOW) Color.Green else Color.Yellow
    Box(modifier) {
        AndroidView(
            factory = { context -> PreviewView(context).also { preview.setSurfaceProvider(it.surfaceProvider) } },
            modifier = Modifier.fillMaxSize(),
        )
        Canvas(Modifier.fillMaxSize()) {
            val stream = preview.resolutionInfo?.resolution
            val frame = analysis.resolutionInfo?.resolution
            if (guidance is Guidance.Measured && stream != null && frame != null) {
                val chart = PreviewFrames.map(camera, frame).toMosaic(guidance.measures.candidate.corners)
                val view = PreviewFrames.view(camera, stream, Size(size.width.toInt(), size.height.toInt()), display)
                drawPath(outline(view.fromMosaic(chart)), colour, style = Stroke(2.dp.toPx()))
            }
        }
        BasicText(
            guidance?.words.orEmpty(),
            Modifier.align(Alignment.BottomCenter).fillMaxWidth().background(SHADE).padding(24.dp),
            TextStyle(colour, 20.sp),
        )
    }
}

/** Corners in pixels of the view. */
private fun outline(corners: Corners) = Path().apply {
    corners.points.forEachIndexed { i, point ->
        val x = point.x.toFloat()
        val y = point.y.toFloat()
        if (i == 0) moveTo(x, y) else lineTo(x, y)
    }
    close()
}
