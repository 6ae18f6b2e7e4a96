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
import org.camssf.Channel
import org.camssf.finder.Picture
import org.camssf.finder.Plane
import org.camssf.golden.GoldenFiles
import org.camssf.golden.GoldenRunner
import org.camssf.guide.CaptureGuide
import org.camssf.photo.ChartPose
import org.camssf.photo.Corners
import org.camssf.photo.Mosaic
import org.camssf.photo.Region
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.camssf.spectra.ChartTable
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

    /** A few of them: all are GoldenTest's. */
    @Test
    fun `the golden vectors run from the screen`() {
        val activity = Robolectric.buildActivity(SelfTestActivity::class.java).setup().get()
        val whole = GoldenFiles.of(folder)
        val manifest = JSONObject(whole.read("manifest.json").decodeToString())
        val cases = manifest.getJSONObject("cases")
        cases.keys().asSequence().toList().filterNot { it.startsWith("choice/") }.forEach(cases::remove)
        manifest.put("count", cases.length())
        activity.files = GoldenFiles { if (it == "manifest.json") "$manifest".toByteArray() else whole.read(it) }
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
        assertEquals(681, views.filterIsInstance<CurvesView>().single().result!!.curve(Channel.RED).size)
        // From now on taps are spots: the white patch, itself the reference, has a white's 0.9.
        val white = ChartPose.refine(
            DngReader.read(DngSource.of(photo)),
            Corners.of(162.56, 116.56, 16.44, 109.56, 22.44, 17.44, 156.56, 22.44), ChartTable.read("classic24"),
        ).patches[18].points
        picture.layout(0, 0, 2 * 180, 2 * 132) // the window has laid it out anew
        val (x, y) = white.sumOf { it.x } / 4 to white.sumOf { it.y } / 4
        val tap = MotionEvent.obtain(0, 0, MotionEvent.ACTION_UP, 2 * x.toFloat(), 2 * y.toFloat(), 0)
        picture.dispatchTouchEvent(tap)
        val colour = waitFor(views, "L* ")
        // A posterior over measured surfaces: white within 0.25.
        val near = Regex("""L\* 9[56]\.\d, a\* -?0\.[0-2], b\* -?0\.[0-2], relative to the lamp""")
        assertTrue(colour, near.matches(colour))
        picture.dispatchTouchEvent(MotionEvent.obtain(0, 0, MotionEvent.ACTION_UP, 1f, 1f, 0))
        waitFor(views, "invalid_argument: The spot reaches beyond the photo.")

        val saved = File(scratch.root, "report.json")
        shadowOf(activity.contentResolver).registerOutputStream(Uri.fromFile(saved), saved.outputStream())
        choose(activity, views, "Save", Uri.fromFile(saved))
        waitFor(views, "Saved.")
        val text = saved.readText()
        assertFalse(text, "IMG_" in text || "20261121" in text)
        val lab = JSONObject(text).getJSONArray("colours").getJSONObject(0).getJSONArray("lab")
        assertEquals(116 * Math.cbrt(0.9) - 16, lab.getDouble(0), 0.1)
        val calibration = JSONObject(text).getJSONObject("calibration")
        assertTrue(calibration.getJSONObject("memory").getLong("peak_resident") > 1 shl 20)
        val result = calibration.getJSONObject("result")
        assertEquals("accepted", result.getJSONObject("verdict").getString("status"))
        val taken = result.getJSONObject("capture").getJSONArray("shots").getJSONObject(0)
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
        val keys = setOf("format", "device", "golden", "calibration", "guide", "colours")
        assertEquals(keys, json.keys().asSequence().toSet())
        assertEquals("Phone 7", json.getJSONObject("device").getString("model"))
        assertEquals(1, json.getJSONObject("golden").getInt("cases"))
        assertEquals(0, json.getJSONObject("golden").getJSONArray("faults").length())
        assertTrue(json.isNull("calibration"))
        assertTrue(json.isNull("guide"))
        assertEquals(0, json.getJSONArray("colours").length())
    }

    /** Of frames without a chart: what a session was, without a picture. */
    @Test
    fun `a live session is counted`() {
        val frame = Picture.luma(Plane(ByteArray(64 * 48) { (it * 7).toByte() }, 64), 64, 48)
        val guide = CaptureGuide()
        val log = GuideLog()
        assertTrue(log.toJson().isNull("median_ms"))
        for (i in 1..20L) log.add(guide.look(frame, i), i * 1_000_000)
        val report = Report(emptyMap()).apply { guide(log.toJson().toString()) }
        val found = JSONObject(report.toJson()).getJSONObject("guide")
        assertEquals(20, found.getInt("frames"))
        assertEquals(10.0, found.getDouble("median_ms"), 0.0)
        assertEquals(19.0, found.getDouble("slowest_twentieth_ms"), 0.0)
        assertEquals(20, found.getJSONObject("said").getInt("NO_CHART"))
        assertEquals(0, found.getInt("changes"))
        assertTrue(found.isNull("last"))
    }

    @Test
    fun `the live picture's log comes back into the report`() {
        val activity = Robolectric.buildActivity(SelfTestActivity::class.java).setup().get()
        val views = all(activity.window.decorView)
        views.filterIsInstance<Button>().single { "live" in it.text }.performClick()
        val asked = shadowOf(activity).nextStartedActivityForResult
        assertEquals(LiveActivity::class.java.name, asked.intent.component!!.className)
        val log = Intent().putExtra(LiveActivity.LOG, GuideLog().toJson().toString())
        shadowOf(activity).receiveResult(asked.intent, Activity.RESULT_OK, log)
        waitFor(views, "What the guide said")
        assertEquals(0, JSONObject(activity.report.toJson()).getJSONObject("guide").getInt("frames"))
    }

    /** Without the camera's permission nothing is opened; what was seen until then, nothing, is handed back. */
    @Test
    fun `the live picture asks for the camera and ends without it`() {
        val activity = Robolectric.buildActivity(LiveActivity::class.java).setup().get()
        assertFalse(activity.isFinishing)
        activity.onRequestPermissionsResult(1, arrayOf("android.permission.CAMERA"), intArrayOf(-1))
        assertTrue(activity.isFinishing)
        assertEquals(Activity.RESULT_OK, shadowOf(activity).resultCode)
        val log = JSONObject(shadowOf(activity).resultIntent.getStringExtra(LiveActivity.LOG)!!)
        assertEquals(0, log.getInt("frames"))
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
        val mosaic =
            Mosaic(Mosaic.Origin("m"), 4, 4, Region.ofSize(left = 0, top = 0, width = 4, height = 4), samples, sensor)
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
