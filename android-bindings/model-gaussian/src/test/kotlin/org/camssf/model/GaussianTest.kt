package org.camssf.model

import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertFalse
import org.junit.jupiter.api.Test
import java.io.File

class GaussianTest {
    @Test
    fun `Models reads Python's own file from this jar, with its hash`() {
        val name = "camssf-gaussian.onnx"
        assertFalse(name in Models.NAMES)
        val file = File(System.getProperty("camssf.root"), "reference/camssf/data/$name")
        assertArrayEquals(file.readBytes(), Models.read(name))
    }
}
