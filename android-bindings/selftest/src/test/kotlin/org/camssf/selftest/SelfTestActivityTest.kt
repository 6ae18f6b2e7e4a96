package org.camssf.selftest

import android.os.Looper
import android.view.View
import android.view.ViewGroup
import android.widget.Button
import android.widget.TextView
import org.camssf.Mosaic
import org.camssf.Region
import org.camssf.golden.GoldenFiles
import org.camssf.golden.GoldenRunner
import org.json.JSONObject
import org.junit.Assert.assertArrayEquals
import org.junit.Assert.assertEquals
import org.junit.Assert.assertTrue
import org.junit.Test
import org.junit.runner.RunWith
import org.robolectric.Robolectric
import org.robolectric.RobolectricTestRunner
import org.robolectric.Shadows.shadowOf
import org.robolectric.annotation.Config
import java.io.File

/** The screen on a JVM, with the framework's own classes and the desktop's ONNX Runtime: no proof for a phone. */
@RunWith(RobolectricTestRunner::class)
@Config(sdk = [35])
class SelfTestActivityTest {
    private val folder = File(System.getProperty("camssf.root"), "golden")

    @Test
    fun `the golden vectors run from the screen`() {
        val activity = Robolectric.buildActivity(SelfTestActivity::class.java).setup().get()
        activity.files = GoldenFiles.of(folder)
        val views = all(activity.window.decorView)
        views.filterIsInstance<Button>().single { "golden" in it.text }.performClick()
        val end = System.nanoTime() + 60_000_000_000L
        while (views.none { it is TextView && it.text.startsWith("golden: ") } && System.nanoTime() < end) {
            Thread.sleep(50)
            shadowOf(Looper.getMainLooper()).idle()
        }
        val said = views.filterIsInstance<TextView>().map { it.text.toString() }
        assertTrue(said.toString(), said.any { it.startsWith("golden: ") && " 0 failed" in it })
    }

    @Test
    fun `the report holds the device, the faults and nothing else`() {
        val outcomes = GoldenRunner(GoldenFiles.of(folder)).use { listOf(it.run("signals/triple")) }
        val report = Report(mapOf("model" to "Phone 7")).apply { golden(outcomes, 12) }
        val json = JSONObject(report.toJson())
        assertEquals(setOf("format", "device", "golden", "calibration"), json.keys().asSequence().toSet())
        assertEquals("Phone 7", json.getJSONObject("device").getString("model"))
        assertEquals(1, json.getJSONObject("golden").getInt("ran"))
        assertEquals(0, json.getJSONObject("golden").getJSONArray("faults").length())
        assertTrue(json.isNull("calibration"))
    }

    @Test
    fun `four taps in any order become a rectangle`() {
        val corners = doubleArrayOf(10.0, 20.0, 110.0, 22.0, 108.0, 90.0, 12.0, 88.0)
        for (order in listOf(listOf(0, 1, 2, 3), listOf(3, 1, 0, 2), listOf(2, 0, 3, 1))) {
            val taps = order.flatMap { listOf(corners[2 * it], corners[2 * it + 1]) }
            assertArrayEquals(corners, CornersView.ordered(taps), 0.0)
        }
    }

    @Test
    fun `the picture shows green from black to white`() {
        val samples = ShortArray(16) { if (it % 4 < 2) 64 else 1023 }
        val mosaic = Mosaic("m", 4, 4, Region(0, 0, 4, 4), samples, "GRBG", DoubleArray(4) { 64.0 }, 1023.0)
        val picture = CornersView.thumbnail(mosaic, 2)
        assertEquals(listOf(2, 2), listOf(picture.width, picture.height))
        assertEquals(0xff000000.toInt(), picture.getPixel(0, 0))
        assertEquals(0xffffffff.toInt(), picture.getPixel(1, 1))
    }

    private fun all(view: View): List<View> {
        val children = if (view is ViewGroup) List(view.childCount) { view.getChildAt(it) } else emptyList()
        return listOf(view) + children.flatMap { all(it) }
    }
}
