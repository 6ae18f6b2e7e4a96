package org.camssf.packaging

import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Assumptions.assumeFalse
import org.junit.jupiter.api.DynamicTest
import org.junit.jupiter.api.DynamicTest.dynamicTest
import org.junit.jupiter.api.Tag
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.TestFactory
import org.w3c.dom.Element
import java.io.File
import java.lang.module.ModuleFinder
import java.util.jar.JarFile
import java.util.zip.ZipFile
import javax.xml.parsers.DocumentBuilderFactory

/** What Maven Central, lawyers and the JVM's module path ask of each artefact in target/repository. */
@Tag("R-RELEASE")
class ReleaseTest {
    private val version = System.getProperty("camssf.version")
    private val place = File(System.getProperty("camssf.repository"), "org/camssf")
    private val root = File(System.getProperty("camssf.root"))

    @Test
    fun `every module is shipped, or known not to be`() {
        val modules = elements(File(Artifacts.FOLDER, "pom.xml"), "module").map { it.textContent }
        assertEquals(modules.toSet(), Artifacts.SHIPPED.toSet() + NOT_SHIPPED)
        val there = place.list()!!.map { it.removePrefix("camssf-") }.toSet()
        assertEquals(Artifacts.SHIPPED.toSet() + "bom", there)
    }

    @TestFactory
    fun `LICENSE and NOTICE are in every archive`(): List<DynamicTest> =
        files().filter { it.extension in setOf("jar", "aar") }.map { file ->
            dynamicTest(file.name) {
                ZipFile(file).use { zip ->
                    for (name in listOf("LICENSE", "NOTICE")) {
                        val entry = zip.getEntry("META-INF/$name") ?: throw AssertionError("no META-INF/$name")
                        assertArrayEquals(File(root, name).readBytes(), zip.getInputStream(entry).readBytes(), name)
                    }
                }
            }
        }

    /** KDoc and SBOM are made at `verify`, after this test's module in `package`: run verify. */
    @TestFactory
    fun `code comes with sources and KDoc`(): List<DynamicTest> = Artifacts.OF_CODE.map { name ->
        dynamicTest(name) {
            assertTrue(names(file(name, "-sources.jar")).any { it.endsWith(".kt") })
            val classes = names(Artifacts.jar(name)).filter { it.endsWith(".class") && '$' !in it }
            val pages = names(file(name, "-javadoc.jar")).filter { it.endsWith(".html") }.toSet()
            val api = File(Artifacts.FOLDER, "$name/api/$name.api").readLines()
            val declared = Regex("""^public .*?(?:class|interface) (\S+) """)
            val public = api.mapNotNull { line -> declared.find(line)?.groupValues?.get(1) }
            val own = public.filter { '$' !in it && !it.endsWith("Kt") && "$it.class" in classes }
            assertTrue(own.isNotEmpty())
            // each public class's page, or its package's, where the file holds functions alone
            assertEquals(emptyList<String>(), own.filterNot { "$it.html" in pages })
        }
    }

    @TestFactory
    fun `every POM says what it is, whose, and where from`(): List<DynamicTest> =
        files().filter { it.extension == "pom" }.map { file ->
            dynamicTest(file.name) {
                val project = parse(file)
                for (name in listOf("name", "description", "url", "version")) {
                    assertTrue(text(project, name).isNotBlank(), name)
                }
                assertEquals(SITE, text(project, "url"))
                val licence = child(project, "licenses", "license")
                assertEquals("Apache-2.0", text(licence, "name"))
                assertTrue(text(licence, "url").startsWith("https://"))
                assertTrue(text(child(project, "developers", "developer"), "name").isNotBlank())
                val scm = child(project, "scm")
                assertEquals(SITE, text(scm, "url"))
                assertEquals("scm:git:$SITE.git", text(scm, "connection"))
                assertTrue(text(scm, "developerConnection").isNotBlank())
                assertEquals(0, project.getElementsByTagName("parent").length, "a parent would be published, too")
                for (each in elements(file, "dependency")) assertTrue(text(each, "version").isNotBlank())
                assertTrue("\${" !in file.readText() && "@" !in file.readText().replace("git@", ""))
            }
        }

    /** As the JVM's own module finder reads them. */
    @Test
    fun `every jar is a module with a name of its own, and no package is in two`() {
        val jars = Artifacts.SHIPPED.associateWith { Artifacts.jar(it) }
        for ((name, jar) in jars) {
            val said = JarFile(jar).use { it.manifest.mainAttributes.getValue("Automatic-Module-Name") }
            assertEquals("org.camssf.${name.replace('-', '.')}", said)
            assertEquals(said, ModuleFinder.of(jar.toPath()).findAll().single().descriptor().name())
        }
        val packages = jars.values.flatMap { ModuleFinder.of(it.toPath()).findAll().single().descriptor().packages() }
        assertEquals(packages.toSet().size, packages.size, packages.toString())
    }

