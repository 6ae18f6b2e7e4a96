package org.camssf.colour

import org.camssf.Rules
import org.camssf.recovery.Tensor
import kotlin.math.cbrt

/**
 * Colours of exact signals of mean 1 at nodes of ln r/g and, varying faster, ln b/g, mixed over lights by their weights:
 * what the model of a picture interpolates.
 *
 * @property arrays `roots` (129², 3) cube roots of XYZ over its white; `covariance` (17², 6) of XYZ over its white
 *   without noise, its upper triangle; `distance` (17²) of dark signals of this ratio from those that any surface can
 *   give, in standard deviations.
 * @throws org.camssf.InvalidArgument curves from which no colour can be computed.
 */
internal class PictureTable(lights: List<LampContext>, weights: DoubleArray) {
    val arrays: Map<String, Tensor>

    init {
        val tables = lights.map { TableOfLight(it) }
        val means = mean(tables.map { it.exact.means }, weights)
        val coarse = TableOfLight.coarse
        val covariances = coarse.indices.flatMap { node ->
            val within = mean(tables.map { it.exact.covariances[node] }, weights)
            val between = covariance(tables.map { it.mean(node) }, weights)
            PAIRS.map { within[it] + between[it] }
        }
        val distances = DoubleArray(coarse.size) { node -> tables.minOf { it.distances[node] } }
        arrays = mapOf(
            "roots" to Tensor(DoubleArray(means.size) { cbrt(means[it]) }, means.size / 3, 3),
            "covariance" to Tensor(covariances.toDoubleArray(), coarse.size, PAIRS.size),
            "distance" to Tensor(distances, coarse.size),
        )
        val numbers = listOf("roots", "covariance").map { arrays.getValue(it).values }
        if (!numbers.all { values -> values.all { it.isFinite() } }) throw NoColour.error()
    }

    private companion object {
        /** Places of the upper triangle in a matrix (3, 3). */
        val PAIRS = listOf(0, 1, 2, 4, 5, 8)
    }
}

/** The table of one light, before the lights are mixed. */
private class TableOfLight(light: LampContext) {
    val exact: ExactOutputs = light.exact()

    /** (17²) of dark signals. */
    val distances: DoubleArray = distances(light.response.reachable, Rules.shipped.number("colour.level"))

    private fun distances(reachable: List<DoubleArray>, level: Double) = DoubleArray(coarse.size) {
        SurfaceDistance.of(coarse[it].times(level), exact.signalCovariances[it].times(level * level), reachable)
    }

    /** XYZ (3) over its white at a node of the coarse grid. */
    fun mean(node: Int): DoubleArray {
        val at = 3 * STRIDE * (node / PixelTable.COARSE * PixelTable.NODES + node % PixelTable.COARSE)
        return exact.means.copyOfRange(at, at + 3)
    }

    companion object {
        private const val STRIDE = (PixelTable.NODES - 1) / (PixelTable.COARSE - 1)

        /** (17²) of (3) signals of mean 1. */
        val coarse: List<DoubleArray> = PixelTable.coarseSignals.rows()
    }
}
