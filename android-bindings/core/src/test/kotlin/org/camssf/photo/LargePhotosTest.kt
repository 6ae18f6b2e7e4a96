package org.camssf.photo

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
            assertTrue(process.waitFor(10, TimeUnit.MINUTES), "still running")
        } finally {
            process.destroyForcibly()
        }
        return process.exitValue() to said.readText()
    }

    /** The image's own buffer, read by region: what `RawFrames.open` gives. */
    @Test
    fun `50 megapixels, three frames of a source that is no file`() {
        val (status, said) = calibrate(8192, 6144, listOf("chart", "white", "dark"), LargePhotos.BY_REGION)
        assertEquals(0, status, said)
    }

    @Test
    fun `200 megapixels, the chart alone`() {
        val (status, said) = calibrate(16384, 12288, listOf("chart"))
        assertEquals(0, status, said)
    }
}
