package org.camssf.packaging

import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Tag
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.io.TempDir
import java.io.File
import java.util.concurrent.TimeUnit
import java.util.zip.ZipEntry
import java.util.zip.ZipFile
import java.util.zip.ZipOutputStream
import kotlin.math.abs

/**
 * Golden cases of every stage and whole calibrations through one jar of everything an app has but camera2, shrunk and
 * obfuscated by R8 with the rules that the jars carry and nothing else: what an app's release build does to us, as far
 * as a JVM can show it.
 */
@Tag("R-ANDROID")
class ShrunkJarTest {
    @TempDir
    lateinit var folder: File

    private val java = File(System.getProperty("java.home"), "bin/java").path
    private val short = listOf(java, "-XX:+UseSerialGC", "-XX:TieredStopAtLevel=1")
    private val runtime = jar("onnxruntime-")
    private val ours = listOf("model", "core", "colour", "finder", "golden").map { jar("camssf-$it-") }
    private val others =
        listOf("kotlin-stdlib-", "kotlinx-coroutines-", "kotlinx-serialization-json-", "annotations-")
            .map(::jar) + jar("kotlinx-serialization-core-")

    /** An app's own class of this module, and the natives, which are all that the shrunk jar leaves in ONNX Runtime's. */
    private val app by lazy { packed("app.jar") }
    private val natives by lazy { unpack(runtime) { it.startsWith(NATIVE) && ".dSYM/" !in it } }

    @Test
    fun `golden cases pass and results are the same with the rules that are shipped`() {
        val jar = shrink()
        val names = ZipFile(jar).use { zip -> zip.entries().toList().map { it.name } }
        assertTrue(names.none { it == "org/camssf/recovery/Recover.class" }, "nothing was renamed")
        for (name in listOf("camssf-learned.onnx", "camssf-gaussian.onnx", "bases.f64")) {
            assertTrue("org/camssf/model/$name" in names, "$name is gone")
        }
        val (status, said) = java(listOf(jar, natives), listOf(MAINS[0], GOLDEN))
        assertEquals(0, status, said)
        for ((name, arguments) in CALIBRATIONS) {
            val shrunk = calibrate(listOf(jar), arguments)
            assertEquals(calibrate(ours + others + runtime, arguments), shrunk, name)
            assertEquals(name != "refused", "\"answer\":" in shrunk, name)
        }
        val suspended = File(folder, "suspended.json")
        val main = listOf(MAINS[2], CHART, CORNERS, suspended.path)
        val (end, words) = java(listOf(jar, natives), main)
        assertEquals(0, end, words)
        assertEquals(calibrate(listOf(jar), CALIBRATIONS.getValue("chosen")), suspended.readText())
    }

    /** Of an app that does what docs/android.md shows, in the jar's own compression. */
    @Test
    fun `sizes are those that the docs state`() {
        val jar = shrink(MAINS.takeLast(1))
        val entries = ZipFile(jar).use { zip -> zip.entries().toList() }
        val code = entries.filter { it.name.endsWith(".class") }.sumOf { it.compressedSize } / 1000
        val files = entries.filter { it.name.startsWith("org/camssf/") && !it.name.endsWith(".class") }
        val data = files.sumOf { it.size } / 1000
        println("an app's part: classes $code kB, models, tables and rules $data kB")
        assertTrue(code in 100..CODE, "classes take $code kB")
        assertTrue(data in 100..DATA, "models, tables and rules take $data kB")
        val stated = listOf(
            Triple("docs/android.md", """\((\d+) kB on """, code),
            Triple("android-bindings/VERIFICATION.md", """(\d+) kB of them compressed""", code),
            Triple("android-bindings/VERIFICATION.md", """models, tables and rules (\d+) kB""", data),
        )
        for ((page, words, size) in stated) {
            val number = Regex(words).findAll(File(ROOT, page).readText()).single().groupValues[1].toLong()
            // another JDK packs a little differently
            assertTrue(abs(number - size) <= size / 100, "$page says $number kB, it is $size")
        }
    }

