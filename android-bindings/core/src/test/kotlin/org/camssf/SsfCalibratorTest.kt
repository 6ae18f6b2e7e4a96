package org.camssf

import kotlinx.coroutines.CancellationException
import kotlinx.coroutines.async
import kotlinx.coroutines.flow.last
import kotlinx.coroutines.flow.toList
import kotlinx.coroutines.runBlocking
import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.double
import kotlinx.serialization.json.int
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.photo.Capture
import org.camssf.photo.ChartPose
import org.camssf.photo.Corners
import org.camssf.photo.PatchMeans
import org.camssf.photo.PhotoSource
import org.camssf.photo.Shot
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import org.camssf.recovery.Recover
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.camssf.verdict.Light
import org.camssf.verdict.Status
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File
import kotlin.concurrent.thread

/** The whole path on a golden photo: a flat lamp on the chart, no white and no dark frame. */
class SsfCalibratorTest {
    private val root = File(System.getProperty("camssf.root"))
    private val photo = File(root, "golden/dng/chart-turned-0.dng")
    private val chart = ChartTable.read("classic24")

    private fun shot(at: Corners = chartCorners) = Shot(PhotoSource.of(photo), Lamp.read("E"), at)

    private fun calibrated(found: CalibrationResult): Recovered {
        assertTrue(found is Recovered, found.verdict.reasons.joinToString { it.message })
        return found as Recovered
    }

    /** The result of a basis, calculated once for all tests that look at it. */
    private fun resultOf(basis: String): Recovered = RESULTS.getOrPut(basis) {
        opened(basis).use { calibrated(it.calibrateBlocking(Capture(shot(), chart))) }
    }

    @Test
    fun `curves, bands, proof and reasons`() {
        val found = resultOf("auto")
        for (channel in Channel.entries) {
            assertEquals(1.0, found.curve(channel).max())
            assertTrue(found.band(channel)!!.all { it >= 0 } && found.convergence.gap[channel.ordinal] < 1e-6)
        }
        assertEquals(24, found.signals.patches)
        assertTrue("white_from_patch" in found.assumptions.map { it.code })
        val document = Json.parseToJsonElement(found.toJson()).jsonObject
        assertEquals("camssf/2", document.getValue("format").jsonPrimitive.content)
        val predicted = document.getValue("answer").jsonObject.getValue("predicted").jsonArray
        assertEquals(24, predicted.single().jsonArray.size)
        assertEquals(682, found.toCsv().trim().lines().size)
    }

    @Test
    fun `a document holds the proof and how the codes vary together`() {
        fun document(basis: String): Pair<Recovered, JsonObject> = resultOf(basis).let { found ->
            found to Json.parseToJsonElement(found.toJson()).jsonObject.getValue("answer").jsonObject
        }

        fun numbers(of: JsonElement?) = of!!.jsonArray.map { it.jsonPrimitive.double }
        val (found, document) = document("cameras")
        assertEquals(72 * 73 / 2, numbers(document["code_covariance"]).size)
        val proof = document.getValue("proof").jsonObject
        assertEquals(found.convergence.layersGap.toList(), numbers(proof["layers_gap"]))
        val steps = proof.getValue("finish_steps").jsonArray.map { it.jsonPrimitive.int }
        assertEquals(found.convergence.finishSteps, steps)
        assertEquals(found.basis.logEvidence, document.getValue("evidence").jsonPrimitive.double)
        val (paper, bare) = document("gaussian")
        assertEquals(null to null, bare["code_covariance"] to bare["evidence"])
        assertEquals(paper.convergence.layersGap.toList(), numbers(bare.getValue("proof").jsonObject["layers_gap"]))
        assertEquals(3, bare.getValue("proof").jsonObject.getValue("finish_steps").jsonArray.size)
    }

