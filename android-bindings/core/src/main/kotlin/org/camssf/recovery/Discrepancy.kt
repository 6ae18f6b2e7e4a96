package org.camssf.recovery

import org.camssf.Grid
import org.camssf.Rules
import kotlin.math.abs
import kotlin.math.exp
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.sqrt

/**
 * The largest γ of each channel on the paper's basis whose residual is not above the measured noise (Morozov 1966).
 *
 * rᵀ Σ⁻¹ r ≤ Σ se² / Σ_ii, with Σ = max(se² + (τ y)², floor²) on the diagonal. The left side grows with γ; if it
 * exceeds the noise even at [SMALLEST_GAMMA] · γ_max, that γ is taken.
 */
internal class Discrepancy(
    observation: Observation,
    private val nonnegative: Boolean,
    private val run: (Double) -> ModelOutputs,
) {
    private val n = observation.signals.shape[1]
    private val y = observation.signals.values
    private val noise = observation.standardError.values
    private val variance = DoubleArray(3 * n) {
        val table = observation.known.chartTolerance.values[it / 3] * y[it]
        max(noise[it] * noise[it] + table * table, FLOOR * FLOOR)
    }

    /** (n, r) signal of each patch from each atom, Σ R L ψ dλ with L scaled so that Σ ρ_w L dλ = 1. */
    private val rows: Array<DoubleArray>

    init {
        val lamp = observation.known.lamp.values
        val rho = observation.known.whiteReflectance.values
        val total = (0 until Grid.SIZE).sumOf { lamp[it] * rho[it] } * Grid.STEP
        val atoms = atoms()
        rows = Array(n) { i ->
            DoubleArray(ATOMS) { a ->
                (0 until Grid.SIZE).sumOf { m ->
                    observation.known.reflectance.values[i * Grid.SIZE + m] * lamp[m] * Grid.STEP / total *
                        atoms[a][m]
                }
            }
        }
    }

    fun gammas(): DoubleArray = DoubleArray(3) { gamma(it) }

    private fun gamma(c: Int): Double {
        val expected = (0 until n).sumOf { noise[3 * it + c] * noise[3 * it + c] / variance[3 * it + c] }
        val pull = (0 until ATOMS).map { a ->
            (0 until n).sumOf { rows[it][a] * y[3 * it + c] / variance[3 * it + c] }
        }
        val largest = pull.maxOf { if (nonnegative) it else abs(it) }
        if (largest <= 0) return 1.0 // nothing to explain: any penalty gives the zero code
        val excess = { logGamma: Double -> excess(c, exp(logGamma), expected) }
        val low = ln(SMALLEST_GAMMA * largest)
        val high = ln(largest)
        if (expected == 0.0) return exp(low)
        val atLow = excess(low)
        if (atLow >= 0) return exp(low)
        val atHigh = excess(high)
        if (atHigh <= 0) return exp(high)
        return exp(Brent.root(low, atLow, high, atHigh, 0.01, excess))
    }

    /** ln(rᵀ Σ⁻¹ r / expected) of a channel. */
    private fun excess(c: Int, gamma: Double, expected: Double): Double {
        val code = run(gamma)["code"]
        val size = (0 until n).sumOf { i ->
            val r = y[3 * i + c] - (0 until ATOMS).sumOf { rows[i][it] * code[3 * it + c] }
            r * r / variance[3 * i + c]
        }
        return ln(max(size, 1e-300) / expected)
    }

    companion object {
        val SMALLEST_GAMMA get() = Rules.shipped.number("calibration.smallest_gamma")
        val FLOOR get() = Rules.shipped.number("covariance.floor")
        const val ATOMS = 18
        private const val WIDTH = 50.0

        /** (18, 681) the paper's Gaussians, FWHM 50 nm, centres 20 nm apart from 380 nm. */
        fun atoms(): Array<DoubleArray> {
            val sigma = WIDTH / sqrt(8.0 * ln(2.0))
            val grid = Grid.wavelengths
            return Array(ATOMS) { a ->
                DoubleArray(Grid.SIZE) {
                    val u = (grid[it] - (380.0 + 20.0 * a)) / sigma
                    exp(-0.5 * u * u)
                }
            }
        }
    }
}
