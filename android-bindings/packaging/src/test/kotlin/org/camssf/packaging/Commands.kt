package org.camssf.packaging

import org.junit.jupiter.api.Assertions.assertTrue
import java.io.File
import java.lang.management.ManagementFactory
import java.util.concurrent.TimeUnit

/** Commands in processes of their own, and what they are given. */
internal object Commands {
    /** A JVM with the flags of this one, which the POM gives. */
    val JAVA: List<String> = listOf(File(System.getProperty("java.home"), "bin/java").path) +
        ManagementFactory.getRuntimeMXBean().inputArguments.filter { it.startsWith("-XX:") }

    const val CALIBRATE = "org.camssf.golden.Calibrate"
    val GOLDEN: String = File(System.getProperty("camssf.root"), "golden").path
    val CHART = dng("chart-turned-0")
    const val CORNERS = "22.44,17.44,156.56,22.44,162.56,116.56,16.44,109.56"

    fun dng(name: String): String = "$GOLDEN/dng/$name.dng"

    /** What [CALIBRATE] is to do with a photo in daylight; `frames` are further keys of its shot. */
    fun request(output: File, photo: String = CHART, corners: String = CORNERS, frames: String = ""): String =
        """{"shots": [{"photo": "$photo", "lamp": "D55", "corners": [$corners]$frames}], "output": "$output"}"""

    /** Status and words of a command; its words go through a file in the folder. */
    fun run(command: List<String>, folder: File, prepare: ProcessBuilder.() -> Unit = {}): Pair<Int, String> {
        val said = File.createTempFile("said", ".txt", folder)
        val process = ProcessBuilder(command).redirectErrorStream(true).redirectOutput(said).apply(prepare).start()
        assertTrue(process.waitFor(5, TimeUnit.MINUTES), "no end: ${command.last()}")
        return process.exitValue() to said.readText()
    }
}
