package org.camssf.colour

import org.camssf.InvalidArgument
import org.camssf.RuntimeUnfit
import org.camssf.Shipped
import org.camssf.model.Models
import org.camssf.recovery.OnnxModel
import org.camssf.recovery.Tensor
import org.camssf.recovery.withOnnxRuntime

/**
 * The formulas of Python's `camssf_colour` as models, each opened when it is first needed.
 *
 * @throws InvalidArgument its file is missing or was changed.
 * @throws RuntimeUnfit ONNX Runtime is missing, or of a version that reports its use.
 */
internal object SurfaceModels {
    /** Lights and curves given the references' raw ratios, and the response under them. */
    val lights: OnnxModel by model("lights")

    /** The surfaces of a prior as a response sees them. */
    val components: OnnxModel by model("components")

    /** The posterior of one surface. */
    val posterior: OnnxModel by model("posterior")

    /** The posteriors of many surfaces of signals without noise. */
    val exact: OnnxModel by model("exact")

    /** A strip of a picture, and its uncertainty. */
    val picture: OnnxModel by model("picture")

    private fun model(step: String) = lazy {
        val name = "surfaces-$step.onnx"
        withOnnxRuntime { OnnxModel(name, read(name), ADVICE) }
    }

    /**
     * One of this module's files, which are Python's own.
     *
     * @throws InvalidArgument it is missing or was changed.
     */
    fun read(name: String): ByteArray =
        Shipped.bytes(name, ADVICE) { Models.read(SurfaceModels::class.java, "org/camssf/colour", it) }

    private const val ADVICE = "Add camssf-colour unchanged."
}

/** A matrix (n, size) of its rows. */
internal fun tensor(rows: List<DoubleArray>): Tensor = Tensor.stack(rows.map { Tensor(it, it.size) })

/** (681, 3) of three curves. */
internal fun columns(curves: Three): Tensor {
    val size = curves[0].size
    return Tensor(DoubleArray(3 * size) { curves[it % 3][it / 3] }, size, 3)
}

/** The rows of a tensor (n, any). */
internal fun Tensor.rows(): List<DoubleArray> {
    val size = if (shape[0] == 0) 0 else values.size / shape[0]
    return List(shape[0]) { values.copyOfRange(it * size, (it + 1) * size) }
}
