package org.camssf.recovery

import ai.onnxruntime.OnnxTensor
import ai.onnxruntime.OnnxValue
import ai.onnxruntime.OrtEnvironment
import ai.onnxruntime.OrtException
import org.camssf.InvalidArgument
import java.nio.ByteBuffer
import java.nio.ByteOrder

/**
 * A model as a function of tensors by name. It stays open as long as the process; thread-safe.
 *
 * @param name of its file.
 * @param advice what to do if it cannot be loaded or run.
 * @throws InvalidArgument the content is no model.
 */
internal class OnnxModel(private val name: String, content: ByteArray, private val advice: String) {
    private val environment = OnnxLibrary.environment()
    private val options = OnnxLibrary.options()
    private val session = explained { environment.createSession(content, options) }

    fun run(inputs: Map<String, Tensor>): Map<String, Tensor> {
        val tensors = LinkedHashMap<String, OnnxTensor>()
        try {
            return explained {
                inputs.mapValuesTo(tensors) { it.value.onnx(environment) }
                session.run(tensors).use { result -> result.associate { (name, value) -> name to tensorOf(value) } }
            }
        } finally {
            tensors.values.forEach { it.close() }
        }
    }

    private inline fun <T> explained(work: () -> T): T = try {
        work()
    } catch (error: OrtException) {
        throw InvalidArgument("The model $name does not run: ${error.message}.", advice, cause = error)
    }
}

/** The same numbers for ONNX Runtime; the caller closes them. */
internal fun Tensor.onnx(environment: OrtEnvironment): OnnxTensor {
    val buffer = ByteBuffer.allocateDirect(8 * values.size).order(ByteOrder.nativeOrder()).asDoubleBuffer()
    buffer.put(values)
    buffer.rewind()
    return OnnxTensor.createTensor(environment, buffer, LongArray(rank) { shape[it].toLong() })
}

/** A copy of an output. */
internal fun tensorOf(value: OnnxValue): Tensor {
    val tensor = value as OnnxTensor
    val buffer = tensor.doubleBuffer
    val values = DoubleArray(buffer.remaining()).also { buffer.get(it) }
    return Tensor(values, *IntArray(tensor.info.shape.size) { tensor.info.shape[it].toInt() })
}
