package org.camssf.recovery

import ai.onnxruntime.OnnxTensor
import ai.onnxruntime.OrtException
import ai.onnxruntime.OrtLoggingLevel
import ai.onnxruntime.OrtSession
import org.camssf.InvalidArgument
import org.camssf.model.Models
import java.nio.ByteBuffer
import java.nio.ByteOrder

/**
 * A loaded model: one thread, sequentially, on the CPU, with the options of the Python package, so that the numbers are
 * the same. Those that open the same file share one session; the last one that closes closes it.
 *
 * @property name of its file.
 */
internal class OnnxSession private constructor(val name: String, content: ByteArray) {
    private val environment = OnnxLibrary.environment()
    private val options = OrtSession.SessionOptions()
    private val session: OrtSession
    private var users = 0

    val sha256: String = Models.sha256(content)
    val metadata: Map<String, String>
    val outputs: Set<String> get() = session.outputNames

    init {
        try {
            options.setIntraOpNumThreads(1)
            options.setInterOpNumThreads(1)
            options.setExecutionMode(OrtSession.SessionOptions.ExecutionMode.SEQUENTIAL)
            // No optimisation: the graph that runs is the one that was checked, and it loads faster.
            options.setOptimizationLevel(OrtSession.SessionOptions.OptLevel.NO_OPT)
            options.setSessionLogLevel(OrtLoggingLevel.ORT_LOGGING_LEVEL_ERROR)
            options.addConfigEntry("session.intra_op.allow_spinning", "0")
            options.addConfigEntry("mlas.disable_kleidiai", "1")
            session = environment.createSession(content, options)
        } catch (error: Throwable) {
            options.close()
            throw error
        }
        metadata = try {
            session.metadata.customMetadata
        } catch (error: Throwable) {
            free()
            throw error
        }
    }

    /**
     * Runs the model; calls from several threads wait for each other.
     *
     * @param outputs names of those that are wanted.
     * @return row-major copies that stay valid.
     * @throws InvalidArgument ONNX Runtime refuses the inputs.
     */
    @Synchronized
    fun run(inputs: Map<String, Tensor>, outputs: List<String>): Map<String, DoubleArray> {
        val tensors = LinkedHashMap<String, OnnxTensor>()
        try {
            inputs.mapValuesTo(tensors) { tensor(it.value) }
            session.run(tensors, outputs.toSet()).use { result ->
                return outputs.associateWith { name ->
                    val buffer = (result.get(name).get() as OnnxTensor).doubleBuffer
                    DoubleArray(buffer.remaining()).also { buffer.get(it) }
                }
            }
        } catch (error: OrtException) {
            throw InvalidArgument("The model $name does not run: ${error.message}.", ADVICE, cause = error)
        } finally {
            tensors.values.forEach { it.close() }
        }
    }

    private fun tensor(value: Tensor): OnnxTensor {
        val bytes = ByteBuffer.allocateDirect(8 * value.values.size).order(ByteOrder.nativeOrder())
        val buffer = bytes.asDoubleBuffer()
        buffer.put(value.values)
        buffer.rewind()
        return OnnxTensor.createTensor(environment, buffer, LongArray(value.rank) { value.shape[it].toLong() })
    }

    /** Ends one use; the last one frees the session. */
    fun release(): Unit = synchronized(shared) {
        users -= 1
        if (users == 0) {
            shared.values.remove(this)
            free()
        }
    }

    /** ONNX Runtime's environment stays open. The options must be closed after their session. */
    private fun free() {
        session.close()
        options.close()
    }

    companion object {
        const val ADVICE = "Add the artefacts camssf-core and camssf-model of one version, unchanged."
        private const val VOCABULARY = "1"
        private const val GRID = "380 to 720 nm every 0.5 nm"

        /** Open models by the names of their files. */
        private val shared = HashMap<String, OnnxSession>()

        /**
         * Opens a shipped model, and checks its hash, grid and vocabulary. Each use ends with [release].
         *
         * @param metadata what else the model must say of itself.
         * @param outputs that it must have.
         * @throws InvalidArgument the model is missing or does not belong to this version.
         */
        fun open(name: String, metadata: Map<String, String?>, outputs: List<String>): OnnxSession =
            synchronized(shared) {
                val session = shared[name] ?: loaded(name, shipped { Models.read(name) }).also { shared[name] = it }
                session.used(metadata, outputs)
            }

        /** As the other function, from the content of a file that nobody shares. */
        fun open(name: String, content: ByteArray, metadata: Map<String, String?>, outputs: List<String>) =
            loaded(name, content).used(metadata, outputs)

        /** Reads from the shipped files; one that is missing or changed is [InvalidArgument]. */
        fun <T> shipped(read: () -> T): T = try {
            read()
        } catch (error: IllegalStateException) {
            throw InvalidArgument(error.message.orEmpty(), ADVICE, cause = error)
        }

        private fun loaded(name: String, content: ByteArray): OnnxSession = try {
            OnnxSession(name, content)
        } catch (error: OrtException) {
            throw InvalidArgument("The model $name cannot be loaded: ${error.message}.", ADVICE, cause = error)
        }

        /** One more use; a null in `wanted` stands for any value. */
        private fun OnnxSession.used(wanted: Map<String, String?>, outputs: List<String>): OnnxSession {
            users += 1
            val every = mapOf("vocabulary" to VOCABULARY, "grid" to GRID) + wanted
            val differs =
                every.filter { (key, value) -> metadata[key].let { it == null || (value ?: it) != it } }.keys +
                    outputs.filter { it !in this.outputs }
            if (differs.isEmpty()) return this
            release()
            throw InvalidArgument("The model $name differs from this version in ${differs.joinToString()}.", ADVICE)
        }
    }
}
