package org.camssf.model

import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import java.io.File

class ModelsTest {
    private val folder = File(System.getProperty("camssf.root"), "reference/camssf/data")

    @Test
    fun `resources are Python's own files`() {
        for (name in Models.NAMES) assertArrayEquals(File(folder, name).readBytes(), Models.read(name))
    }

    @Test
    fun `one changed bit is refused`() {
        for (name in Models.NAMES) {
            val content = Models.read(name)
            content[content.size / 2] = (content[content.size / 2].toInt() xor 1).toByte()
            val hash = Models.open("$name.sha256").use { it.readBytes() }
            val error = assertThrows(IllegalStateException::class.java) { Models.checked(name, content, hash) }
            assertTrue(name in error.message!!)
        }
    }

    @Test
    fun `a file that the app lost is named`() {
        assertTrue("no.onnx" in assertThrows(IllegalStateException::class.java) { Models.open("no.onnx") }.message!!)
    }

    @Test
    fun `hash of the empty file`() {
        val known = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
        assertEquals(known, Models.sha256(ByteArray(0)))
    }
}
