package org.camssf.selftest

import android.content.Context
import android.graphics.Bitmap
import android.graphics.Canvas
import android.graphics.Color
import android.graphics.Paint
import android.view.MotionEvent
import android.view.View
import org.camssf.photo.Corners
import org.camssf.photo.Mosaic
import org.camssf.photo.Point

/** Shows a grey picture of a mosaic on which four taps mark the chart's corners, in the mosaic's pixels. */
internal class CornersView(context: Context) : View(context) {
    private val paint = Paint(Paint.ANTI_ALIAS_FLAG)
    private var picture: Bitmap? = null
    private var step = 1
    private val taps = ArrayList<Double>()
    private var then: (Corners) -> Unit = {}
    private var spot: ((Point) -> Unit)? = null

    /** Shows the mosaic and calls `then` with the four corners; the order of the taps does not matter to camssf. */
    fun ask(mosaic: Mosaic, then: (Corners) -> Unit) {
        step = maxOf(1, mosaic.width / SIDE)
        picture = thumbnail(mosaic, step)
        taps.clear()
        this.then = then
        spot = null
        requestLayout()
        invalidate()
    }

    /** Calls `then` with the position of each tap from now on, in the mosaic's pixels. */
    fun pick(then: (Point) -> Unit) {
        spot = then
    }

    override fun onMeasure(widthSpec: Int, heightSpec: Int) {
        val width = MeasureSpec.getSize(widthSpec)
        val height = picture?.let { width * it.height / it.width } ?: 0
        setMeasuredDimension(width, height)
    }

    override fun onDraw(canvas: Canvas) {
        val picture = picture ?: return
        val scale = width.toFloat() / picture.width
        canvas.save()
        canvas.scale(scale, scale)
        canvas.drawBitmap(picture, 0f, 0f, null)
        canvas.restore()
        paint.color = Color.MAGENTA
        val radius = 6 * resources.displayMetrics.density
        for (i in taps.indices step 2) {
            val (x, y) = listOf(taps[i], taps[i + 1]).map { (it / step * scale).toFloat() }
            canvas.drawCircle(x, y, radius, paint)
        }
    }

    override fun onTouchEvent(event: MotionEvent): Boolean {
        val picture = picture ?: return false
        val picked = spot
        if (event.action == MotionEvent.ACTION_UP && picked != null) {
            val scale = width.toDouble() / picture.width
            picked(Point(event.x / scale * step, event.y / scale * step))
            return true
        }
        if (event.action == MotionEvent.ACTION_UP && taps.size < 8) {
            val scale = width.toDouble() / picture.width
            taps += event.x / scale * step
            taps += event.y / scale * step
            invalidate()
            if (taps.size == 8) then(ordered(taps))
        }
        return true
    }

    internal companion object {
        private const val SIDE = 600

        /** The corners in clockwise order around their centre, from taps in any order. */
        fun ordered(taps: List<Double>): Corners = Corners.around(taps.chunked(2).map { Point(it[0], it[1]) })

        /** Green samples at every `step`-th position, with a gamma that makes dark patches visible. */
        fun thumbnail(mosaic: Mosaic, step: Int): Bitmap {
            val (width, height) = mosaic.width / step to mosaic.height / step
            val colors = IntArray(width * height)
            val green = mosaic.sensor.cfa.indexOf('G')
            val black = mosaic.sensor.black[green / 2, green % 2]
            val range = mosaic.sensor.white - black
            for (y in 0 until height) {
                for (x in 0 until width) {
                    val sample = mosaic[x * step / 2 * 2 + (green and 1), y * step / 2 * 2 + (green shr 1)]
                    val part = ((sample - black) / range).coerceIn(0.0, 1.0)
                    val grey = (255 * Math.pow(part, 1 / 2.2)).toInt()
                    colors[y * width + x] = Color.rgb(grey, grey, grey)
                }
            }
            return Bitmap.createBitmap(colors, width, height, Bitmap.Config.ARGB_8888)
        }
    }
}
