package org.camssf.recovery

import ai.onnxruntime.OnnxTensor
import ai.onnxruntime.OrtException
import ai.onnxruntime.OrtLoggingLevel
import ai.onnxruntime.OrtSession
import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.Nodes
import org.camssf.model.Models
import java.nio.ByteBuffer
import java.nio.ByteOrder
import java.nio.DoubleBuffer
import kotlin.math.max

/** Runs a model with ONNX Runtime, with the options of the Python package, so that the numbers are the same. */
internal class OnnxEngine private constructor(override val basis: String, private val model: LoadedModel) : Engine {
    private var open = true

    override val sha256: String get() = model.sha256
    override val metadata: Map<String, String> =
        model.metadata + mapOf("basis" to basis, HASH to model.metadata["$HASH $basis"].orEmpty())

    override fun run(inputs: ModelInputs): ModelOutputs = answer(inputs, true) { ModelOutputs(it) }

    override fun logEvidences(inputs: ModelInputs): DoubleArray =
        answer(inputs, false) { it(ModelOutputs.EVIDENCE) }

    @Synchronized
    private fun <T> answer(inputs: ModelInputs, solve: Boolean, read: ((String) -> DoubleArray) -> T): T {
        check(open) { "This SsfCalibrator was closed. Open another." }
        val hypotheses = inputs.hypotheses
        val known = hypotheses[0]
        // One chart serves all hypotheses if they have the same one.
        val charts = if (hypotheses.all { it.reflectance === known.reflectance }) listOf(known) else hypotheses
        val given = linkedMapOf(
            "chart" to Tensor.stack(listOf(inputs.frames.chart)),
            "white" to inputs.frames.white,
            "dark" to inputs.frames.dark,
            "standard_error" to Tensor.stack(listOf(inputs.standardError)),
            "reflectance" to Tensor.stack(charts.map { it.reflectance }),
            "chart_tolerance" to known.chartTolerance,
            "white_reflectance" to Tensor.stack(charts.map { it.whiteReflectance }),
            "white_tolerance" to Tensor.scalar(known.whiteTolerance),
            "lamp" to Tensor.stack(hypotheses.map { it.lamp }),
            "lamp_tolerance" to Tensor.stack(hypotheses.map { it.lampTolerance }),
            "lamp_modes" to lampModes(hypotheses),
            "gain_modes" to gainModes(inputs),
            "gain_own" to Tensor.scalar(known.gains?.own ?: 0.0),
            "l2" to Tensor.scalar(inputs.l2),
            "gamma" to Tensor.scalar(inputs.gamma),
            "nonnegative" to Tensor.scalar(if (inputs.nonnegative) 1.0 else 0.0),
            "prior_scale" to Tensor.scalar(inputs.priorScale),
            "explain" to Tensor.scalar(if (inputs.explain) 1.0 else 0.0),
            "solve" to Tensor.scalar(if (solve) 1.0 else 0.0),
        )
        BasisConstants.of(basis)?.let {
            given["mean"] = Tensor(it.mean, 1, 3, Nodes.SIZE)
            given["dictionary"] = Tensor(it.dictionary, 1, 3, Nodes.SIZE, it.atoms)
        }
        val tensors = LinkedHashMap<String, OnnxTensor>()
        try {
            given.mapValuesTo(tensors) { tensor(it.value) }
            val wanted = if (solve) ModelOutputs.NAMES else listOf(ModelOutputs.EVIDENCE)
            model.session.run(tensors, wanted.toSet()).use { result ->
                return read { name ->
                    val buffer = (result.get(name).get() as OnnxTensor).doubleBuffer
                    DoubleArray(buffer.remaining()).also { buffer.get(it) }
                }
            }
        } catch (error: OrtException) {
            throw InvalidArgument("The model of '$basis' does not run: ${error.message}.", ADVICE, cause = error)
        } finally {
            tensors.values.forEach { it.close() }
        }
    }

    /** (h, k, q, 681), padded with modes of zeros, which have no effect, to the largest number of modes, at least one. */
    private fun lampModes(hypotheses: List<Known>): Tensor {
        val q = max(1, hypotheses.maxOf { it.lampModes.shape[1] })
        return Tensor.stack(
            hypotheses.map { known ->
                val modes = known.lampModes
                val (k, own) = modes.shape
                if (own == q) return@map modes
                val padded = Tensor.full(0.0, k, q, Grid.SIZE)
                val size = own * Grid.SIZE
                for (j in 0 until k) modes.values.copyInto(padded.values, j * q * Grid.SIZE, j * size, (j + 1) * size)
                padded
            },
        )
    }

