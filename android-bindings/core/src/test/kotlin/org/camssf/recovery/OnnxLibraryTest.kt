package org.camssf.recovery

import org.camssf.RuntimeUnfit
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File

/** Which ONNX Runtime is taken. What it leaves behind is PrivacyTest's, in the module packaging. */
class OnnxLibraryTest {
    @Test
    fun `the version in the words is the build's`() {
        val pom = File(System.getProperty("camssf.root"), "android-bindings/pom.xml").readText()
        assertTrue("<onnxruntime.version>${OnnxLibrary.VERSION}</onnxruntime.version>" in pom)
        assertEquals(OnnxLibrary.VERSION, OnnxLibrary.environment().version)
    }

    @Test
    fun `a version that cannot report is taken`() {
        for (version in listOf("1.28.0", "1.28.1", "1.9.0", "0.99.0")) OnnxLibrary.check(version, null)
        OnnxLibrary.check(OnnxLibrary.environment().version, null)
    }

    @Test
    fun `a newer one is refused, with what to do`() {
        for (version in listOf("1.29.0", "1.29.0-rc1", "1.100.2", "2.0.0", "1", "", "nightly", "1.x.0")) {
            for (switch in listOf(null, "", "0")) {
                val error = assertThrows(RuntimeUnfit::class.java, { OnnxLibrary.check(version, switch) }, version)
                assertEquals("runtime_unfit", error.code)
                assertTrue("ONNX Runtime $version reports" in error.message, error.message)
                val words = listOf("strictly(\"1.28.0\")", "ORT_DISABLE_TELEMETRY=1")
                assertTrue(words.all { it in error.advice }, error.advice)
            }
        }
    }

    @Test
    fun `a newer one that is switched off is taken`() {
        OnnxLibrary.check("1.29.0", "1")
        OnnxLibrary.check("2.0.0", "1")
    }
}
