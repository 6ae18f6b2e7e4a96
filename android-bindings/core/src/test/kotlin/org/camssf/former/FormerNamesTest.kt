@file:Suppress("DEPRECATION")

package org.camssf.former

import org.camssf.Assumption
import org.camssf.BadPixels
import org.camssf.Calibrated
import org.camssf.Calibration
import org.camssf.Capture
import org.camssf.ChartLayout
import org.camssf.ChartPose
import org.camssf.ChartTable
import org.camssf.DngReader
import org.camssf.DngSource
import org.camssf.Frame
import org.camssf.FrameMeans
import org.camssf.GainMap
import org.camssf.Lamp
import org.camssf.LensShading
import org.camssf.MeasuredCapture
import org.camssf.MeasuredShot
import org.camssf.Mosaic
import org.camssf.Neutral
import org.camssf.PatchMeans
import org.camssf.Photo
import org.camssf.Reason
import org.camssf.Refused
import org.camssf.Region
import org.camssf.Scores
import org.camssf.Shot
import org.camssf.Signals
import org.camssf.SourceFile
import org.camssf.Ssf
import org.camssf.SsfCalibrator
import org.camssf.Verdict
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNotNull
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File

/** An app written before the rooms: it compiles, with warnings, and does what it did. Goes when the old names go. */
class FormerNamesTest {
    private val file = File(System.getProperty("camssf.root"), "golden/dng/chart-turned-0.dng")
    private val corners = doubleArrayOf(22.44, 17.44, 156.56, 22.44, 162.56, 116.56, 16.44, 109.56)

    @Test
    fun `an app of before calibrates`() {
        val chart: ChartTable = ChartTable.read("classic24")
        val lamp: Lamp = Lamp.read("E")
        val photos = listOf(
            Frame.of(file),
            Frame.dng { DngSource.of(file) },
            Frame { region: Region? -> Frame.of(file).read(region) },
        )
        val found = SsfCalibrator.open().use { calibrator ->
            photos.map { photo: Frame -> calibrator.calibrate(Capture(Shot(photo, lamp, corners), chart)) }
        }
        assertEquals(1, found.map { it.toJson() }.toSet().size)
        when (val first: Calibration = found[0]) {
            is Calibrated -> {
                val ssf: Ssf = first.ssf
                val values: DoubleArray = ssf.values
                assertEquals(ssf.curve(0)[340], values[3 * 340] / (0 until 681).maxOf { values[3 * it] })
                val signals: Signals = first.signals
                val scores: Scores = first.scores
                val capture: MeasuredCapture = first.capture
                val shot: MeasuredShot = capture.shots[0]
                val means: FrameMeans = shot.means.chart
                val photo: Photo = shot.photo
                assertEquals(24 * 3, means.mean.size + 0 * signals.patches)
                assertTrue(scores.deltaE00 >= 0 && photo.name == file.name)
                assertArrayEquals(shot.pose.outline.toArray(), shot.pose.corners)
                val assumption: Assumption = first.assumptions[0]
                assertTrue(assumption.code.isNotEmpty())
            }

            is Refused -> throw first.error
        }
        val verdict: Verdict = found[0].verdict
        val reasons: List<Reason> = verdict.reasons
        assertEquals(if (reasons.isEmpty()) "accepted" else "doubtful", verdict.status)
    }

    @Test
    fun `an app of before measures by itself`() {
        val chart = ChartTable.read("nano24")
        val none: SourceFile? = chart.file
        assertEquals(null, none)
        assertTrue(ChartLayout.all().any { it.name == chart.layout })
        val mosaic: Mosaic = DngSource.of(file).use { DngReader.read(it, ChartPose.region(corners)) }
        val pose: ChartPose = ChartPose.refine(mosaic, corners, ChartTable.read("classic24"))
        val means: PatchMeans = PatchMeans.measure(mosaic, pose, null, null, LensShading.AS_STORED)
        assertNotNull(means.chart)
        assertArrayEquals(corners, Shot(Frame.of(mosaic), Lamp.read("D55"), corners).corners)
    }

    @Test
    fun `an app of before makes a mosaic`() {
        val map = GainMap(
            list = 2, area = Region(0, 0, 4, 4), plane = 0, planes = 1, rowPitch = 1, columnPitch = 1,
            pointsV = 1, pointsH = 1, spacingV = 1.0, spacingH = 1.0, originV = 0.0, originH = 0.0, mapPlanes = 1,
            gains = floatArrayOf(2f),
        )
        val mosaic = Mosaic(
            "m", 4, 4, Region(0, 0, 4, 4), ShortArray(16) { 300 }, "GRBG", DoubleArray(4) { 64.0 }, 1023.0,
            make = "a", model = "b", exposure = 0.01, iso = 100.0, orientation = 6, gainMaps = listOf(map),
            badPixels = listOf(BadPixels(1, null, intArrayOf(1, 2), emptyList())), unknownOpcodes = listOf(99),
            colorMatrix1 = DoubleArray(9) { it.toDouble() }, asShotNeutral = doubleArrayOf(0.5, 1.0, 0.7),
            noiseProfile = doubleArrayOf(1e-4, 1e-6), maskedAreas = listOf(Region(0, 0, 1, 4)), sha256 = "ab",
            neutrals = listOf(Neutral(21, doubleArrayOf(0.5, 1.0, 0.7))),
        )
        assertEquals(listOf("m", "a", "b", "GRBG", "ab"), with(mosaic) { listOf(name, make, model, cfa, sha256) })
        assertEquals(listOf(0.01, 100.0, 1023.0), listOf(mosaic.exposure, mosaic.iso, mosaic.white))
        assertEquals(6, mosaic.orientation)
        assertEquals(2f, mosaic.gainMaps.single().gains.single())
        assertEquals(2, mosaic.badPixels.single().points[1])
        assertEquals(8.0, mosaic.colorMatrix1!![8])
        assertEquals(0.7, mosaic.asShotNeutral!![2] + 0 * mosaic.neutrals.single().white[0])
        assertEquals(1e-6, mosaic.noiseProfile!![1])
        assertEquals(4, mosaic.maskedAreas.single().height)
    }
}