    @Test
    fun `what was weighed stands in the document, and the model that answered`() {
        fun numbers(of: JsonObject, name: String) = of.getValue(name).jsonPrimitive.double
        SsfCalibrator.openBlocking().use { calibrator ->
            assertEquals("auto", calibrator.basis)
            assertEquals(setOf("phones", "cameras", "ryyb"), calibrator.modelHashes.keys)
            val found = resultOf("auto")
            val document = Json.parseToJsonElement(found.toJson()).jsonObject.getValue("answer").jsonObject
            val choice = document.getValue("choice").jsonArray.map { it.jsonObject }
            val bases = choice.map { it.getValue("basis").jsonPrimitive.content }
            assertEquals(listOf("phones", "cameras", "ryyb"), bases)
            assertEquals(found.basis.hypotheses.map { it.logEvidence }, choice.map { numbers(it, "log_evidence") })
            assertEquals(1.0, choice.sumOf { numbers(it, "probability") }, 1e-12)
            assertEquals(found.basis.name, document.getValue("basis").jsonPrimitive.content)
            val scale = if ("prior_scale" in document) numbers(document, "prior_scale") else 1.0
            assertEquals(found.basis.priorScale, scale)
            val model = document.getValue("model").jsonPrimitive.content
            assertEquals(calibrator.modelHashes.getValue(found.basis.name), model)
            assertEquals(64, document.getValue("basis_sha256").jsonPrimitive.content.length)
        }
        val document = Json.parseToJsonElement(resultOf("phones").toJson()).jsonObject
        val answer = document.getValue("answer").jsonObject
        assertTrue("choice" !in answer && "prior_scale" !in answer) // they have their defaults
        assertEquals("phones", answer.getValue("basis").jsonPrimitive.content)
        val shot = document.getValue("capture").jsonObject.getValue("shots").jsonArray.single().jsonObject
        val photo = shot.getValue("photo").jsonObject
        assertEquals("Maker Model 1", photo.getValue("unique_model").jsonPrimitive.content)
    }

    @Test
    fun `rivals are weighed in stacks, also where the capture is refused`() {
        fun dng(name: String) = PhotoSource.of(File(root, "golden/dng/$name.dng"))
        val flat = Corners.of(19.44, 19.44, 160.56, 19.44, 160.56, 112.56, 19.44, 112.56)
        val (white, dark) = listOf("white", "dark").map { dng("patches-$it") }
        val shaded = Shot(dng("patches-shaded"), Lamp.read("D55"), flat, white, dark)
        SsfCalibrator.openBlocking().use { calibrator ->
            fun steps(of: Shot): Pair<CalibrationResult, Int> {
                var judging = 0
                val counting = CalibrationOptions.Builder().progress { if (it.stage == Stage.JUDGING) judging++ }
                val found = calibrator.calibrateBlocking(Capture(of, chart), counting.build())
                return found to judging
            }
            val (sound, asked) = steps(shot())
            calibrated(sound)
            assertEquals((1 + Light.RIVALS.size + Recover.stackOf(1) - 1) / Recover.stackOf(1), asked)
            val (wrong, askedAgain) = steps(shaded)
            assertEquals(Status.REFUSED, wrong.verdict.outcome, wrong.verdict.reasons.joinToString { it.message })
            assertEquals(asked, askedAgain)
        }
    }

    @Test
    fun `measured now and solved later is the same`() {
        opened("phones").use { calibrator ->
            val later = calibrated(calibrator.solveBlocking(listOf(calibrator.measureBlocking(shot(), chart)), chart))
            assertEquals(resultOf("phones").toJson(), later.toJson())
        }
    }

    @Test
    fun `a part of the photo is enough`() {
        val region = ChartPose.region(chartCorners)
        val part = DngSource.of(photo).use { DngReader.read(it, region) }
        val whole = DngSource.of(photo).use { DngReader.read(it) }
        assertTrue(part.samples.size <= whole.samples.size)
        val poses = listOf(part, whole).map { ChartPose.refine(it, chartCorners, chart) }
        assertArrayEquals(poses[1].sharedQuads, poses[0].sharedQuads)
        val means = listOf(part, whole).map { PatchMeans.measure(it, poses[0]) }
        assertArrayEquals(means[1].chart.sharedMean, means[0].chart.sharedMean)
    }

    @Test
    fun `a chart that is not there is refused with what was learned`() {
        opened("phones").use { calibrator ->
            val elsewhere = Corners.of(2.0, 2.0, 30.0, 2.0, 30.0, 24.0, 2.0, 24.0)
            val found = calibrator.calibrateBlocking(Capture(shot(at = elsewhere), chart)) as Refused
            assertEquals("chart_not_found", found.error.code)
            assertEquals(Status.REFUSED, found.verdict.outcome)
            val document = Json.parseToJsonElement(found.toJson()).jsonObject
            assertNull(document["answer"])
            val last = document.getValue("capture").jsonObject.getValue("unfinished").jsonObject
            val photo = last.getValue("photo").jsonObject
            assertEquals("chart-turned-0.dng", photo.getValue("name").jsonPrimitive.content)
        }
    }