    private fun gainModes(inputs: ModelInputs): Tensor {
        val modes = inputs.hypotheses[0].gains?.modes
        if (modes != null && modes.values.isNotEmpty()) return modes
        val shape = inputs.frames.chart.shape
        return Tensor.full(0.0, shape.getOrElse(0) { 1 }, 1, shape.getOrElse(1) { 1 })
    }

    private fun tensor(value: Tensor): OnnxTensor {
        val bytes = ByteBuffer.allocateDirect(8 * value.values.size).order(ByteOrder.nativeOrder())
        val buffer: DoubleBuffer = bytes.asDoubleBuffer()
        buffer.put(value.values)
        buffer.rewind()
        return OnnxTensor.createTensor(model.environment, buffer, LongArray(value.rank) { value.shape[it].toLong() })
    }

    /** A second call does nothing. */
    @Synchronized
    override fun close() {
        if (!open) return
        open = false
        model.release()
    }

    /** A model's session, which the engines of the learned bases share: the last one that closes closes it. */
    private class LoadedModel(content: ByteArray) {
        val environment = OnnxLibrary.environment()
        private val options = OrtSession.SessionOptions()
        val session: OrtSession
        val sha256: String = Models.sha256(content)
        val metadata: Map<String, String>
        var users = 0

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
                close()
                throw error
            }
        }

        fun release(): Unit = synchronized(shared) {
            users -= 1
            if (users == 0) {
                shared.values.remove(this)
                close()
            }
        }

        /** ONNX Runtime's environment stays open. The options must be closed after their session. */
        private fun close() {
            session.close()
            options.close()
        }
    }

    companion object {
        const val PAPER = "gaussian"
        private const val HASH = "basis_sha256"
        private const val VOCABULARY = "1"
        private const val GRID = "380 to 720 nm every 0.5 nm"
        private const val ADVICE = "Add the artefacts camssf-core and camssf-model of one version, unchanged."
        private const val PAPER_ADVICE = "Add the artefact camssf-model-gaussian of camssf-core's version, unchanged."

        /** Open models by the names of their files. */
        private val shared = HashMap<String, LoadedModel>()

        /**
         * The engine of a basis; its model is loaded unless another engine holds it. Checks the hashes of model and
         * bases, grid and vocabulary.
         *
         * @throws InvalidArgument there is no such model, or it does not belong to this version.
         */
        fun load(basis: String): OnnxEngine {
            if (basis !in SHIPPED_BASES) {
                val known = listOf(Choice.AUTO) + SHIPPED_BASES
                throw InvalidArgument("There is no basis '$basis'.", "Take one of ${known.joinToString()}.")
            }
            val name = if (basis == PAPER) "camssf-$PAPER.onnx" else "camssf-learned.onnx"
            return synchronized(shared) {
                val advice = if (basis == PAPER) PAPER_ADVICE else ADVICE
                val model =
                    shared[name] ?: loaded(name, shipped(advice) { Models.read(name) }).also { shared[name] = it }
                engine(basis, name, model)
            }
        }

        /** Reads from the shipped files; one that is missing or changed is [InvalidArgument]. */
        private fun <T> shipped(advice: String, read: () -> T): T = try {
            read()
        } catch (error: IllegalStateException) {
            throw InvalidArgument(error.message.orEmpty(), advice, cause = error)
        }

        /** The engine of a basis from the content of its model's file. */
        internal fun open(basis: String, name: String, content: ByteArray): OnnxEngine =
            engine(basis, name, loaded(name, content))

        private fun loaded(name: String, content: ByteArray): LoadedModel = try {
            LoadedModel(content)
        } catch (error: OrtException) {
            throw InvalidArgument("The model $name cannot be loaded: ${error.message}.", ADVICE, cause = error)
        }

        private fun engine(basis: String, name: String, model: LoadedModel): OnnxEngine {
            val bases = if (basis == PAPER) null else shipped(ADVICE) { BasisConstants.sha256 }
            model.users += 1
            val wanted = buildMap {
                put("vocabulary", VOCABULARY)
                put("grid", GRID)
                if (bases != null) {
                    put("bases", BasisConstants.NAMES.joinToString(" "))
                    put("bases_sha256", bases)
                }
            }
            val differs = wanted.filter { (key, value) -> model.metadata[key] != value }.keys +
                listOf("$HASH $basis").filter { it !in model.metadata } +
                ModelOutputs.NAMES.filter { it !in model.session.outputNames }
            if (differs.isNotEmpty()) {
                model.release()
                throw InvalidArgument(
                    "The model $name differs from this version in ${differs.joinToString()}.",
                    ADVICE,
                )
            }
            return OnnxEngine(basis, model)
        }
    }
}
