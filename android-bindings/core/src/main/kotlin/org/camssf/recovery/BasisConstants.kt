package org.camssf.recovery

import org.camssf.Nodes
import org.camssf.model.Models
import java.nio.ByteBuffer
import java.nio.ByteOrder

/**
 * A learned basis on the nodes, read from the constants `mean` and `dictionary` of its ONNX model. They are the
 * numbers that the curves were computed with, so no second table is shipped.
 *
 * @property mean μ, (3, 69).
 * @property dictionary Ψ, (3, 69, r).
 */
internal class BasisConstants private constructor(val mean: DoubleArray, val dictionary: DoubleArray) {
    /** r, the number of atoms of each channel. */
    val atoms: Int get() = dictionary.size / mean.size

    companion object {
        private val NAMES = SHIPPED_BASES - "gaussian"
        private val made = HashMap<String, BasisConstants>()

        /** The basis of the shipped model of this name; null for any other name. */
        fun of(name: String): BasisConstants? = if (name in NAMES) {
            synchronized(made) { made.getOrPut(name) { read(Models.read("camssf-$name.onnx")) } }
        } else {
            null
        }

        private fun read(model: ByteArray): BasisConstants {
            val tensors = Message(ByteBuffer.wrap(model)).all(GRAPH)
                .flatMap { Message(it).all(INITIALIZER) }.map { Constant(it) }
            val mean = tensors.single { it.name == "mean" }.values
            val atoms = tensors.single { it.name == "dictionary" }.values
            check(mean.size == 3 * Nodes.SIZE && atoms.isNotEmpty() && atoms.size % mean.size == 0) {
                "another model"
            }
            return BasisConstants(mean, atoms)
        }

        private const val GRAPH = 7
        private const val INITIALIZER = 5
        private const val NAME = 8
        private const val RAW_DATA = 9
    }

    /** A TensorProto of float64. */
    private class Constant(content: ByteBuffer) {
        private val message = Message(content)
        val name: String = message.all(NAME).single().let { each ->
            ByteArray(each.remaining()).also { each.get(it) }.decodeToString()
        }

        /** Read only for the two constants that are needed: others have other types. */
        val values: DoubleArray by lazy {
            val raw = message.all(RAW_DATA).single().order(ByteOrder.LITTLE_ENDIAN).asDoubleBuffer()
            DoubleArray(raw.remaining()).also { raw.get(it) }
        }
    }

    /** A protocol-buffers message: returns the length-delimited fields of a number and skips all others. */
    private class Message(private val content: ByteBuffer) {
        fun all(field: Int): List<ByteBuffer> {
            val at = content.duplicate()
            val found = ArrayList<ByteBuffer>()
            while (at.hasRemaining()) {
                val key = whole(at).toInt()
                when (key and 7) {
                    0 -> whole(at)

                    1 -> at.position(at.position() + 8)

                    2 -> {
                        val size = whole(at).toInt()
                        if (key shr 3 == field) found += at.slice().apply { limit(size) }
                        at.position(at.position() + size)
                    }

                    else -> at.position(at.position() + 4)
                }
            }
            return found
        }

        private fun whole(at: ByteBuffer): Long {
            var value = 0L
            var shift = 0
            while (true) {
                val byte = at.get().toLong()
                value = value or (byte and 127 shl shift)
                if (byte >= 0) return value
                shift += 7
            }
        }
    }
}
