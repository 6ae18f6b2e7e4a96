package org.camssf.curves

import org.camssf.model.Models
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertThrows
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test

/** Models without the defaults of their inputs; each session is told all of them. */
class DefaultsTest {
    /** A field that bears its length, shorter than 128 bytes. */
    private fun field(number: Int, content: ByteArray) =
        byteArrayOf((number shl 3 or 2).toByte(), content.size.toByte()) + content

    private fun text(number: Int, words: String) = field(number, words.toByteArray())

    private val version = byteArrayOf(8, 10)
    private val other = byteArrayOf(0x1d, 1, 2, 3, 4) + byteArrayOf(0x21) + ByteArray(8) + text(14, "metadata")

    private fun tensor(name: String) = field(5, byteArrayOf(16, 11) + text(8, name))

    private fun input(name: String) = field(11, text(1, name) + text(2, "type"))

    @Test
    fun `of the initializers only an input's go`() {
        val kept = tensor("weight") + text(1, "node") + input("scale") + input("chart")
        val model = version + field(7, tensor("scale") + kept) + other
        assertArrayEquals(version + field(7, kept) + other, Defaults.without(model))
        val bare = version + field(7, kept) + other
        assertArrayEquals(bare, Defaults.without(bare))
    }

    @Test
    fun `lengths of more than a byte`() {
        fun long(number: Int, content: ByteArray): ByteArray {
            val (low, high) = (content.size and 0x7f or 0x80).toByte() to (content.size shr 7).toByte()
            return byteArrayOf((number shl 3 or 2).toByte(), low, high) + content
        }
        val rest = input("scale") + long(5, text(8, "weight") + text(9, "x".repeat(100)) + text(9, "y".repeat(99)))
        val model = long(7, tensor("scale") + rest) + other
        assertArrayEquals(long(7, rest) + other, Defaults.without(model))
    }

    @Test
    fun `the shipped models lose two scalars and nothing else`() {
        for (name in SHIPPED_BASES) {
            val model = Models.read("camssf-$name.onnx")
            val bare = Defaults.without(model)
            assertTrue(model.size - bare.size in 20..100, "$name: ${model.size - bare.size} bytes")
            assertArrayEquals(bare, Defaults.without(bare))
        }
    }

    @Test
    fun `what is no model is refused`() {
        val model = version + field(7, tensor("scale") + input("scale")) + other
        for (size in 1 until model.size) {
            // A file that ends between two fields after its graph is one still.
            val ends = setOf(2 + 2 + model[3], 2 + 2 + model[3] + 5, 2 + 2 + model[3] + 14)
            if (size in ends) continue
            assertThrows(DamagedModel::class.java, { Defaults.without(model.copyOf(size)) }, "$size bytes")
        }
        val broken = listOf(
            ByteArray(0), ByteArray(10), version, byteArrayOf(0x3f, 1), ByteArray(20) { -1 },
            byteArrayOf(0x3a, -1, -1, -1, -1, -1, -1, -1, -1, -1, 1),
        )
        for (bytes in broken) assertThrows(DamagedModel::class.java) { Defaults.without(bytes) }
    }
}
