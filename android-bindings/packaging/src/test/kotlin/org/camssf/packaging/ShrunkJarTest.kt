package org.camssf.packaging

import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Tag
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.io.TempDir
import java.io.File
import java.lang.management.ManagementFactory
import java.util.concurrent.TimeUnit
import java.util.zip.ZipEntry
import java.util.zip.ZipFile
import java.util.zip.ZipOutputStream

/**
 * Golden cases of every stage and whole calibrations through one jar of everything an app has but camera2, shrunk and
 * obfuscated by R8 with the rules that the jars carry and nothing else: what an app's release build does to us, as far
 * as a JVM can show it.
 */
@Tag("R-ANDROID")
class ShrunkJarTest {
    @TempDir
    lateinit var folder: File

    /** A JVM with the flags of this one, which the POM gives. */
    private val java = listOf(File(System.getProperty("java.home"), "bin/java").path) +
        ManagementFactory.getRuntimeMXBean().inputArguments.filter { it.startsWith("-XX:") }
    private val runtime = jar("onnxruntime-")
    private val needed = listOf("model", "core").map(Artifacts::jar) +
        listOf("kotlin-stdlib-", "kotlinx-coroutines-", "annotations-").map(::jar)
    private val all = needed + listOf("model-gaussian", "colour", "finder", "golden").map(Artifacts::jar) +
        listOf("kotlinx-serialization-json-", "kotlinx-serialization-core-").map(::jar)

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
            assertEquals(calibrate(all + runtime, arguments), shrunk, name)
            assertEquals(name != "refused", "\"answer\":" in shrunk, name)
        }
        val suspended = File(folder, "suspended.json")
        val main = listOf(MAINS[2], CHART, CORNERS, suspended.path)
        val (end, words) = java(listOf(jar, natives), main)
        assertEquals(0, end, words)
        assertEquals(calibrate(listOf(jar), CALIBRATIONS.getValue("chosen")), suspended.readText())
    }

    /** Without `camssf-model-gaussian`, for which the smallest app asks at the end; code in the jar's own compression. */
    @Test
    fun `an app of learned bases alone calibrates, is small, and is told which artefact another basis needs`() {
        val output = File(folder, "smallest.json")
        val jar = shrink(listOf(SMALLEST, MAINS[2]), all - Artifacts.jar("model-gaussian"))
        val texts = listOf("auto", "gaussian").map { basis ->
            val (status, said) = java(listOf(jar, natives), listOf(SMALLEST, CHART, CORNERS, output.path, basis))
            assertEquals(0, status, said)
            output.readText()
        }
        assertEquals(calibrate(all + runtime, CALIBRATIONS.getValue("chosen")), texts[0])
        assertTrue(texts[1].startsWith("invalid_argument") && "camssf-model-gaussian" in texts[1], texts[1])
        val entries = ZipFile(jar).use { zip -> zip.entries().toList() }
        val code = entries.filter { it.name.endsWith(".class") }.sumOf { it.compressedSize } / 1000
        val files = entries.filter { it.name.startsWith("org/camssf/") && !it.name.endsWith(".class") }
        val data = files.sumOf { it.size } / 1000
        println("an app's part: classes $code kB, models, tables and rules $data kB")
        assertTrue(code in 100..CODE, "classes take $code kB")
        assertTrue(data in 100..DATA, "models, tables and rules take $data kB")
        val dex = ZipFile(shrink(listOf(SMALLEST), needed, listOf("--min-api", "24"))).use { zip ->
            zip.entries().toList().filter { it.name.endsWith(".dex") }.sumOf { it.size } / 1000
        }
        val sizes = listOf("core", "model").map { Artifacts.jar(it).length() / 1000 } + dex
        println("kB: jars of core and model ${sizes[0]} and ${sizes[1]}, dex of the smallest app $dex")
        assertTrue(sizes.zip(MOST).all { (size, most) -> size in 100..most }, "$sizes kB, bars $MOST")
    }

    /** All classes of an app in one jar of class files or of dex; only each `main` is kept by name. */
    private fun shrink(
        names: List<String> = MAINS,
        jars: List<File> = all,
        form: List<String> = listOf("--classfile"),
    ): File {
        val rules = jars.flatMap(::rules)
        val mains = names.map { "-keep class $it { public static void main(java.lang.String[]); }" }
        val conf = File(folder, "rules.pro").apply { writeText((rules + mains + NO_ANDROID).joinToString("\n")) }
        val out = File(folder, "shrunk.jar")
        val program = (jars + runtime).map(::bare) + app
        val r8 = java + listOf("-cp", jar("r8-").path, "com.android.tools.r8.R8")
        val options = form + listOf("--release", "--lib", System.getProperty("java.home"))
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

    /** The classes of [Smallest], [Stages] and [Suspending], their lambdas' too. */
    private fun packed(name: String): File = File(folder, name).apply {
        val place = File(Suspending::class.java.protectionDomain.codeSource.location.toURI())
        val classes = File(place, PACKAGE).listFiles().orEmpty().filter {
            listOf("Smallest", "Suspending", "Stages").any(it.name::startsWith)
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
        run(java + listOf("-cp", path.joinToString(File.pathSeparator)) + main)

    private fun run(command: List<String>): Pair<Int, String> {
        val said = File.createTempFile("said", ".txt", folder)
        val process = ProcessBuilder(command).redirectErrorStream(true).redirectOutput(said).start()
        assertTrue(process.waitFor(5, TimeUnit.MINUTES), "no end: ${command.last()}")
        return process.exitValue() to said.readText()
    }

    private companion object {
        const val NATIVE = "ai/onnxruntime/native/"

        /** kB; docs/android.md states them. Colour is about 80 of the first and 390 of the second. */
        const val CODE = 800
        const val DATA = 950

        /** kB: jar of core, jar of model, dex of the smallest app. */
        val MOST = listOf(1130L, 320L, 490L)

        /** In dex Kotlin's library asks for classes of Android, which the JDK, the library given here, has not. */
        const val NO_ANDROID = "-dontwarn android.**"
        const val PACKAGE = "org/camssf/packaging/"
        const val SMALLEST = "org.camssf.packaging.Smallest"
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
