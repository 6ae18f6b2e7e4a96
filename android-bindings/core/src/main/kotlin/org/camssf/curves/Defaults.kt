package org.camssf.curves

/** A model file breaks off, or holds what no model does. */
internal class DamagedModel(message: String) : Exception(message)

/**
 * A model whose inputs have no defaults: every call must then tell them.
 *
 * A default is an initializer of the graph that bears an input's name. In the file, of Protocol Buffers, the graph is the
 * model's field 7, initializers are the graph's fields 5 and inputs its fields 11, whose names are their fields 8 and 1.
 * All else is copied as it stands.
 */
internal object Defaults {
    private const val GRAPH = 7
    private const val INITIALIZER = 5
    private const val INPUT = 11
    private const val TENSOR_NAME = 8
    private const val INPUT_NAME = 1

    /**
     * The model without them.
     *
     * @throws DamagedModel it is no model.
     */
    fun without(model: ByteArray): ByteArray {
        val fields = fields(model, 0, model.size)
        val graph = fields.singleOrNull { it.number == GRAPH } ?: throw DamagedModel("it holds no graph")
        val parts = fields(model, graph.from, graph.until)
        val inputs = parts.filter { it.number == INPUT }.map { name(model, it, INPUT_NAME) }.toSet()
        val kept = parts.filterNot { it.number == INITIALIZER && name(model, it, TENSOR_NAME) in inputs }
        val size = varint(kept.sumOf { it.until - it.start })
        val tag = byteArrayOf((GRAPH shl 3 or LENGTH).toByte())
        val inside = kept.map { model.copyOfRange(it.start, it.until) }
        val before = model.copyOfRange(0, graph.start)
        return joined(listOf(before, tag, size) + inside + model.copyOfRange(graph.until, model.size))
    }

    private fun name(model: ByteArray, of: Field, number: Int): String {
        val found = fields(model, of.from, of.until).lastOrNull { it.number == number } ?: return ""
        return String(model, found.from, found.until - found.from, Charsets.UTF_8)
    }

    private fun joined(parts: List<ByteArray>): ByteArray {
        val all = ByteArray(parts.sumOf { it.size })
        parts.fold(0) { at, part ->
            part.copyInto(all, at)
            at + part.size
        }
        return all
    }

    /** A field of a message: its number, where it starts with its tag, and where its content is. */
    private class Field(val number: Int, val start: Int, val from: Int, val until: Int)

    private fun fields(bytes: ByteArray, from: Int, until: Int): List<Field> {
        val found = ArrayList<Field>()
        val walk = Walk(bytes, from, until)
        while (walk.at < until) {
            val start = walk.at
            val tag = walk.varint()
            val size = when ((tag and 7).toInt()) {
                0 -> 0L.also { walk.varint() }
                1 -> 8L
                LENGTH -> walk.varint()
                5 -> 4L
                else -> throw DamagedModel("it is no ONNX file")
            }
            if (size < 0 || size > until - walk.at) throw DamagedModel("it breaks off")
            found += Field((tag ushr 3).toInt(), start, walk.at, walk.at + size.toInt())
            walk.at += size.toInt()
        }
        return found
    }

    private class Walk(private val bytes: ByteArray, var at: Int, private val until: Int) {
        /** Seven bits a byte, the lowest first. */
        fun varint(): Long {
            var value = 0L
            for (shift in 0 until 64 step 7) {
                if (at >= until) throw DamagedModel("it breaks off")
                val byte = bytes[at++].toLong()
                value = value or ((byte and 0x7f) shl shift)
                if (byte >= 0) return value
            }
            throw DamagedModel("it is no ONNX file")
        }
    }

    private fun varint(value: Int): ByteArray {
        val bytes = ArrayList<Byte>()
        var rest = value
        while (rest >= 0x80) {
            bytes += (rest and 0x7f or 0x80).toByte()
            rest = rest ushr 7
        }
        return (bytes + rest.toByte()).toByteArray()
    }

    /** The wire type of what bears its length. */
    private const val LENGTH = 2
}
