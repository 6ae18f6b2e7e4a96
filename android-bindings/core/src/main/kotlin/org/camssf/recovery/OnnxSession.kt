package org.camssf.recovery

import org.camssf.InvalidArgument
import org.camssf.Shipped
import org.camssf.model.Models

/** A model that those who open the same file share: the last one that releases it closes it. */
internal class OnnxSession private constructor(private val model: OnnxModel, content: ByteArray) {
    private var users = 0

    val sha256: String = Models.sha256(content)
    val metadata: Map<String, String> get() = model.metadata

    /** As [OnnxModel.run]. */
    fun run(inputs: Map<String, Tensor>, outputs: List<String>): Map<String, Tensor> = model.run(inputs, outputs)

    /** Ends one use; the last one closes the model. */
    fun release(): Unit = synchronized(shared) {
        users -= 1
        if (users == 0) {
            shared.values.remove(this)
            model.close()
        }
    }

    /** One more use; a null in `metadata` stands for any value. */
    private fun used(metadata: Map<String, String?>, outputs: List<String>): OnnxSession {
        users += 1
        val every = mapOf("vocabulary" to VOCABULARY, "grid" to GRID) + metadata
        val differs = every.filter { (key, wanted) ->
            val value = model.metadata[key]
            value == null || (wanted != null && wanted != value)
        }.keys + outputs.filter { it !in model.outputs }
        if (differs.isEmpty()) return this
        release()
        val names = differs.joinToString()
        throw InvalidArgument("The model ${model.name} differs from this version in $names.", Shipped.ADVICE)
    }

    companion object {
        private const val VOCABULARY = "1"
        private const val GRID = "380 to 720 nm every 0.5 nm"

        /** Open models by the names of their files. */
        private val shared = HashMap<String, OnnxSession>()

        /**
         * Opens a shipped model, and checks its hash, grid and vocabulary. Each use ends with [release].
         *
         * @param metadata what else the model must say of itself.
         * @param outputs that it must have.
         * @param advice where the file is missing.
         * @throws InvalidArgument the model is missing or does not belong to this version.
         */
        fun open(
            name: String,
            metadata: Map<String, String?>,
            outputs: List<String>,
            advice: String = Shipped.ADVICE,
        ): OnnxSession = synchronized(shared) {
            shared.getOrPut(name) { loaded(name, Shipped.bytes(name, advice)) }.used(metadata, outputs)
        }

        /** As the other function, from the content of a file that nobody shares. */
        fun open(name: String, content: ByteArray, metadata: Map<String, String?>, outputs: List<String>) =
            loaded(name, content).used(metadata, outputs)

        private fun loaded(name: String, content: ByteArray) =
            OnnxSession(OnnxModel(name, content, Shipped.ADVICE), content)
    }
}
