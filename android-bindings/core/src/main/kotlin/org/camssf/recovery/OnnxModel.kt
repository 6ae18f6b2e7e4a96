package org.camssf.recovery

import ai.onnxruntime.OnnxTensor
import ai.onnxruntime.OnnxValue
import ai.onnxruntime.OrtEnvironment
import ai.onnxruntime.OrtException
import org.camssf.InvalidArgument
import java.io.Closeable
import java.nio.ByteBuffer
import java.nio.ByteOrder

/**
 * A model as a function of tensors by name: one thread, sequentially, on the CPU. Calls from several threads wait for
 * each other.
 *
 * @property name of its file.
 * @param advice what to do if it cannot be loaded or run.
 * @throws InvalidArgument the content is no model.
 */
internal class OnnxModel(val name: String, content: ByteArray, private val advice: String) : Closeable {
    private val environment = OnnxLibrary.environment()
    private val options = OnnxLibrary.options()
    private val session = try {
        explained("cannot be loaded") { environment.createSession(content, options) }
    } catch (error: Throwable) {
        options.close()
        throw error
    }

    val metadata: Map<String, String> = try {
        session.metadata.customMetadata
    } catch (error: Throwable) {
        close()
        throw error
    }
    val outputs: Set<String> get() = session.outputNames

    /**
     * Copies of the outputs, row-major.
     *
     * @param outputs names of those that are wanted.
     * @throws InvalidArgument ONNX Runtime refuses the inputs.
     */
    @Synchronized
    fun run(inputs: Map<String, Tensor>, outputs: Collection<String> = session.outputNames): Map<String, Tensor> {
        val tensors = LinkedHashMap<String, OnnxTensor>()
        try {
            return explained("does not run") {
                inputs.mapValuesTo(tensors) { onnx(it.value) }
                session.run(tensors, outputs.toSet()).use { result ->
                    result.associate { (name, value) -> name to copied(value) }
                }
            }
        } finally {
            tensors.values.forEach { it.close() }
        }
    }

    private fun onnx(tensor: Tensor): OnnxTensor {
        val bytes = ByteBuffer.allocateDirect(8 * tensor.values.size).order(ByteOrder.nativeOrder())
        val buffer = bytes.asDoubleBuffer()
        buffer.put(tensor.values)
        buffer.rewind()
        val shape = LongArray(tensor.rank) { tensor.shape[it].toLong() }
        return OnnxTensor.createTensor(environment, buffer, shape)
    }

    private fun copied(value: OnnxValue): Tensor {
        val tensor = value as OnnxTensor
        val buffer = tensor.doubleBuffer
        val values = DoubleArray(buffer.remaining()).also { buffer.get(it) }
        return Tensor(values, *IntArray(tensor.info.shape.size) { tensor.info.shape[it].toInt() })
    }

    private inline fun <T> explained(fault: String, work: () -> T): T = try {
        work()
    } catch (error: OrtException) {
        throw InvalidArgument("The model $name $fault: ${error.message}.", advice, cause = error)
    }

    /** ONNX Runtime's environment stays open. The options must be closed after their session. */
    override fun close() {
        session.close()
        options.close()
    }
}