    @Test
    fun `no class is in two artefacts, and none of the stubs is in any`() {
        val classes = Artifacts.SHIPPED.map(Artifacts::jar).flatMap(::names).filter { it.endsWith(".class") }
        assertTrue("org/camssf/camera2/RawFrames.class" in classes)
        assertEquals(emptySet<String>(), classes.groupingBy { it }.eachCount().filterValues { it > 1 }.keys)
        assertEquals(emptyList<String>(), classes.filterNot { it.startsWith("org/camssf/") })
        assertEquals(emptyList<String>(), files().filter { it.extension == "pom" && "stubs" in it.readText() })
    }

    @Test
    fun `the BOM names every artefact and the ONNX Runtime that was tested`() {
        val found = versions("bom")
        val runtime = System.getProperty("onnxruntime.version")
        // In brackets: just this version, so that a build that would raise it fails.
        val wanted = Artifacts.SHIPPED.associate { "camssf-$it" to version } +
            mapOf("onnxruntime" to "[$runtime]", "onnxruntime-android" to "[$runtime]")
        assertEquals(wanted, found)
    }

    @Test
    fun `coroutines are all that is compiled against, and no JSON library is brought along`() {
        val dependencies = elements(file("core", ".pom"), "dependency")
        val scopes = dependencies.associate { text(it, "artifactId") to text(it, "scope") }
        assertEquals("compile", scopes.getValue("kotlinx-coroutines-core-jvm"))
        for (name in Artifacts.SHIPPED) {
            val brought = elements(file(name, ".pom"), "dependency").map { text(it, "artifactId") }
            assertEquals(emptyList<String>(), brought.filter { "serialization" in it }, name)
        }
    }

    @Test
    fun `what is brought along, Kotlin 2_1 can read`() {
        for (name in Artifacts.SHIPPED) {
            val brought = versions(name)
            assertTrue(brought.getValue("kotlin-stdlib").startsWith("2.1."), "$name: $brought")
        }
    }

    /** Of what a POM names, all stands in the SBOM, and what that brings along. */
    @TestFactory
    fun `every artefact has an SBOM`(): List<DynamicTest> = Artifacts.SHIPPED.map { name ->
        dynamicTest(name) {
            val sbom = file(name, "-cyclonedx.json")
            val offline = System.getProperty("camssf.offline") == "offline true"
            assumeFalse(offline && !sbom.exists(), "Maven is offline: no SBOM")
            val said = sbom.readText()
            assertTrue(Regex(""""bomFormat"\s*:\s*"CycloneDX"""").containsMatchIn(said))
            assertTrue("pkg:maven/org.camssf/camssf-$name@$version" in said)
            for (each in elements(file(name, ".pom"), "dependency")) {
                val only = text(each, "version").trim('[', ']')
                val url = "pkg:maven/${text(each, "groupId")}/${text(each, "artifactId")}@$only"
                assertTrue(url in said, url)
            }
            assertTrue("junit" !in said && "robolectric/robolectric" !in said, "what only tests need is in it")
            assertTrue("camerax-stubs" !in said)
        }
    }

    private fun files(): List<File> {
        val found = place.walk().filter { it.isFile }.sorted().toList()
        check(found.isNotEmpty())
        return found
    }

    /** Of the dependencies in a module's POM, by artefact. */
    private fun versions(module: String): Map<String, String> =
        elements(file(module, ".pom"), "dependency").associate { text(it, "artifactId") to text(it, "version") }

    private fun file(module: String, end: String) = File(place, "camssf-$module/$version/camssf-$module-$version$end")

    private fun names(jar: File): List<String> = ZipFile(jar).use { zip -> zip.entries().toList().map { it.name } }

    private fun parse(file: File): Element =
        DocumentBuilderFactory.newInstance().newDocumentBuilder().parse(file).documentElement

    private fun elements(file: File, name: String): List<Element> {
        val found = parse(file).getElementsByTagName(name)
        return (0 until found.length).map { found.item(it) as Element }
    }

    private fun child(of: Element, vararg names: String): Element = names.fold(of) { at, name ->
        val nodes = at.childNodes
        (0 until nodes.length).map(nodes::item).filterIsInstance<Element>().firstOrNull { it.tagName == name }
            ?: throw AssertionError("no <$name> in <${at.tagName}>")
    }

    private fun text(of: Element, name: String): String = child(of, name).textContent.trim()

    private companion object {
        val NOT_SHIPPED = setOf("golden", "camerax-stubs", "sample", "selftest", "packaging")
        const val SITE = "https://github.com/camssf/camssf"
    }
}
