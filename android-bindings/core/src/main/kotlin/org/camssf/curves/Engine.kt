package org.camssf.curves

import java.io.Closeable

/** What the model takes; shapes as in docs/architecture.md with k shots, n patches, q ≥ 1 lamp modes. */
internal class ModelInputs(
    val chart: Tensor,
    val white: Tensor,
    val dark: Tensor,
    val standardError: Tensor,
    val reflectance: Tensor,
    val chartTolerance: Tensor,
    val whiteReflectance: Tensor,
    val whiteTolerance: Double,
    val lamp: Tensor,
    val lampTolerance: Tensor,
    val lampModes: Tensor,
    val l2: Double,
    val gamma: Double,
    val nonnegative: Boolean,
)

/**
 * What the model gives: `ssf`, `ssfStd` (681, 3), `code` (r, 3), `signals`, `predicted` (k, n, 3), `gap`,
 * `channelGain` (3), `lamp` (k, 681); row-major copies that outlive the run.
 */
internal class ModelOutputs(
    val ssf: DoubleArray,
    val ssfStd: DoubleArray,
    val code: DoubleArray,
    val signals: DoubleArray,
    val predicted: DoubleArray,
    val gap: DoubleArray,
    val channelGain: DoubleArray,
    val lamp: DoubleArray,
)

/** Bases whose model is shipped. */
internal val SHIPPED_BASES = listOf("cameras", "gaussian")

/** The one way to run a shipped model: one thread, in order, on the CPU. */
internal interface Engine : Closeable {
    /** The basis of its curves: "cameras" or "gaussian". */
    val basis: String

    /** SHA-256 of the model file, lower-case hex. */
    val sha256: String

    /** What the model says of itself. */
    val metadata: Map<String, String>

    /** Runs the model. Calls from several threads wait for each other. */
    fun run(inputs: ModelInputs): ModelOutputs
}
