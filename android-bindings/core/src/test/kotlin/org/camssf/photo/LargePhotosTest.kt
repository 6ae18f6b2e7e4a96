package org.camssf.photo

import kotlinx.coroutines.CompletableDeferred
import kotlinx.coroutines.Dispatchers
import kotlinx.coroutines.cancelAndJoin
import kotlinx.coroutines.delay
import kotlinx.coroutines.launch
import kotlinx.coroutines.runBlocking
import org.camssf.SsfCalibrator
import org.camssf.Stage
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.io.TempDir
import java.io.File
import java.util.concurrent.TimeUnit

/** Whole calibrations, models and all, in a heap of 96 MB: a JVM of its own, whose limit is the test. */
class LargePhotosTest {
    @TempDir
    private lateinit var folder: File

    private fun calibrate(width: Int, height: Int, kinds: List<String>, vararg more: String): Pair<Int, String> {
        val files = kinds.map { File(folder, "$it.dng").apply { LargePhotos.write(this, it, width, height) } }
        assertEquals(512 + 2L * width * height, files[0].length())
        val command = listOf(
            File(System.getProperty("java.home"), "bin/java").path, "-Xmx96m", "-XX:+UseSerialGC",
            "-cp", System.getProperty("java.class.path"), LargePhotos::class.java.name, "$width", "$height",
        )
        val said = File(folder, "said.txt")
        val process = ProcessBuilder(
            command + more + files.map {
                it.path
            },
        ).redirectErrorStream(true).redirectOutput(said)
            .start()
        try {
            assertTrue(process.waitFor(180, TimeUnit.SECONDS), "still running")
        } finally {
            process.destroyForcibly()
        }
        return process.exitValue() to said.readText()
    }

    @Test
    fun `50 megapixels, three frames`() {
        val (status, said) = calibrate(8192, 6144, listOf("chart", "white", "dark"))
        assertEquals(0, status, said)
    }

    /** The image's own buffer, read by region: what `RawFrames.open` gives. */
    @Test
    fun `50 megapixels, three frames of a source that is no file`() {
        val (status, said) = calibrate(8192, 6144, listOf("chart", "white", "dark"), LargePhotos.BY_REGION)
        assertEquals(0, status, said)
    }

    /** Each moment three times: on a busy machine a thread may have to wait for its turn, which is not ours. */
    @Test
    fun `cancelling is felt within 100 ms at 50 megapixels`() {
        val (width, height) = 8192 to 6144
        val file = File(folder, "chart.dng").apply { LargePhotos.write(this, "chart", width, height) }
        SsfCalibrator.open().use { calibrator ->
            val capture = Capture(LargePhotos.shot(listOf(file), width, height), LargePhotos.chart)
            val stages = ArrayList<Stage>()
            calibrator.calibrateBlocking(capture) { stages += it.stage } // compiled, and in the file's cache
            for (stage in stages.distinct() - Stage.DONE) {
                for (later in listOf(0L, 30L, 120L)) {
                    val felt = (1..3).minOf { felt(calibrator, capture, stage, later) }
                    assertTrue(felt <= 100, "$felt ms after '$stage' + $later ms")
                }
            }
        }
    }

    /** Milliseconds from the cancelling, `later` ms after a stage began, to the end of the run. */
    private fun felt(calibrator: SsfCalibrator, capture: Capture, stage: Stage, later: Long): Long = runBlocking {
        val begun = CompletableDeferred<Unit>()
        val job = launch(Dispatchers.Default) {
            calibrator.calibrate(capture) { if (it.stage == stage) begun.complete(Unit) }
        }
        begun.await()
        delay(later)
        val start = System.nanoTime()
        job.cancelAndJoin()
        (System.nanoTime() - start) / 1_000_000
    }

    @Test
    fun `200 megapixels, the chart alone`() {
        val (status, said) = calibrate(16384, 12288, listOf("chart"))
        assertEquals(0, status, said)
    }
}
