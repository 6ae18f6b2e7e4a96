package org.camssf.selftest

import android.app.Activity
import android.content.Intent
import android.net.Uri
import android.os.Looper
import android.view.MotionEvent
import android.view.View
import android.view.ViewGroup
import android.widget.Button
import android.widget.Spinner
import android.widget.TextView
import org.camssf.golden.GoldenFiles
import org.camssf.golden.GoldenRunner
import org.camssf.photo.Mosaic
import org.camssf.photo.Region
import org.json.JSONObject
import org.junit.Assert.assertArrayEquals
import org.junit.Assert.assertEquals
import org.junit.Assert.assertFalse
import org.junit.Assert.assertTrue
import org.junit.Rule
import org.junit.Test
import org.junit.rules.TemporaryFolder
import org.junit.runner.RunWith
import org.robolectric.Robolectric
import org.robolectric.RobolectricTestRunner
import org.robolectric.Shadows.shadowOf
import org.robolectric.annotation.Config
import java.io.File
import java.util.concurrent.TimeUnit

/** The screen on a JVM, with the framework's own classes and the desktop's ONNX Runtime: no proof for a phone. */
@RunWith(RobolectricTestRunner::class)
@Config(sdk = [35])
class SelfTestActivityTest {
    @get:Rule
    val scratch = TemporaryFolder()
    private val folder = File(System.getProperty("camssf.root"), "golden")

    @Test
    fun `the golden vectors run from the screen`() {
        val activity = Robolectric.buildActivity(SelfTestActivity::class.java).setup().get()
        activity.files = GoldenFiles.of(folder)
        val views = all(activity.window.decorView)
        views.filterIsInstance<Button>().single { "golden" in it.text }.performClick()
        val said = waitFor(views, "golden: ")
        assertTrue(said, " 0 failed" in said)
    }

    @Test
    fun `a chosen DNG and four taps end in a result and a report without the photo's name`() {
        val name = "IMG_20261121_130000.dng"
        val photo = File(scratch.root, name)
        File(folder, "dng/chart-turned-0.dng").copyTo(photo)
        val activity = Robolectric.buildActivity(SelfTestActivity::class.java).setup().get()
        val views = all(activity.window.decorView)
        // Its levels were drawn in light of equal energy: under any other lamp the verdict doubts the lamp.
        val lamps = views.filterIsInstance<Spinner>().first()
        lamps.setSelection((0 until lamps.count).single { lamps.getItemAtPosition(it) == "E" })
        choose(activity, views, "Calibrate", Uri.fromFile(photo))
        waitFor(views, "Tap ")
        val picture = views.filterIsInstance<CornersView>().single()
        picture.layout(0, 0, 2 * 180, 2 * 132) // the photo is 180 px wide: two pixels of the screen for one of it
        for ((x, y) in listOf(162.56 to 116.56, 22.44 to 17.44, 16.44 to 109.56, 156.56 to 22.44)) {
            val up = MotionEvent.obtain(0, 0, MotionEvent.ACTION_UP, 2 * x.toFloat(), 2 * y.toFloat(), 0)
            picture.dispatchTouchEvent(up)
        }
        waitFor(views, "accepted, ")
        assertEquals(681, views.filterIsInstance<CurvesView>().single().ssf!!.curve(0).size)

        val saved = File(scratch.root, "report.json")
        shadowOf(activity.contentResolver).registerOutputStream(Uri.fromFile(saved), saved.outputStream())
        choose(activity, views, "Save", Uri.fromFile(saved))
        waitFor(views, "Saved.")
        val text = saved.readText()
        assertFalse(text, "IMG_" in text || "20261121" in text)
        val calibration = JSONObject(text).getJSONObject("calibration")
        assertTrue(calibration.getJSONObject("memory").getLong("peak_resident") > 1 shl 20)
        val result = calibration.getJSONObject("result")
        assertEquals("accepted", result.getJSONObject("verdict").getString("status"))
        val taken = result.getJSONArray("shots").getJSONObject(0)
        assertEquals("E", taken.getJSONObject("lamp").getString("name"))
        val shot = taken.getJSONObject("photo")
        assertEquals("photo", shot.getString("name"))
        assertEquals(64, shot.getString("sha256").length)
    }

    @Test
    fun `what is no DNG is said`() {
        val photo = File(scratch.root, "note.dng").apply { writeText("no photo") }
        val activity = Robolectric.buildActivity(SelfTestActivity::class.java).setup().get()
        val views = all(activity.window.decorView)
        choose(activity, views, "Calibrate", Uri.fromFile(photo))
        waitFor(views, "unreadable_raw: note.dng")
    }

    /** Presses a button and answers what it asks of the system. */
    private fun choose(activity: SelfTestActivity, views: List<View>, words: String, uri: Uri) {
        views.filterIsInstance<Button>().single { words in it.text }.performClick()
        val asked = shadowOf(activity).nextStartedActivityForResult
        shadowOf(activity).receiveResult(asked.intent, Activity.RESULT_OK, Intent().setData(uri))
    }

    /**
     * What the screen says when the job has ended, which must begin like this. The buttons are disabled until then, so a job
     * that ends in other words fails at once; the time only ends a job that hangs, on however busy a machine.
     */
    private fun waitFor(views: List<View>, begin: String): String {
        val end = System.nanoTime() + TimeUnit.MINUTES.toNanos(10)
        val buttons = views.filterIsInstance<Button>()
        val words = views.filterIsInstance<TextView>() - buttons.toSet()
        while (true) {
            shadowOf(Looper.getMainLooper()).idle()
            val said = words.map { it.text.toString() }
            if (buttons.all { it.isEnabled }) {
                return said.firstOrNull { it.startsWith(begin) } ?: throw AssertionError(said.toString())
            }
            assertTrue(said.toString(), System.nanoTime() < end)
            Thread.sleep(50)
        }
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
            assertArrayEquals(corners, CornersView.ordered(taps).toArray(), 0.0)
        }
    }

    @Test
    fun `the picture shows green from black to white`() {
        val samples = ShortArray(16) { if (it % 4 < 2) 64 else 1023 }
        val sensor = Mosaic.Sensor("GRBG", DoubleArray(4) { 64.0 }, 1023.0)
        val mosaic = Mosaic(Mosaic.Origin("m"), 4, 4, Region(0, 0, 4, 4), samples, sensor)
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
