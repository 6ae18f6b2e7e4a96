package org.camssf.recovery

import java.io.Closeable

/**
 * The inputs of a model for one hypothesis. The hypotheses of a stack differ in basis, chart frame, standard error,
 * reflectances, lamps and lamp modes alone, and either all or none have modes.
 *
 * @property basis name of the basis.
 * @property standardError (k, n, 3) of the signals.
 * @property known what is known of chart, white and lamps.
 * @property l2 λ₂.
 * @property gamma γ, one number.
 * @property nonnegative whether x ≥ 0 is required.
 * @property priorScale width of the prior relative to the learned one.
 * @property explain whether `budget` and `predicted_std` are computed, which takes a quarter of the time more.
 */
internal class ModelInputs(
    val basis: String,
    val frames: Frames,
    val standardError: Tensor,
    val known: Known,
    val l2: Double,
    val gamma: Double,
    val nonnegative: Boolean,
    val priorScale: Double = 1.0,
    val explain: Boolean = false,
)

/**
 * The outputs of a model, by its own names: row-major copies that stay valid after the run.
 *
 * For k shots, n patches, r coefficients a channel and p problems (1 on a basis with a mean, whose channels are one
 * problem, else 3) the shapes are: `ssf`, `ssf_std` (681, 3), `code` (r, 3), `code_covariance` (3 r, 3 r), `signals`,
 * `predicted` (k, n, 3), `gap` (3), `layers_gap`, `finish_steps` (p), `evidence` (1), `channel_gain` (3),
 * `lamp_estimate` (k, 681); for q lamp modes a shot `mode_estimate` (k, q) and `mode_covariance` (k q, k q); for g
 * gain modes a shot `gain_code` (k, g); with `explain` `predicted_std` (k, n, 3) and `budget` (7, 3), else NaN.
 * `ssf_std`, `code_covariance`, `evidence`, `mode_estimate`, `mode_covariance`, `predicted_std` and `budget` are NaN
 * on a basis without a prior.
 */
internal class ModelOutputs private constructor(private val found: Map<String, DoubleArray>) {
    /** Reads every output. */
    constructor(read: (String) -> DoubleArray) : this(NAMES.associateWith(read))

    operator fun get(name: String): DoubleArray = found.getValue(name)

    companion object {
        const val EVIDENCE = "evidence"

        /** The only output that a stack has in common. */
        const val CHANNEL_GAIN = "channel_gain"
        val NAMES = listOf(
            "ssf", "ssf_std", "code", "code_covariance", "signals", "predicted", "gap", "layers_gap", "finish_steps",
            EVIDENCE, CHANNEL_GAIN, "lamp_estimate", "mode_estimate", "mode_covariance", "gain_code",
            "predicted_std", "budget",
        )

        /** Outputs of the paper's model whose last axis is the channel, each from its own problem. */
        private val BY_CHANNEL = setOf("ssf", "ssf_std", "code", "predicted", "gap", "layers_gap", "finish_steps")

        /**
         * Combines the runs of the three channels: outputs by channel from the channel's run, all others, which do
         * not depend on the penalty, from red's.
         */
        fun byChannel(answers: List<ModelOutputs>): ModelOutputs = ModelOutputs { name ->
            val first = answers[0][name]
            if (name in BY_CHANNEL) DoubleArray(first.size) { answers[it % 3][name][it] } else first
        }
    }
}

/** Names of the bases whose model is shipped. */
internal val SHIPPED_BASES = listOf("phones", "cameras", "ryyb", "gaussian")

/** Runs the shipped models: one thread, sequentially, on the CPU. Must be closed after use. */
internal interface Engine : Closeable {
    /** The basis of its curves: "phones", "cameras", "ryyb" or "gaussian". */
    val basis: String

    /** SHA-256 of the model file, lower-case hex. */
    val sha256: String

    /** The metadata of the model file. */
    val metadata: Map<String, String>

    /** Solves the hypotheses of a stack in one call. Calls from several threads wait for each other. */
    fun run(stack: List<ModelInputs>): List<ModelOutputs>

    /** ln of the marginal likelihood of the signals under each hypothesis, but for a constant; solves nothing. */
    fun logEvidences(stack: List<ModelInputs>): DoubleArray

    /** Outputs of the verdict's model, by its own names. */
    fun judge(inputs: Map<String, Tensor>, outputs: List<String>): Map<String, Tensor>
}
