package org.camssf.selftest

import android.content.Context
import android.graphics.Canvas
import android.graphics.Color
import android.graphics.Paint
import android.graphics.Path
import android.view.View
import org.camssf.guide.Advice
import org.camssf.guide.Guidance
import org.camssf.photo.Corners
import org.camssf.photo.PreviewMap

/** Draws the chart's outline and one line of advice over a preview. */
internal class GuideView(context: Context) : View(context) {
    private val paint = Paint(Paint.ANTI_ALIAS_FLAG)
    private val path = Path()
    private var guidance: Guidance? = null
    private var outline: Corners? = null

    /**
     * Shows the guidance of a frame.
     *
     * @param frame the map from the frame to the mosaic.
     * @param view the map from this view to the mosaic.
     */
    fun show(said: Guidance, frame: PreviewMap, view: PreviewMap) {
        guidance = said
        outline = (said as? Guidance.Measured)?.let { view.fromMosaic(frame.toMosaic(it.measures.candidate.corners)) }
        invalidate()
    }

    override fun onDraw(canvas: Canvas) {
        val said = guidance ?: return
        val size = resources.displayMetrics.density
        paint.color = if (said.advice == Advice.NOW) Color.GREEN else Color.YELLOW
        outline?.let { corners ->
            path.reset()
            corners.points.forEachIndexed { i, point ->
                val (x, y) = point.x.toFloat() to point.y.toFloat()
                if (i == 0) path.moveTo(x, y) else path.lineTo(x, y)
            }
            path.close()
            paint.style = Paint.Style.STROKE
            paint.strokeWidth = 2 * size
            canvas.drawPath(path, paint)
        }
        paint.style = Paint.Style.FILL
        paint.textSize = 20 * size
        canvas.drawText(said.words, 12 * size, height - 24 * size, paint)
    }
}
