package org.camssf.colour

import org.camssf.recovery.Tensor

/**
 * Outputs of one surface given its signals.
 *
 * @property mean (p).
 * @property parts terms of the covariance in the order of [Part], (p, p) each, row-major.
 * @property priorVariance (p) of a surface of that level, without a photo.
 * @property distance from the nearest surface of the prior, in standard deviations.
 * @property signalCovariance (c, c) of the signals by all errors, row-major.
 */
internal class SurfaceOutputs(
    val mean: DoubleArray,
    val parts: List<DoubleArray>,
    val priorVariance: DoubleArray,
    val distance: Double,
    val signalCovariance: DoubleArray,
)

/**
 * XYZ over its white given exact signals of mean 1.
 *
 * @property means (b, m, 3) of the fine signals.
 * @property covariances (k) of (3, 3), of the coarse signals.
 * @property signalCovariances (k) of (c, c), of these signals by all errors.
 */
internal class ExactOutputs(
    val means: DoubleArray,
    val covariances: List<DoubleArray>,
    val signalCovariances: List<DoubleArray>,
)

/**
 * The posterior of outputs given signals, for a prior of measured surfaces (docs/spectrum.md). The outputs are the
 * response's colours; before them the reflectance itself if it was asked for. Immutable; safe to share between threads.
 *
 * @throws org.camssf.InvalidArgument curves, too negative, through which a surface gives no signal.
 */
internal class SurfacePosterior(prior: SurfacePrior, response: SurfaceResponse, reflectance: Boolean) {
    private val components: Map<String, Tensor>

    init {
        val asked = (if (reflectance) SurfaceNodes.units else emptyList()) + response.outputs.rows()
        val given = mapOf("signals" to response.signals, "outputs" to tensor(asked))
        components = SurfaceModels.components.run(prior.arrays + given + response.moves())
        if (!components.getValue("component scale").values.all { it > 0 }) throw NoColour.error()
    }

    /** The posterior of one surface, from its signals (c). */
    fun of(surface: RelativeSignals): SurfaceOutputs {
        val signals = mapOf("y" to surface.values, "error" to surface.standardError)
        val found = SurfaceModels.posterior.run(components + signals.mapValues { Tensor(it.value, it.value.size) })
        fun numbers(name: String) = found.getValue(name).values
        return SurfaceOutputs(
            numbers("mean"),
            Part.values().map { numbers(it.name.lowercase()) },
            numbers("prior_variance"),
            numbers("distance")[0],
            numbers("signal_covariance"),
        )
    }

    /** XYZ over its white given exact signals of mean 1: (b, m, c), and with covariances (k, c). */
    fun exact(fine: Tensor, coarse: Tensor): ExactOutputs {
        val outputs = SurfaceModels.exact.run(components + mapOf("fine" to fine, "coarse" to coarse))
        return ExactOutputs(
            outputs.getValue("means").values,
            outputs.getValue("covariance").rows(),
            outputs.getValue("signal_covariance").rows(),
        )
    }
}
