package org.camssf.packaging

import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertFalse
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Assumptions.assumeTrue
import org.junit.jupiter.api.Tag
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.io.TempDir
import java.io.File
import java.io.IOException
import java.util.zip.ZipEntry
import java.util.zip.ZipFile
import java.util.zip.ZipOutputStream

/** A calibration in a JVM of its own: nothing is sent, and nothing stays but the result. docs/privacy.md is about it. */
@Tag("R-PRIVACY")
class PrivacyTest {
    @TempDir
    lateinit var folder: File

    private val home by lazy { File(folder, "home").apply { mkdir() } }
    private val temporary by lazy { File(folder, "temporary").apply { mkdir() } }
    private val work by lazy { File(folder, "work").apply { mkdir() } }
    private val runtime = Artifacts.CLASS_PATH.single { it.name.startsWith("onnxruntime-") }

    @Test
    fun `a calibration leaves its result and nothing else`() {
        val (status, said) = calibrate()
        assertEquals(0, status, said)
        assertNothingIsLeft()
        assertEquals(listOf("result.json"), work.list().orEmpty().toList())
    }

    @Test
    fun `a calibration talks to nobody`() {
        val trace = File(folder, "trace")
        val watch = listOf("strace", "-f", "-qq", "-e", "trace=network", "-o", trace.path)
        assumeTrue(works(watch + "true"), "there is no strace, or it may not trace: apt-get install strace")
        // The watch sees a connection: a datagram's, which sends nothing.
        assertEquals(0, java(listOf(Connecting::class.java.name), watch = watch).first)
        assertTrue(trace.readLines().any(::talks), "strace does not see a connection")
        val (status, said) = calibrate(watch = watch)
        assertEquals(0, status, said)
        assertTrue(trace.length() > 0)
        assertEquals(emptyList<String>(), trace.readLines().filter(::talks))
    }

    /** A newer version than the pinned one is noticed here. */
    @Test
    fun `ONNX Runtime's libraries hold nothing to report with`() {
        var searched = 0
        ZipFile(runtime).use { jar ->
            val entries = jar.entries().toList().filter { LIBRARY.containsMatchIn(it.name) && ".dSYM/" !in it.name }
            for (entry in entries) {
                val text = jar.getInputStream(entry).use { String(it.readBytes(), Charsets.ISO_8859_1) }
                if (KNOWN in text) searched++
                assertEquals(emptyList<String>(), TRACES.filter { it in text }, entry.name)
            }
        }
        assertEquals(SYSTEMS, searched)
    }

    @Test
    fun `a newer ONNX Runtime is refused before it is loaded, unless it is switched off`() {
        val others = Artifacts.CLASS_PATH - runtime + newer()
        val (status, said) = calibrate(others)
        assertEquals(2, status, said)
        assertTrue("ONNX Runtime 1.29.0 reports" in said && "ORT_DISABLE_TELEMETRY=1" in said, said)
        // The jar has no libraries, so that nothing but loading them can be what fails now.
        val (end, words) = calibrate(others, mapOf("ORT_DISABLE_TELEMETRY" to "1"))
        assertEquals(2, end, words)
        assertTrue("cannot load its native library" in words && "reports" !in words, words)
        assertFalse(File(work, "result.json").exists())
        assertNothingIsLeft()
    }

    private fun assertNothingIsLeft() {
        for (place in listOf(home, temporary)) {
            assertEquals(emptyList<String>(), place.walk().drop(1).map { it.relativeTo(place).path }.toList())
        }
    }

    /** ONNX Runtime's classes under another version's name. */
    private fun newer(): File = File(folder, "onnxruntime-newer.jar").apply {
        ZipFile(runtime).use { jar ->
            ZipOutputStream(outputStream()).use { out ->
                val manifest = "META-INF/MANIFEST.MF"
                out.putNextEntry(ZipEntry(manifest))
                val said = jar.getInputStream(jar.getEntry(manifest)).bufferedReader().readText()
                val changed = said.replace(Regex("(Implementation-Version: )\\S+"), "$11.29.0")
                assertTrue(changed != said, said)
                out.write(changed.toByteArray())
                for (entry in jar.entries().toList().filter { it.name.endsWith(".class") }) {
                    out.putNextEntry(ZipEntry(entry.name))
                    jar.getInputStream(entry).use { it.copyTo(out) }
                }
            }
        }
    }

    private fun calibrate(
        path: List<File> = Artifacts.CLASS_PATH,
        environment: Map<String, String> = emptyMap(),
        watch: List<String> = emptyList(),
    ): Pair<Int, String> {
        val request = Commands.request(File(work, "result.json"))
        return java(listOf(Commands.CALIBRATE, request), path, environment, watch)
    }

    /** With a home and a folder for temporary files of its own; the JVM's own statistics go to /tmp and are off. */
    private fun java(
        main: List<String>,
        path: List<File> = Artifacts.CLASS_PATH,
        environment: Map<String, String> = emptyMap(),
        watch: List<String> = emptyList(),
    ): Pair<Int, String> {
        val places = listOf("-Duser.home=${home.path}", "-Djava.io.tmpdir=${temporary.path}", "-XX:-UsePerfData")
        val command = watch + Commands.JAVA + places + listOf("-cp", path.joinToString(File.pathSeparator)) + main
        return Commands.run(command, folder) {
            directory(work)
            environment().remove("ORT_DISABLE_TELEMETRY")
            environment() += mapOf("HOME" to home.path, "TMPDIR" to temporary.path) + environment
        }
    }

    private fun works(command: List<String>): Boolean = try {
        ProcessBuilder(command).redirectErrorStream(true).start().run {
            inputStream.readBytes()
            waitFor() == 0
        }
    } catch (_: IOException) {
        false
    }

    /** Whether a line of strace names an address of the internet; opening a socket, as a JVM does to probe, does not. */
    private fun talks(line: String): Boolean = "sa_family=AF_INET" in line

    private companion object {
        /** Of 1.29.0: names of its log, its folder in the home, its variable, and the address that it reports to. */
        val TRACES = listOf("mat-debug", "DeveloperTools", "ORT_DISABLE_TELEMETRY", "events.data.microsoft.com")

        /** What every version's library holds: a search that finds nothing must have found this. */
        const val KNOWN = "onnxruntime"
        val LIBRARY = Regex("/native/.*/(lib)?onnxruntime\\.(so|dylib|dll)$")

        /** linux-x64, linux-aarch64, osx-aarch64, win-x64. */
        const val SYSTEMS = 4
    }
}

/** Connects a datagram socket, which sends nothing. */
internal object Connecting {
    @JvmStatic
    fun main(@Suppress("unused") arguments: Array<String>) {
        java.net.DatagramSocket().use { it.connect(java.net.InetAddress.getByName("127.0.0.1"), 9) }
    }
}
