package org.camssf.recovery

import org.camssf.Nodes
import org.camssf.Shipped
import org.camssf.model.Models
import java.nio.ByteBuffer
import java.nio.ByteOrder

/**
 * A learned basis on the nodes, as the model takes it and colour and verdict use it.
 *
 * @property mean μ, (3, 69).
 * @property dictionary Ψ, (3, 69, r).
 */
internal class BasisConstants private constructor(val mean: DoubleArray, val dictionary: DoubleArray) {
    /** r, the number of atoms of each channel. */
    val atoms: Int get() = dictionary.size / mean.size

    /** SHA-256 of mean and dictionary, rounded to 12 decimals: what a result and a model state as `basis_sha256`. */
    val roundedSha256: String by lazy {
        val numbers = mean + dictionary
        val bytes = ByteBuffer.allocate(Double.SIZE_BYTES * numbers.size).order(ByteOrder.LITTLE_ENDIAN)
        for (number in numbers) bytes.putDouble(Math.rint(number * 1e12) / 1e12 + 0.0)
        Models.sha256(bytes.array())
    }

    companion object {
        /** Names of the learned bases, in the order of their file. */
        val NAMES = listOf("cameras", "phones", "ryyb")

        private const val FILE = "bases.f64"
        private val content by lazy { Shipped.bytes(FILE) }
        private val made = HashMap<String, BasisConstants>()

        /** SHA-256 of the file of the bases, lower-case hex. */
        val sha256: String by lazy { Models.sha256(content) }

        /** The basis of this name; null if it is none of [NAMES]. */
        fun of(name: String): BasisConstants? = if (name in NAMES) {
            synchronized(made) { made.getOrPut(name) { read(NAMES.indexOf(name)) } }
        } else {
            null
        }

        /**
         * (3, 69) one standard deviation of what curves of peak 1 miss besides their bands, on every learned basis.
         * Python's `misfit_profile`.
         */
        val misfit: DoubleArray by lazy {
            val numbers = numbers()
            numbers.position(numbers.limit() - CURVES)
            DoubleArray(CURVES).also { numbers.get(it) }
        }

        private fun numbers() = ByteBuffer.wrap(content).order(ByteOrder.LITTLE_ENDIAN).asDoubleBuffer()

        private const val CURVES = 3 * Nodes.SIZE

        /** Of each basis μ (3, 69), then Ψ (3, 69, r); last the misfit profile: float64, little-endian. */
        private fun read(at: Int): BasisConstants {
            val numbers = numbers()
            val mean = DoubleArray(CURVES)
            val size = (numbers.remaining() - CURVES) / NAMES.size
            check(size % mean.size == 0 && size > mean.size) { "$FILE has ${numbers.remaining()} numbers" }
            numbers.position(at * size)
            numbers.get(mean)
            return BasisConstants(mean, DoubleArray(size - mean.size).also { numbers.get(it) })
        }
    }
}
