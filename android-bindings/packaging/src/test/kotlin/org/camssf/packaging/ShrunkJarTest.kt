package org.camssf.packaging

import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.io.TempDir
import java.io.File
import java.util.concurrent.TimeUnit
import java.util.zip.ZipEntry
import java.util.zip.ZipFile
import java.util.zip.ZipOutputStream

/**
 * The golden vectors through one jar of everything an app has, shrunk and obfuscated by R8 with the rules that the jars
 * carry and nothing else: what an app's release build does to us, as far as a JVM can show it.
 */
class ShrunkJarTest {
    @TempDir
    lateinit var folder: File

    private val java = File(System.getProperty("java.home"), "bin/java").path
    private val short = listOf(java, "-XX:+UseSerialGC", "-XX:TieredStopAtLevel=1")
    private val runtime = jar("onnxruntime-")
    private val ours = listOf("camssf-model-", "camssf-core-", "camssf-golden-").map(::jar)
    private val others =
        listOf("kotlin-stdlib-", "kotlinx-coroutines-", "kotlinx-serialization-json-", "annotations-")
            .map(::jar) + jar("kotlinx-serialization-core-")

    @Test
    fun `golden vectors pass with the rules that are shipped`() {
        val jar = shrink((ours + others).flatMap(::rules))
        val names = ZipFile(jar).use { zip -> zip.entries().toList().map { it.name } }
        assertTrue(names.none { it == "org/camssf/Recover.class" }, "nothing was renamed")
        assertTrue("org/camssf/model/camssf-cameras.onnx" in names, "the model is gone")
        val (status, said) = golden(jar)
        println("shrunk to ${jar.length() / 1024} kB, models included; ${said.trim().lines().last()}")
        assertEquals(0, status, said)
    }

    @Test
    fun `golden vectors fail without them`() {
        val (status, said) = golden(shrink(others.flatMap(::rules)))
        assertTrue(status != 0, said)
        assertTrue("UnsatisfiedLinkError" in said, said)
    }

    /** All classes of an app in one jar, R8 in class-file mode; only `main` is kept by name. */
    private fun shrink(rules: List<String>): File {
        val app = "-keep class org.camssf.golden.GoldenRunner { public static void main(java.lang.String[]); }"
        val conf = File(folder, "rules.pro").apply { writeText((rules + app).joinToString("\n")) }
        val out = File(folder, "shrunk.jar")
        val program = (ours + others + runtime).map(::bare)
        val r8 = short + listOf("-cp", jar("r8-").path, "com.android.tools.r8.R8")
        val options = listOf("--classfile", "--release", "--lib", System.getProperty("java.home"))
        val files = listOf("--pg-conf", conf.path, "--output", out.path)
        val (status, said) = run(r8 + options + files + program.map { it.path })
        assertEquals(0, status, said)
        return out
    }

    private fun jar(prefix: String): File = Artifacts.CLASS_PATH.single {
        it.name.startsWith(prefix) && it.name.endsWith(".jar")
    }

    /** The rules that the Android build takes from a jar. */
    private fun rules(jar: File): List<String> = ZipFile(jar).use { zip ->
        val files = zip.entries().toList().filter { !it.isDirectory }
        files.filter { it.name.startsWith("META-INF/com.android.tools/r8") }
            .ifEmpty { files.filter { it.name.startsWith("META-INF/proguard/") } }
            .map { zip.getInputStream(it).bufferedReader().readText() }
    }

    /** The jar without its rules, lest R8 finds them by itself; and without natives, which no shrinker touches. */
    private fun bare(jar: File): File = File(folder, jar.name).apply {
        ZipOutputStream(outputStream()).use { out ->
            out.setLevel(1)
            ZipFile(jar).use { zip ->
                for (entry in zip.entries().toList()) {
                    if (entry.isDirectory || entry.name.startsWith("META-INF/") || "/native/" in entry.name) continue
                    out.putNextEntry(ZipEntry(entry.name))
                    zip.getInputStream(entry).copyTo(out)
                    out.closeEntry()
                }
            }
        }
    }

    /** ONNX Runtime's own jar comes last: its natives are found there, its classes in the shrunk jar. */
    private fun golden(jar: File): Pair<Int, String> {
        val path = listOf(jar, runtime).joinToString(File.pathSeparator)
        val cases = File(System.getProperty("camssf.root"), "golden").path
        return run(short + listOf("-cp", path, "org.camssf.golden.GoldenRunner", cases))
    }

    private fun run(command: List<String>): Pair<Int, String> {
        val said = File.createTempFile("said", ".txt", folder)
        val process = ProcessBuilder(command).redirectErrorStream(true).redirectOutput(said).start()
        assertTrue(process.waitFor(5, TimeUnit.MINUTES), "no end: ${command.last()}")
        return process.exitValue() to said.readText()
    }
}