    /** All classes of an app in one jar, R8 in class-file mode; only each `main` is kept by name. */
    private fun shrink(names: List<String> = MAINS): File {
        val rules = (ours + others).flatMap(::rules)
        val mains = names.map { "-keep class $it { public static void main(java.lang.String[]); }" }
        val conf = File(folder, "rules.pro").apply { writeText((rules + mains).joinToString("\n")) }
        val out = File(folder, "shrunk.jar")
        val program = (ours + others + runtime).map(::bare) + app
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

    /** The classes of [Stages] and [Suspending], their lambdas' too. */
    private fun packed(name: String): File = File(folder, name).apply {
        val place = File(Suspending::class.java.protectionDomain.codeSource.location.toURI())
        val classes = File(place, PACKAGE).listFiles().orEmpty().filter {
            it.name.startsWith("Suspending") || it.name.startsWith("Stages")
        }
        ZipOutputStream(outputStream()).use { out ->
            for (each in classes) {
                out.putNextEntry(ZipEntry(PACKAGE + each.name))
                each.inputStream().use { it.copyTo(out) }
            }
        }
    }

    /** A folder of the entries that are wanted. */
    private fun unpack(jar: File, wanted: (String) -> Boolean): File = File(folder, "natives").apply {
        ZipFile(jar).use { zip ->
            for (entry in zip.entries().toList().filter { !it.isDirectory && wanted(it.name) }) {
                val file = File(this, entry.name).apply { parentFile.mkdirs() }
                zip.getInputStream(entry).use { input -> file.outputStream().use { input.copyTo(it) } }
            }
        }
    }

    /** The JSON that the command writes. */
    private fun calibrate(path: List<File>, arguments: List<String>): String {
        val output = File(folder, "result.json").apply { delete() }
        val main = listOf(MAINS[1]) + arguments + listOf("-o", output.path)
        val (_, said) = java(path + natives, main)
        assertTrue(output.isFile, said)
        return output.readText()
    }

    private fun java(path: List<File>, main: List<String>): Pair<Int, String> =
        run(short + listOf("-cp", path.joinToString(File.pathSeparator)) + main)

    private fun run(command: List<String>): Pair<Int, String> {
        val said = File.createTempFile("said", ".txt", folder)
        val process = ProcessBuilder(command).redirectErrorStream(true).redirectOutput(said).start()
        assertTrue(process.waitFor(5, TimeUnit.MINUTES), "no end: ${command.last()}")
        return process.exitValue() to said.readText()
    }

    private companion object {
        const val NATIVE = "ai/onnxruntime/native/"

        /** kB; docs/android.md states them. Colour is about 80 of the first and 317 of the second, four models are 582. */
        const val CODE = 800
        const val DATA = 870
        const val PACKAGE = "org/camssf/packaging/"
        val MAINS = listOf("packaging.Stages", "golden.Calibrate", "packaging.Suspending").map { "org.camssf.$it" }
        val ROOT: String = System.getProperty("camssf.root")
        val GOLDEN: String = File(ROOT, "golden").path
        val CHART = "$GOLDEN/dng/chart-turned-0.dng"
        const val CORNERS = "22.44,17.44,156.56,22.44,162.56,116.56,16.44,109.56"
        const val FLAT = "19.44,19.44,160.56,19.44,160.56,112.56,19.44,112.56"

        /** Arguments of the command by who chose the basis; the last one's white frame is of another light. */
        val CALIBRATIONS = mapOf(
            "chosen" to listOf(CHART, "--lamp", "D55", "--corners", CORNERS),
            "refused" to listOf(
                "$GOLDEN/dng/patches-shaded.dng", "--lamp", "D55", "--corners", FLAT,
                "--white", "$GOLDEN/dng/patches-white.dng", "--dark", "$GOLDEN/dng/patches-dark.dng",
            ),
        )
    }
}
