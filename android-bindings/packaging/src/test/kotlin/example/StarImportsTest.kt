@file:Suppress("ktlint:standard:no-wildcard-imports")

package example

import org.camssf.*
import org.camssf.colour.*
import org.camssf.documents.*
import org.camssf.fit.*
import org.camssf.photo.*
import org.camssf.photo.dng.*
import org.camssf.recovery.*
import org.camssf.spectra.*
import org.camssf.verdict.*
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Test
import java.io.File

/** An app that imports every package whole, from a package of its own: a name that two of them had would not compile. */
class StarImportsTest {
    private val file = File(System.getProperty("camssf.root"), "golden/dng/chart-turned-0.dng")

    @Test
    fun `an app that imports every package whole measures a shot`() {
        val corners: Corners = Corners.of(22.44, 17.44, 156.56, 22.44, 162.56, 116.56, 16.44, 109.56)
        val source: DngSource = DngSource.of(file)
        val mosaic: Mosaic = source.use { DngReader.read(it, ChartPose.region(corners)) }
        val chart: ChartTable = ChartTable.read("classic24")
        val shot: Shot = Shot(PhotoSource.of(mosaic), Lamp.read("E"), corners)
        val found: CalibrationResult =
            SsfCalibrator.openBlocking().use { it.calibrateBlocking(Capture(shot, chart)) }
        val verdict: Verdict = found.verdict
        val curve: Curve = (found as Recovered).curve(Channel.RED)
        assertEquals(Grid.SIZE, curve.size)
        assertEquals(verdict.reasons.isEmpty(), verdict.outcome == Status.ACCEPTED)
    }
}
