package org.camssf

import org.camssf.photo.Assumption
import org.camssf.photo.Capture
import org.camssf.photo.PhotoSource
import org.camssf.photo.PhysicalCamera
import org.camssf.photo.PreviewCrop
import org.camssf.photo.Region
import org.camssf.photo.Shot
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertFalse
import org.junit.jupiter.api.Assertions.assertNotEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File

/** Values are equal by what they hold, and print as what they are. That each class prints at all is ApiTest's. */
class ValuesTest {
    private val photo = File(System.getProperty("camssf.root"), "golden/dng/chart-turned-0.dng")

    private fun camera(serial: String = "S-77", lens: String = "wide") =
        PhysicalCamera("0", serial, lens, 6.81, 1.85, Region(0, 0, 40, 30))

    private fun options() = CalibrationOptions.Builder().fit(listOf(1, 2))

    @Test
    fun `equal by what they hold`() {
        val pairs = listOf<Triple<Any, Any, Any>>(
            Triple(camera(), camera(), camera(serial = "S-78")),
            Triple(camera(), camera(), camera(lens = "tele")),
            Triple(PreviewCrop(0.0, 1.0, 2.0, 3.0), PreviewCrop(0.0, 1.0, 2.0, 3.0), PreviewCrop(0.0, 1.0, 2.0, 4.0)),
            Triple(Assumption("a", "b"), Assumption("a", "b"), Assumption("a", "c")),
            Triple(options().build(), options().build(), options().l2(0.1).build()),
            Triple(Curve(DoubleArray(681)), Curve(DoubleArray(681)), Curve(DoubleArray(681) { 1.0 })),
            Triple(Rows(DoubleArray(6), 2, 3), Rows(DoubleArray(6), 2, 3), Rows(DoubleArray(6), 3, 2)),
        )
        for ((one, same, other) in pairs) {
            assertEquals(one to one.hashCode(), same to same.hashCode())
            assertNotEquals(one, other)
        }
    }

    @Test
    fun `a serial number is in no message`() {
        assertFalse("S-77" in "${camera()}")
        assertTrue("lens=wide" in "${camera()}")
    }

    @Test
    fun `results print as what they are, and are equal in what does not vary`() {
        opened("phones").use { calibrator ->
            val capture =
                Capture(Shot(PhotoSource.of(photo), Lamp.read("E"), chartCorners), ChartTable.read("classic24"))
            val (one, two) = List(2) { calibrator.calibrateBlocking(capture) as Recovered }
            assertEquals(one.verdict, two.verdict)
            assertEquals(one.assumptions, two.assumptions)
            assertEquals(one.basis.hypotheses, two.basis.hypotheses)
            val line =
                Regex("""Recovered\((accepted|doubtful: [a-z_, ]+), basis=phones, halfWidth=0\.\d+\)""")
            assertTrue(line.matches("$one"), "$one")
            assertTrue("chart-turned-0.dng" in "${one.capture}" && "Lamp(E" in "${one.capture.shots[0].lamp}")
            val lost =
                Shot(PhotoSource { throw Refusal.of("unreadable_raw.missing", "file" to "a.dng") }, chartCorners)
            val refused = calibrator.calibrateBlocking(Capture(lost, ChartTable.read("classic24")))
            assertEquals("Refused(unreadable_raw: There is no file a.dng. Check the path.)", "$refused")
            assertEquals("refused: unreadable_raw", "${refused.verdict}")
        }
    }
}
