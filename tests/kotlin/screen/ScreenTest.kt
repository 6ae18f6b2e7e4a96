package example

import android.net.Uri
import android.widget.ImageView
import java.io.File
import kotlinx.coroutines.runBlocking
import org.camssf.photo.PhotoSource
import org.camssf.photo.Region
import org.junit.Assert.assertTrue
import org.junit.Test
import org.junit.runner.RunWith
import org.robolectric.RobolectricTestRunner
import org.robolectric.RuntimeEnvironment
import org.robolectric.annotation.Config

@RunWith(RobolectricTestRunner::class)
@Config(sdk = [35])
class ScreenTest {
    @Test
    fun firstResult() {
        val app = RuntimeEnvironment.getApplication()
        val photo = File(app.filesDir, "photo.dng")
        File("@photo@").copyTo(photo)
        val screen = Screen(app.contentResolver, app.filesDir)
        runBlocking { screen.chosen(Uri.fromFile(photo), 22.44, 17.44, 156.56, 22.44, 162.56, 116.56, 16.44, 109.56) }
        assertTrue("${screen.shown}", screen.shown.single().startsWith("red at 600 nm 0."))
        val result = File(app.filesDir, "result.json").readText()
        assertTrue(result, "\"curves\":" in result)
        File("result.json").writeText(result)
        screen.shown.clear()
        val mosaic = PhotoSource.of(photo).read(null)
        val area = Region.ofSize(left = 22, top = 94, width = 16, height = 16)
        screen.live(mosaic, mosaic, area, area, area, ImageView(app), 30, 100)
        assertTrue("${screen.shown}", screen.shown.size == 2 && screen.shown[1].startsWith("L* is uncertain by "))
    }
}
