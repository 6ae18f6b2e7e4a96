package org.camssf.colour

import org.camssf.Grid
import org.camssf.Rules
import org.camssf.spectra.Directions
import org.camssf.spectra.Lamp
import kotlin.math.PI
import kotlin.math.ln
import kotlin.math.max

/**
 * Posterior mean of a lamp and a camera's curves, with their joint error modes.
 *
 * @property power (681) posterior mean.
 * @property curves posterior mean.
 * @property powerModes (K) of (681), absolute; zero from index `ofLamp` on.
 * @property curveModes (K), absolute, of the same K errors.
 * @property ofLamp number of errors that come from the lamp; they are the first ones.
 * @property logEvidence ln of the density of the reference's ratios; 0 without them.
 * @property chiSquared χ² of these ratios, two degrees of freedom; null without them.
 */
internal class Light private constructor(
    val name: String,
    val power: DoubleArray,
    val curves: Three,
    val powerModes: List<DoubleArray>,
    val curveModes: List<Three>,
    val ofLamp: Int,
    val logEvidence: Double,
    val chiSquared: Double?,
) {
    companion object {
        /**
         * Conditions lamp and curves on the raw ratios of a reference by Gauss-Newton steps, as in Python's
         * `camssf.colour.light`.
         *
         * @param ratios (2) ln of the reference's raw red and blue over its green; null without a usable reference.
         *   Ignored if the camera's own white is not known.
         * @param error one standard deviation of them.
         */
        fun see(camera: ColourCamera, lamp: Lamp, ratios: DoubleArray?, error: Double): Light {
            val modes = modes(lamp)
            val p = modes.size
            val size = p + camera.modes.size
            val update = if (ratios == null || camera.own == null) {
                null
            } else {
                Told(camera, camera.own, lamp, modes, ratios, error)
            }
            val mean = update?.mean ?: DoubleArray(size)
            val covariance = Array(size) { a ->
                DoubleArray(size) { b ->
                    val reduced = update?.let { 0.5 * (it.reduction(a, b) + it.reduction(b, a)) } ?: 0.0
                    (if (a == b) 1.0 else 0.0) - reduced
                }
            }
            // The lamp's errors come first, so later columns of the Cholesky factor do not change the lamp.
            val root = Symmetric.root(covariance) ?: throw NoColour.error()
            val bend = bend(modes, mean)
            return Light(
                lamp.name,
                DoubleArray(Grid.SIZE) { lamp.sharedValues[it] * bend[it] },
                moved(camera, mean, p),
                List(size) { k ->
                    val found = DoubleArray(Grid.SIZE)
                    for (i in k until p) add(found, root[i][k], modes[i])
                    for (m in found.indices) found[m] *= lamp.sharedValues[m]
                    found
                },
                List(size) { k ->
                    val found = Array(3) { DoubleArray(Grid.SIZE) }
                    for (q in max(k - p, 0) until camera.modes.size) {
                        for (c in 0..2) add(found[c], root[p + q][k], camera.modes[q][c])
                    }
                    found
                },
                p,
                update?.logEvidence ?: 0.0,
                update?.chiSquared,
            )
        }

        /** Error modes (681) of a lamp, relative to its power: its own modes, and its smooth error. */
        fun modes(lamp: Lamp): List<DoubleArray> {
            if (!(lamp.tolerance > 0)) return lamp.sharedModes
            val smooth = Directions.of(Rules.shipped.number("covariance.lamp_correlation")).columns
            return lamp.sharedModes + smooth.map { row -> DoubleArray(row.size) { lamp.tolerance * row[it] } }
        }

        private fun bend(modes: List<DoubleArray>, at: DoubleArray): DoubleArray {
            val found = DoubleArray(Grid.SIZE) { 1.0 }
            for ((i, mode) in modes.withIndex()) add(found, at[i], mode)
            for (m in found.indices) found[m] = max(found[m], DARKEST)
            return found
        }

        private fun moved(camera: ColourCamera, at: DoubleArray, from: Int): Three = Array(3) { c ->
            val found = camera.values[c].copyOf()
            for ((q, mode) in camera.modes.withIndex()) add(found, at[from + q], mode[c])
            found
        }

        private const val STEPS = 4

        /**
         * Relative error of the calibration's white ratios from target, drift and noise, in addition to its lamp's
         * error.
         */
        private const val OWN_WHITE = 0.01

        /** Lower limit of a lamp's power, as a fraction of the named lamp's. */
        private const val DARKEST = 0.02
    }

    /**
     * The update by the reference's ratios: posterior mean, gain and slope of the joint errors (covariance I - gain ·
     * slope), and the χ² of the ratios.
     */
    private class Told(
        private val camera: ColourCamera,
        private val own: OwnWhite,
        private val lamp: Lamp,
        private val modes: List<DoubleArray>,
        ratios: DoubleArray,
        error: Double,
    ) {
        private val p = modes.size
        private val size = p + camera.modes.size
        var mean = DoubleArray(size)
            private set
        val chiSquared: Double
        val logEvidence: Double
        private var slope = emptyArray<DoubleArray>()
        private var gain = emptyArray<DoubleArray>()

        init {
            var off = DoubleArray(2)
            var spread = DoubleArray(3)
            repeat(STEPS) {
                val (expected, noise) = look()
                off = DoubleArray(2) { ratios[it] - expected[it] + dot(slope[it], mean) }
                // Both ratios contain the noise of green.
                spread = DoubleArray(3) {
                    val (a, b) = PAIRS[it]
                    dot(slope[a], slope[b]) + noise[it] + error * error * (if (a == b) 2 else 1)
                }
                gain = Array(2) { DoubleArray(size) }
                for (i in 0 until size) {
                    val (r, b) = solved(spread, slope[0][i], slope[1][i])
                    gain[0][i] = r
                    gain[1][i] = b
                }
                mean = DoubleArray(size) { gain[0][it] * off[0] + gain[1][it] * off[1] }
            }
            val (r, b) = solved(spread, off[0], off[1])
            chiSquared = off[0] * r + off[1] * b
            logEvidence = -0.5 * (chiSquared + 2 * ln(2 * PI) + ln(spread[0] * spread[2] - spread[1] * spread[1]))
        }

        fun reduction(a: Int, b: Int): Double = gain[0][a] * slope[0][b] + gain[1][a] * slope[1][b]

        /** S⁻¹ times the vector (r, b), with S = (s₀ s₁; s₁ s₂). */
        private fun solved(s: DoubleArray, r: Double, b: Double): Pair<Double, Double> {
            val determinant = s[0] * s[2] - s[1] * s[1]
            return (s[2] * r - s[1] * b) / determinant to (s[0] * b - s[1] * r) / determinant
        }

        /**
         * Expected ln ratios at the current mean, and the covariance of the errors that are not in the modes; sets
         * `slope`.
         */
        private fun look(): Pair<DoubleArray, DoubleArray> {
            val curves = moved(camera, mean, p)
            val bend = bend(modes, mean)
            val power = DoubleArray(Grid.SIZE) { lamp.sharedValues[it] * bend[it] }
            val ours = own.lamp.sharedValues
            val here = DoubleArray(3) { dot(power, curves[it]) }
            val there = DoubleArray(3) { dot(ours, curves[it]) }
            val light = Array(3) { c -> DoubleArray(Grid.SIZE) { lamp.sharedValues[it] * curves[c][it] / here[c] } }
            slope = againstGreen(size) { i, c ->
                if (i < p) {
                    dot(modes[i], light[c])
                } else {
                    val mode = camera.modes[i - p][c]
                    dot(power, mode) / here[c] - dot(ours, mode) / there[c]
                }
            }
            val lit = Array(3) { c -> DoubleArray(Grid.SIZE) { ours[it] * curves[c][it] / there[c] } }
            val ofLamp = modes(own.lamp)
            val ofOwn = againstGreen(ofLamp.size) { i, c -> dot(ofLamp[i], lit[c]) }
            val log = againstGreen(1) { _, c -> ln(own.raw[c] * here[c] / there[c]) }
            val noise = DoubleArray(3) {
                val (a, b) = PAIRS[it]
                dot(ofOwn[a], ofOwn[b]) + OWN_WHITE * OWN_WHITE * (if (a == b) 2 else 1)
            }
            return DoubleArray(2) { log[it][0] } to noise
        }

        /** (2, count) the values of red and of blue, each minus that of green. */
        private inline fun againstGreen(count: Int, value: (Int, Int) -> Double): Array<DoubleArray> {
            val found = Array(2) { DoubleArray(count) }
            for (i in 0 until count) {
                val green = value(i, 1)
                found[0][i] = value(i, 0) - green
                found[1][i] = value(i, 2) - green
            }
            return found
        }

        private companion object {
            /** Index pairs of a symmetric (2, 2) matrix. */
            val PAIRS = listOf(0 to 0, 0 to 1, 1 to 1)
        }
    }
}