    @Test
    fun `a wrong call is thrown`() {
        opened("phones").use { calibrator ->
            val wrong = listOf(
                Capture(emptyList(), chart),
                Capture(listOf(shot()), chart, 0.9),
            )
            for (capture in wrong) assertThrows(InvalidArgument::class.java) { calibrator.calibrateBlocking(capture) }
            val none = CalibrationOptions.Builder().fit(listOf(0)).build()
            assertThrows(InvalidArgument::class.java) { calibrator.calibrateBlocking(Capture(shot(), chart), none) }
        }
    }

    @Test
    fun `an interrupted thread stops`() {
        opened("phones").use { calibrator ->
            var stopped = false
            thread {
                Thread.currentThread().interrupt()
                stopped = try {
                    calibrator.calibrateBlocking(Capture(shot(), chart))
                    false
                } catch (_: InterruptedException) {
                    true
                }
            }.join()
            assertTrue(stopped)
        }
    }

    @Test
    fun `a cancelled job stops at the next step`() = runBlocking {
        SsfCalibrator.openBlocking().use { calibrator ->
            val steps = ArrayList<Stage>()
            val job = async {
                lateinit var own: kotlinx.coroutines.Job
                own = coroutineContext[kotlinx.coroutines.Job]!!
                val cancelling = CalibrationOptions.Builder().progress {
                    steps += it.stage
                    if (it.stage == Stage.SOLVING) own.cancel()
                }
                calibrator.calibrate(Capture(shot(), chart), cancelling.build())
            }
            assertThrows(CancellationException::class.java) { runBlocking { job.await() } }
            assertEquals(1, steps.count { it == Stage.SOLVING })
        }
    }

    @Test
    fun `a curve at a wavelength`() {
        val found = resultOf("phones")
        for (channel in Channel.entries) {
            val (curve, band) = found.curve(channel) to found.band(channel)!!
            assertEquals(1.0, curve.max())
            assertEquals(curve[440], curve.at(600.0))
            assertEquals((curve[440] + curve[441]) / 2, curve.at(600.25), 1e-15)
            assertEquals(1.96 * found.deviation(channel)!![440], band.at(600.0))
            assertEquals(curve[0] to curve[680], curve.at(380.0) to curve.at(720.0))
        }
        for (nm in listOf(379.9, 720.1, Double.NaN)) {
            assertThrows(InvalidArgument::class.java) { found.curve(Channel.RED).at(nm) }
        }
    }

    @Test
    fun `a flow ends with the outcome, or with what the call threw`() = runBlocking {
        val calibrator = opened("phones")
        val flow = calibrator.calibrationFlow(Capture(shot(), chart))
        repeat(2) {
            val states = flow.toList()
            assertTrue((states.last() as RunState.Finished).result is Recovered)
            val parts = states.dropLast(1).map { (it as RunState.Running).progress.part }
            assertEquals(parts.sorted(), parts)
        }
        val elsewhere = shot(at = Corners.of(2.0, 2.0, 30.0, 2.0, 30.0, 24.0, 2.0, 24.0))
        val refused = calibrator.calibrationFlow(Capture(elsewhere, chart)).last()
        assertTrue((refused as RunState.Finished).result is Refused)
        calibrator.close()
        assertTrue(runCatching { flow.toList() }.exceptionOrNull() is CalibratorClosed)
    }

    @Test
    fun `suspending gives the same`() = runBlocking {
        val found = opened("phones").use { it.calibrate(Capture(shot(), chart)) }
        assertEquals(resultOf("phones").toJson(), found.toJson())
    }

    @Test
    fun `threads share a calibrator`() {
        opened("phones").use { calibrator ->
            val found = arrayOfNulls<String>(3)
            val threads = List(3) { i ->
                thread { found[i] = calibrator.calibrateBlocking(Capture(shot(), chart)).toJson() }
            }
            threads.forEach { it.join() }
            assertTrue(found.all { it == resultOf("phones").toJson() })
        }
    }

    @Test
    fun `the version is Python's`() {
        val version = Regex("version = \"(.*)\"").find(File(root, "pyproject.toml").readText())!!.groupValues[1]
        assertEquals(version, Camssf.VERSION)
    }

    private companion object {
        val RESULTS = HashMap<String, Recovered>()
    }
}
