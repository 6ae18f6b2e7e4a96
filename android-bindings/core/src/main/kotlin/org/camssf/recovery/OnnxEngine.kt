package org.camssf.recovery

import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.Nodes
import org.camssf.Shipped
import kotlin.math.max

/** Runs the models of a basis and of the verdict with ONNX Runtime. */
internal class OnnxEngine private constructor(
    override val basis: String,
    private val model: OnnxSession,
    private val verdict: OnnxSession,
) : Engine {
    private var open = true

    override val sha256: String get() = model.sha256
    override val metadata: Map<String, String> =
        model.metadata + mapOf("basis" to basis, HASH to model.metadata["$HASH $basis"].orEmpty())

    override fun run(stack: List<ModelInputs>): List<ModelOutputs> {
        val outputs = answer(stack, true, ModelOutputs.NAMES)
        return stack.indices.map { i ->
            ModelOutputs { name ->
                val all = outputs.getValue(name).values
                val size = all.size / if (name == ModelOutputs.CHANNEL_GAIN) 1 else stack.size
                val start = if (name == ModelOutputs.CHANNEL_GAIN) 0 else i * size
                if (size == all.size) all else all.copyOfRange(start, start + size)
            }
        }
    }

    override fun logEvidences(stack: List<ModelInputs>): DoubleArray =
        answer(stack, false, listOf(ModelOutputs.EVIDENCE)).getValue(ModelOutputs.EVIDENCE).values

    override fun judge(inputs: Map<String, Tensor>, outputs: List<String>): Map<String, Tensor> {
        checkOpen()
        return verdict.run(inputs, outputs)
    }

    private fun checkOpen() = check(open) { "This SsfCalibrator was closed. Open another." }

    @Synchronized
    private fun answer(stack: List<ModelInputs>, solve: Boolean, outputs: List<String>): Map<String, Tensor> {
        checkOpen()
        val first = stack[0]
        val known = first.known

        /** Those of all hypotheses, or the first one's if they have all this in common. */
        fun differing(vararg values: (ModelInputs) -> Any) =
            if (stack.all { other -> values.all { it(other) === it(first) } }) listOf(first) else stack
        val signals = differing({ it.frames.chart }, { it.standardError })
        val charts = differing({ it.known.reflectance })
        val bases = differing({ it.basis }).mapNotNull { BasisConstants.of(it.basis) }
        val inputs = linkedMapOf(
            "chart" to Tensor.stack(signals.map { it.frames.chart }),
            "white" to first.frames.white,
            "dark" to first.frames.dark,
            "standard_error" to Tensor.stack(signals.map { it.standardError }),
            "reflectance" to Tensor.stack(charts.map { it.known.reflectance }),
            "chart_tolerance" to known.chartTolerance,
            "white_reflectance" to Tensor.stack(charts.map { it.known.whiteReflectance }),
            "white_tolerance" to Tensor.scalar(known.whiteTolerance),
            "lamp" to Tensor.stack(stack.map { it.known.lamp }),
            "lamp_tolerance" to Tensor.stack(stack.map { it.known.lampTolerance }),
            "lamp_modes" to lampModes(stack.map { it.known.lampModes }),
            "gain_modes" to gainModes(known.gains, first.frames.chart.shape),
            "gain_own" to Tensor.scalar(known.gains?.own ?: 0.0),
            "l2" to Tensor.scalar(first.l2),
            "gamma" to Tensor.scalar(first.gamma),
            "nonnegative" to Tensor.scalar(if (first.nonnegative) 1.0 else 0.0),
            "prior_scale" to Tensor.scalar(first.priorScale),
            "explain" to Tensor.scalar(if (first.explain) 1.0 else 0.0),
            "solve" to Tensor.scalar(if (solve) 1.0 else 0.0),
        )
        if (bases.isNotEmpty()) {
            inputs["mean"] = Tensor.stack(bases.map { Tensor(it.mean, 3, Nodes.SIZE) })
            inputs["dictionary"] = Tensor.stack(bases.map { Tensor(it.dictionary, 3, Nodes.SIZE, it.atoms) })
        }
        return model.run(inputs, outputs)
    }

    /** A second call does nothing. */
    @Synchronized
    override fun close() {
        if (!open) return
        open = false
        model.release()
        verdict.release()
    }

    companion object {
        const val PAPER = "gaussian"
        private const val HASH = "basis_sha256"
        private const val VERDICT = "camssf-verdict.onnx"
        private const val PAPER_ADVICE = "Add the artefact camssf-model-gaussian of camssf-core's version, unchanged."

        /**
         * The engine of a basis; its models are loaded unless another engine holds them. Checks the hashes of models and
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
            val advice = if (basis == PAPER) PAPER_ADVICE else Shipped.ADVICE
            return engine(basis) { OnnxSession.open(name, it, ModelOutputs.NAMES, advice) }
        }

        /** The engine of a basis from the content of its model's file. */
        internal fun open(basis: String, name: String, content: ByteArray): OnnxEngine =
            engine(basis) { OnnxSession.open(name, content, it, ModelOutputs.NAMES) }

        private fun engine(basis: String, open: (Map<String, String?>) -> OnnxSession): OnnxEngine {
            val model = open(
                buildMap {
                    put("$HASH $basis", null)
                    if (basis != PAPER) {
                        put("bases", BasisConstants.NAMES.joinToString(" "))
                        put("bases_sha256", BasisConstants.sha256)
                    }
                },
            )
            val verdict = try {
                OnnxSession.open(VERDICT, emptyMap(), emptyList())
            } catch (error: Throwable) {
                model.release()
                throw error
            }
            return OnnxEngine(basis, model, verdict)
        }

        /** (h, k, q, 681), padded with modes of zeros, which have no effect, to the largest number of modes, at least one. */
        private fun lampModes(modes: List<Tensor>): Tensor {
            val q = max(1, modes.maxOf { it.shape[1] })
            return Tensor.stack(
                modes.map { own ->
                    val (k, size) = own.shape
                    if (size == q) return@map own
                    val padded = Tensor.full(0.0, k, q, Grid.SIZE)
                    val row = size * Grid.SIZE
                    for (j in 0 until k) own.values.copyInto(padded.values, j * q * Grid.SIZE, j * row, (j + 1) * row)
                    padded
                },
            )
        }

        /** (k, g, n), one mode of zeros where there is none, for frames (k, n, 3). */
        fun gainModes(gains: Gains?, shape: IntArray): Tensor {
            val modes = gains?.modes
            if (modes != null && modes.values.isNotEmpty()) return modes
            return Tensor.full(0.0, shape.getOrElse(0) { 1 }, 1, shape.getOrElse(1) { 1 })
        }
    }
}
