package org.camssf.selftest

import android.content.Context
import android.graphics.Canvas
import android.graphics.Color
import android.graphics.Paint
import android.graphics.Path
import android.view.View
import org.camssf.Channel
import org.camssf.Curve
import org.camssf.Grid
import org.camssf.Recovered

/** Draws three curves from 380 to 720 nm, each with peak 1, with their 95 % bands. */
internal class CurvesView(context: Context) : View(context) {
    private val paint = Paint(Paint.ANTI_ALIAS_FLAG)
    private val path = Path()

    /** The curves to draw; null leaves the frame empty. */
    var result: Recovered? = null
        set(value) {
            field = value
            invalidate()
        }

    override fun onMeasure(widthSpec: Int, heightSpec: Int) {
        val width = MeasureSpec.getSize(widthSpec)
        setMeasuredDimension(width, resolveSize(width * 9 / 16, heightSpec))
    }

    override fun onDraw(canvas: Canvas) {
        paint.style = Paint.Style.STROKE
        paint.strokeWidth = resources.displayMetrics.density
        paint.color = Color.LTGRAY
        for (wavelength in 400..700 step 50) {
            val x = x((wavelength - 380) / Grid.STEP)
            canvas.drawLine(x, 0f, x, height.toFloat(), paint)
        }
        canvas.drawLine(0f, y(0.0), width.toFloat(), y(0.0), paint)
        val result = result ?: return
        for (channel in Channel.entries) {
            val color = COLORS[channel.ordinal]
            val curve = result.curve(channel)
            result.band(channel)?.let { band -> area(canvas, curve, band, color) }
            path.reset()
            curve.forEachIndexed { i, value -> line(i, value) }
            paint.style = Paint.Style.STROKE
            paint.strokeWidth = 2 * resources.displayMetrics.density
            paint.color = color
            canvas.drawPath(path, paint)
        }
    }

    private fun area(canvas: Canvas, curve: Curve, band: Curve, color: Int) {
        path.reset()
        for (i in 0 until curve.size) line(i, curve[i] + band[i])
        for (i in curve.size - 1 downTo 0) line(i, curve[i] - band[i])
        path.close()
        paint.style = Paint.Style.FILL
        paint.color = color and 0xffffff or (0x30 shl 24)
        canvas.drawPath(path, paint)
    }

    private fun line(at: Int, value: Double) {
        if (path.isEmpty) path.moveTo(x(at.toDouble()), y(value)) else path.lineTo(x(at.toDouble()), y(value))
    }

    private fun x(at: Double): Float = (at / (Grid.SIZE - 1) * width).toFloat()

    private fun y(value: Double): Float = ((1.1 - value) / 1.3 * height).toFloat()

    private companion object {
        val COLORS = intArrayOf(Color.rgb(200, 30, 30), Color.rgb(20, 140, 40), Color.rgb(30, 60, 200))
    }
}
