package org.camssf.packaging

import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Tag
import org.junit.jupiter.api.Test
import org.w3c.dom.Document
import org.w3c.dom.Element
import java.io.File
import java.io.InputStream
import java.util.Properties
import java.util.zip.ZipFile
import javax.xml.parsers.DocumentBuilderFactory

/** The hand-made AAR of camera2 and its POM, as far as they can be read without Android's build tools. */
@Tag("R-RELEASE")
class AarTest {
    private val version = System.getProperty("camssf.version")
    private val repository = File(System.getProperty("camssf.repository"), "org/camssf")
    private val aar = ZipFile(file(".aar"))

    @Test
    fun `it holds what an AAR must`() {
        val names = aar.entries().toList().map { it.name }.filter { !it.endsWith("/") }.toSet()
        val metadata = "META-INF/com/android/build/gradle/aar-metadata.properties"
        val wanted = setOf(
            "AndroidManifest.xml", "classes.jar", "R.txt", metadata, "res/values/values.xml",
            "META-INF/LICENSE", "META-INF/NOTICE",
        )
        assertEquals(wanted, names)
        val properties = Properties().apply { load(read(metadata)) }
        assertEquals("1.0", properties["aarFormatVersion"])
        assertEquals("1.0", properties["aarMetadataVersion"])
        val manifest = parse(read("AndroidManifest.xml")).documentElement
        assertEquals("org.camssf.camera2", manifest.getAttribute("package"))
        val sdk = manifest.getElementsByTagName("uses-sdk").item(0) as Element
        assertEquals("24", sdk.getAttribute("android:minSdkVersion"))
    }

    @Test
    fun `R names exactly the resources`() {
        val strings = parse(read("res/values/values.xml")).getElementsByTagName("string")
        val names = (0 until strings.length).map { (strings.item(it) as Element).getAttribute("name") }
        val table = read("R.txt").bufferedReader().readLines().map { it.split(" ").take(3) }
        assertEquals(names.map { listOf("int", "string", it) }, table)
    }

    @Test
    fun `its classes are camera2's, and core brings the rules of R8`() {
        assertArrayEquals(Artifacts.jar("camera2").readBytes(), read("classes.jar").readBytes())
        ZipFile(Artifacts.jar("core")).use { core ->
            for (place in listOf("META-INF/com.android.tools/r8/camssf.pro", "META-INF/proguard/camssf.pro")) {
                val rules = core.getInputStream(core.getEntry(place)).bufferedReader().readText()
                assertTrue("-keep,allowshrinking class ai.onnxruntime.** { *; }" in rules)
            }
        }
    }

    @Test
    fun `its POM names core, finder and the phone's ONNX Runtime, and nothing that only compiles here`() {
        val pom = parse(file(".pom").inputStream())
        assertEquals("aar", pom.getElementsByTagName("packaging").item(0).textContent)
        val dependencies = pom.getElementsByTagName("dependency")
        val found = (0 until dependencies.length).map { at ->
            val each = dependencies.item(at) as Element
            listOf("groupId", "artifactId", "version", "scope").joinToString(":") {
                each.getElementsByTagName(it).item(0).textContent
            }
        }
        val runtime = System.getProperty("onnxruntime.version")
        val own = listOf("core", "finder").map { "org.camssf:camssf-$it:$version:compile" }
        val phone = "com.microsoft.onnxruntime:onnxruntime-android:[$runtime]:runtime"
        assertEquals(own + phone, found.filterNot { "kotlin-stdlib" in it })
    }

    private fun file(end: String) = File(repository, "camssf-camera2/$version/camssf-camera2-$version$end")

    private fun read(name: String): InputStream = aar.getInputStream(aar.getEntry(name))

    private fun parse(stream: InputStream): Document =
        DocumentBuilderFactory.newInstance().newDocumentBuilder().parse(stream)
}
