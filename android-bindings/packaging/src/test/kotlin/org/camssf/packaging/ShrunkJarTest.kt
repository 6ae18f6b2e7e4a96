package org.camssf.packaging

import org.camssf.golden.GoldenFiles
import org.camssf.golden.GoldenRunner
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Tag
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.io.TempDir
import java.io.File
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

    private val runtime = jar("onnxruntime-")
    private val needed = listOf("model", "core").map(Artifacts::jar) +
        listOf("kotlin-stdlib-", "kotlinx-coroutines-", "annotations-").map(::jar)
    private val all = needed + listOf("model-gaussian", "colour", "finder", "golden").map(Artifacts::jar) +
        listOf("kotlinx-serialization-json-", "kotlinx-serialization-core-").map(::jar)

    private val output by lazy { File(folder, "result.json") }

    /** Of the command; the refused one's white frame is of another light. */
    private val requests by lazy {
        val frames = listOf("white", "dark").joinToString("") { """, "$it": "${Commands.dng("patches-$it")}"""" }
        mapOf(
            "chosen" to Commands.request(output),
            "refused" to Commands.request(output, Commands.dng("patches-shaded"), FLAT, frames),
        )
    }

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
        val stages = GoldenRunner(GoldenFiles.of(File(Commands.GOLDEN))).use { it.names() }
            .groupBy { it.substringBefore('/') }.values
        // R8 may drop a class; numbers are GoldenTest's.
        val cases = stages.flatMap { it.take(3) }
        val (status, said) = java(listOf(jar, natives), listOf(MAINS[0], Commands.GOLDEN) + cases)
        assertEquals(0, status, said)
        for ((name, request) in requests) {
            val shrunk = calibrate(listOf(jar), request)
            assertEquals(calibrate(all + runtime, request), shrunk, name)
            assertEquals(name != "refused", "\"answer\":" in shrunk, name)
        }
        val suspended = File(folder, "suspended.json")
        val main = listOf(MAINS[2], Commands.CHART, Commands.CORNERS, suspended.path)
        val (end, words) = java(listOf(jar, natives), main)
        assertEquals(0, end, words)
        assertEquals(calibrate(listOf(jar), requests.getValue("chosen")), suspended.readText())
    }

    /** Without `camssf-model-gaussian`, for which the smallest app asks at the end; code in the jar's own compression. */
    @Test
    fun `an app of learned bases alone calibrates, is small, and is told which artefact another basis needs`() {
        val output = File(folder, "smallest.json")
        val jar = shrink(listOf(SMALLEST, MAINS[2]), all - Artifacts.jar("model-gaussian"))
        val texts = listOf("auto", "gaussian").map { basis ->
            val main = listOf(SMALLEST, Commands.CHART, Commands.CORNERS, output.path, basis)
            val (status, said) = java(listOf(jar, natives), main)
            assertEquals(0, status, said)
            output.readText()
        }
        assertEquals(calibrate(all + runtime, requests.getValue("chosen")), texts[0])
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
        val r8 = Commands.JAVA + listOf("-cp", jar("r8-").path, "com.android.tools.r8.R8")
        val options = form + listOf("--release", "--lib", System.getProperty("java.home"))
        val files = listOf("--pg-conf", conf.path, "--output", out.path)
        val (status, said) = Commands.run(r8 + options + files + program.map { it.path }, folder)
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

    /** The classes of [Smallest] and [Suspending], their lambdas' too. */
    private fun packed(name: String): File = File(folder, name).apply {
        val place = File(Suspending::class.java.protectionDomain.codeSource.location.toURI())
        val classes = File(place, PACKAGE).listFiles().orEmpty().filter {
            listOf("Smallest", "Suspending").any(it.name::startsWith)
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
    private fun calibrate(path: List<File>, request: String): String {
        output.delete()
        val (_, said) = java(path + natives, listOf(MAINS[1], request))
        assertTrue(output.isFile, said)
        return output.readText()
    }

    private fun java(path: List<File>, main: List<String>): Pair<Int, String> =
        Commands.run(Commands.JAVA + listOf("-cp", path.joinToString(File.pathSeparator)) + main, folder)

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
        val MAINS = listOf("org.camssf.golden.GoldenRunner", Commands.CALIBRATE, "org.camssf.packaging.Suspending")
        const val FLAT = "19.44,19.44,160.56,19.44,160.56,112.56,19.44,112.56"
    }
}
