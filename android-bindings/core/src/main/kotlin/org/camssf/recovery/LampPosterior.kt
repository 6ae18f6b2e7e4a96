package org.camssf.recovery

import org.camssf.Grid
import org.camssf.Rules
import org.camssf.mean
import org.camssf.spectra.Bundled
import org.camssf.spectra.Directions
import org.camssf.spectra.correlatedTemperature
import kotlin.math.max

/**
 * Posterior of one shot's lamp under one hypothesis.
 *
 * @property power (681) relative, of mean 1.
 * @property variance (681) of `power`.
 * @property kelvin correlated colour temperature, K.
 * @property kelvinVariance variance of `kelvin`, K², by linear propagation.
 */
internal class LampPosterior private constructor(
    val power: DoubleArray,
    val variance: DoubleArray,
    val kelvin: Double,
    val kelvinVariance: Double,
) {
    companion object {
        /** The observation with the lamps' smooth errors expressed as additional lamp modes. */
        fun byModes(observation: Observation): Observation {
            val known = observation.known
            val (k, q) = known.lampModes.shape
            val smooth = Directions.of(Rules.shipped.number("covariance.lamp_correlation")).columns
            val size = q + smooth.size
            val every = DoubleArray(k * size * Grid.SIZE)
            for (j in 0 until k) {
                val own = known.lampModes.values
                own.copyInto(every, j * size * Grid.SIZE, j * q * Grid.SIZE, (j + 1) * q * Grid.SIZE)
                smooth.forEachIndexed { i, column ->
                    val at = (j * size + q + i) * Grid.SIZE
                    for (m in column.indices) every[at + m] = known.lampTolerance.values[j] * column[m]
                }
            }
            val asked = Known(
                known.reflectance, known.chartTolerance, known.whiteReflectance, known.whiteTolerance, known.lamp,
                Tensor.full(0.0, k), Tensor(every, k, size, Grid.SIZE), known.gains,
            )
            return Observation(observation.signals, observation.standardError, asked)
        }

        /** Posterior of each shot's lamp, from mean and covariance of all lamp modes. */
        fun of(known: Known, modes: Pair<DoubleArray, DoubleArray>): List<LampPosterior> {
            val (k, size) = known.lampModes.shape
            val (estimate, covariance) = modes
            return List(k) { j ->
                val at = j * size
                of(
                    known.lamp.values.copyOfRange(j * Grid.SIZE, (j + 1) * Grid.SIZE),
                    List(size) { q ->
                        known.lampModes.values.copyOfRange((at + q) * Grid.SIZE, (at + q + 1) * Grid.SIZE)
                    },
                    estimate.copyOfRange(at, at + size),
                    Array(size) { a -> DoubleArray(size) { b -> covariance[(at + a) * k * size + at + b] } },
                )
            }
        }

        private fun of(
            lamp: DoubleArray,
            modes: List<DoubleArray>,
            estimate: DoubleArray,
            covariance: Array<DoubleArray>,
        ): LampPosterior {
            val darkest = Rules.shipped.number("gains.darkest")
            val bent = DoubleArray(Grid.SIZE) { m ->
                lamp[m] * max(1.0 + modes.indices.sumOf { estimate[it] * modes[it][m] }, darkest)
            }
            val level = mean(bent)
            val power = DoubleArray(Grid.SIZE) { bent[it] / level }
            // The scale of a lamp has no meaning, so changes of the mean are removed from each error.
            val errors = modes.map { mode ->
                val own = DoubleArray(Grid.SIZE) { mode[it] * lamp[it] / level }
                val middle = mean(own)
                DoubleArray(Grid.SIZE) { own[it] - middle * power[it] }
            }
            val (kelvin, slope) = temperature(power)
            val moved = DoubleArray(errors.size) { q -> (0 until Grid.SIZE).sumOf { errors[q][it] * slope[it] } }
            return LampPosterior(
                power,
                DoubleArray(Grid.SIZE) { m -> quadratic(covariance) { errors[it][m] } },
                kelvin,
                quadratic(covariance) { moved[it] },
            )
        }

        /** vᵀ S v, at least 0. */
        private inline fun quadratic(matrix: Array<DoubleArray>, value: (Int) -> Double): Double {
            val v = DoubleArray(matrix.size) { value(it) }
            var total = 0.0
            for (a in v.indices) {
                var row = 0.0
                for (b in v.indices) row += matrix[a][b] * v[b]
                total += v[a] * row
            }
            return max(total, 0.0)
        }

        /**
         * Correlated colour temperature of a power (681), K, and its derivative (681).
         */
        internal fun temperature(power: DoubleArray): Pair<Double, DoubleArray> {
            val functions = Bundled.observer()
            val xyz = functions.map { function -> (0 until Grid.SIZE).sumOf { power[it] * function[it] } }
            val whole = xyz.sum()
            val (x, y) = xyz.map { it / whole }
            val n = (x - 0.3320) / (y - 0.1858)
            val rise = ((-1347.0 * n + 7050.0) * n - 6823.3) / ((y - 0.1858) * whole)
            val slope = DoubleArray(Grid.SIZE) { m ->
                val all = functions.sumOf { it[m] }
                rise * (functions[0][m] - x * all - n * (functions[1][m] - y * all))
            }
            return correlatedTemperature(xyz.toDoubleArray()) to slope
        }
    }
}
