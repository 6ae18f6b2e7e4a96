package org.camssf.model

import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Test
import java.io.File

class ModelsTest {
    @Test
    fun `resources are Python's own files`() {
        val folder = File(System.getProperty("camssf.root"), "reference/camssf/data")
        for (name in listOf("camssf-cameras.onnx", "camssf-gaussian.onnx")) {
            assertArrayEquals(File(folder, name).readBytes(), Models.open(name).use { it.readBytes() })
        }
    }

    @Test
    fun `a missing file is named`() {
        val error = assertThrows(IllegalStateException::class.java) { Models.open("no.onnx") }
        check("no.onnx" in error.message!!)
    }
}
