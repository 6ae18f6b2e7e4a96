package org.camssf.recovery

import java.io.Closeable

/**
 * What the model takes.
 *
 * @property standardError (k, n, 3) of the signals.
 * @property l2 λ₂.
 * @property gamma γ, one number.
 * @property nonnegative x ≥ 0.
 * @property priorScale how much wider than its basis the prior is taken.
 */
internal class ModelInputs(
    val frames: Frames,
    val standardError: Tensor,
    val known: Known,
    val l2: Double,
    val gamma: Double,
    val nonnegative: Boolean,
    val priorScale: Double = 1.0,
)

/**
 * What the model gives, by its own names: row-major copies that outlive the run. Shapes for k shots, n patches, r
 * coefficients a channel and p problems, 1 on a basis with a mean, whose channels are one problem, else 3:
 *
 * `ssf`, `ssf_std` (681, 3), `code` (r, 3), `code_covariance` (3 r, 3 r), `signals`, `predicted` (k, n, 3), `gap` (3),
 * `layers_gap`, `finish_steps` (p), `evidence` (), `channel_gain` (3), `lamp_estimate` (k, 681), of the lamps' q modes a
 * shot `mode_estimate` (k, q), `mode_covariance` (k q, k q), and of the g gain modes a shot `gain_code` (k, g). `ssf_std`,
 * `code_covariance`, `evidence` and what is said of lamps' modes are NaN where the basis has no prior.
 */
internal class ModelOutputs private constructor(private val found: Map<String, DoubleArray>) {
    /** Reads every output. */
    constructor(read: (String) -> DoubleArray) : this(NAMES.associateWith(read))

    operator fun get(name: String): DoubleArray = found.getValue(name)

    companion object {
        val NAMES = listOf(
            "ssf", "ssf_std", "code", "code_covariance", "signals", "predicted", "gap", "layers_gap", "finish_steps",
            "evidence", "channel_gain", "lamp_estimate", "mode_estimate", "mode_covariance", "gain_code",
        )

        /** Outputs of the paper's model whose last axis is the channel, each from its own problem. */
        private val BY_CHANNEL = setOf("ssf", "ssf_std", "code", "predicted", "gap", "layers_gap", "finish_steps")

        /** Each channel by its own answer; the rest, in which the penalty has no part, by red's. */
        fun byChannel(answers: List<ModelOutputs>): ModelOutputs = ModelOutputs { name ->
            val first = answers[0][name]
            if (name in BY_CHANNEL) DoubleArray(first.size) { answers[it % 3][name][it] } else first
        }
    }
}

/** Bases whose model is shipped. */
internal val SHIPPED_BASES = listOf("phones", "cameras", "gaussian")

/** The one way to run a shipped model: one thread, in order, on the CPU. */
internal interface Engine : Closeable {
    /** The basis of its curves: "phones", "cameras" or "gaussian". */
    val basis: String

    /** SHA-256 of the model file, lower-case hex. */
    val sha256: String

    /** What the model says of itself. */
    val metadata: Map<String, String>

    /** Runs the model. Calls from several threads wait for each other. */
    fun run(inputs: ModelInputs): ModelOutputs
}
