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
         * Conditions the lamps of one or two photos and the curves, which are the same in both, on the raw ratios of
         * the references by Gauss-Newton steps, as in Python's `camssf_colour.light`.
         *
         * @param photos of each a lamp, and ratios of a reference; they are ignored if the camera's own white is not
         *   known.
         * @return one light for each photo; they have the same errors, evidence and χ².
         */
        fun of(camera: ColourCamera, photos: List<ReferenceRatios>): List<Light> {
            val modes = photos.map { modes(it.lamp) }
            val ends = modes.runningFold(0) { end, lampModes -> end + lampModes.size }
            val p = ends.last()
            val size = p + camera.modes.size
            val update = camera.ownWhite?.let { ownWhite ->
                val measured = photos.indices.filter { photos[it].ratios != null }
                if (measured.isEmpty()) null else Update(camera, ownWhite, photos, modes, ends, measured)
            }
            val mean = update?.mean ?: DoubleArray(size)
            val covariance = Array(size) { a ->
                DoubleArray(size) { b ->
                    val reduced = update?.let { 0.5 * (it.reduction(a, b) + it.reduction(b, a)) } ?: 0.0
                    (if (a == b) 1.0 else 0.0) - reduced
                }
            }
            // The lamps' errors come first, so later columns of the Cholesky factor do not change a lamp.
            val root = Symmetric.root(covariance) ?: throw NoColour.error()
            val curves = curves(camera, mean, p)
            val curveModes = List(size) { k ->
                val mode = Array(3) { DoubleArray(Grid.SIZE) }
                for (q in max(k - p, 0) until camera.modes.size) {
                    for (c in 0..2) add(mode[c], root[p + q][k], camera.modes[q][c])
                }
                mode
            }
            return photos.mapIndexed { j, photo ->
                val power = photo.lamp.sharedValues
                val factor = powerFactor(modes[j], mean, ends[j])
                Light(
                    photo.lamp.name,
                    DoubleArray(Grid.SIZE) { power[it] * factor[it] },
                    curves,
                    List(size) { k ->
                        val mode = DoubleArray(Grid.SIZE)
                        for (i in modes[j].indices) add(mode, root[ends[j] + i][k], modes[j][i])
                        for (m in mode.indices) mode[m] *= power[m]
                        mode
                    },
                    curveModes,
                    p,
                    update?.logEvidence ?: 0.0,
                    update?.chiSquared,
                )
            }
        }

        /** Error modes (681) of a lamp, relative to its power: its own modes, and its smooth error. */
        fun modes(lamp: Lamp): List<DoubleArray> {
            if (!(lamp.tolerance > 0)) return lamp.sharedModes
            val smooth = Directions.of(Rules.shipped.number("covariance.lamp_correlation")).columns
            return lamp.sharedModes + smooth.map { row -> DoubleArray(row.size) { lamp.tolerance * row[it] } }
        }

        /** Factor (681) of a lamp's power at a point of its errors. */
        private fun powerFactor(modes: List<DoubleArray>, at: DoubleArray, from: Int): DoubleArray {
            val factor = DoubleArray(Grid.SIZE) { 1.0 }
            for ((i, mode) in modes.withIndex()) add(factor, at[from + i], mode)
            for (m in factor.indices) factor[m] = max(factor[m], DARKEST)
            return factor
        }

        /** The camera's curves at a point of their errors. */
        private fun curves(camera: ColourCamera, at: DoubleArray, from: Int): Three = Array(3) { c ->
            val curve = camera.values[c].copyOf()
            for ((q, mode) in camera.modes.withIndex()) add(curve, at[from + q], mode[c])
            curve
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
     * The update by the references' ratios: posterior mean, gain and slope of the joint errors (covariance
     * I - gain · slope), and the χ² of the ratios.
     */
    private class Update(
        private val camera: ColourCamera,
        private val ownWhite: OwnWhite,
        private val photos: List<ReferenceRatios>,
        private val modes: List<List<DoubleArray>>,
        private val ends: List<Int>,
        private val measured: List<Int>,
    ) {
        private val p = ends.last()
        private val size = p + camera.modes.size
        private val ratios = measured.flatMap { photos[it].ratios!!.asList() }
        private val rows = 2 * measured.size
        var mean = DoubleArray(size)
            private set
        val chiSquared: Double
        val logEvidence: Double
        private var slope = emptyArray<DoubleArray>()
        private var gain = emptyArray<DoubleArray>()

        init {
            var residual = DoubleArray(rows)
            var root = emptyArray<DoubleArray>()
            repeat(STEPS) {
                val (expected, noise) = linearised()
                residual = DoubleArray(rows) { ratios[it] - expected[it] + dot(slope[it], mean) }
                // The calibration's own white is the same for all; both ratios of a photo contain the noise of green.
                val spread = Array(rows) { a ->
                    DoubleArray(rows) { b ->
                        val error = if (a / 2 == b / 2) photos[measured[a / 2]].error else 0.0
                        dot(slope[a], slope[b]) + noise[2 * (a % 2) + b % 2] + error * error * (if (a == b) 2 else 1)
                    }
                }
                root = Symmetric.root(spread) ?: throw NoColour.error()
                gain = Symmetric.solve(root, slope)
                mean = DoubleArray(size) { i -> (0 until rows).sumOf { gain[it][i] * residual[it] } }
            }
            val weighed = Symmetric.solve(root, Array(rows) { doubleArrayOf(residual[it]) })
            chiSquared = residual.indices.sumOf { residual[it] * weighed[it][0] }
            val determinant = root.indices.sumOf { 2 * ln(root[it][it]) }
            logEvidence = -0.5 * (chiSquared + rows * ln(2 * PI) + determinant)
        }

        fun reduction(a: Int, b: Int): Double = (0 until rows).sumOf { gain[it][a] * slope[it][b] }

        /**
         * Expected ln ratios at the current mean, and the (2, 2) covariance of the errors of the own white that are
         * not in the modes; sets `slope`.
         */
        private fun linearised(): Pair<DoubleArray, DoubleArray> {
            val curves = curves(camera, mean, p)
            val ownPower = ownWhite.lamp.sharedValues
            val ownSignals = DoubleArray(3) { dot(ownPower, curves[it]) }
            val expected = DoubleArray(rows)
            slope = Array(rows) { DoubleArray(size) }
            for ((i, j) in measured.withIndex()) {
                val lamp = photos[j].lamp.sharedValues
                val factor = powerFactor(modes[j], mean, ends[j])
                val power = DoubleArray(Grid.SIZE) { lamp[it] * factor[it] }
                val signals = DoubleArray(3) { dot(power, curves[it]) }
                val shares = Array(3) { c -> DoubleArray(Grid.SIZE) { lamp[it] * curves[c][it] / signals[c] } }
                val log = againstGreen { ln(ownWhite.raw[it] * signals[it] / ownSignals[it]) }
                for (row in 0..1) expected[2 * i + row] = log[row]
                fun derivative(at: Int, value: (Int) -> Double) {
                    val difference = againstGreen(value)
                    for (row in 0..1) slope[2 * i + row][at] = difference[row]
                }
                modes[j].forEachIndexed { k, mode -> derivative(ends[j] + k) { dot(mode, shares[it]) } }
                camera.modes.forEachIndexed { k, mode ->
                    derivative(p + k) {
                        dot(power, mode[it]) / signals[it] - dot(ownPower, mode[it]) / ownSignals[it]
                    }
                }
            }
            val ownShares = Array(3) { c -> DoubleArray(Grid.SIZE) { ownPower[it] * curves[c][it] / ownSignals[c] } }
            val ofOwnLamp = modes(ownWhite.lamp).map { mode -> againstGreen { dot(mode, ownShares[it]) } }
            return expected to DoubleArray(4) { at ->
                ofOwnLamp.sumOf { it[at / 2] * it[at % 2] } + OWN_WHITE * OWN_WHITE * (if (at % 3 == 0) 2 else 1)
            }
        }

        /** (2) the values of red and of blue, each minus that of green. */
        private inline fun againstGreen(value: (Int) -> Double): DoubleArray {
            val green = value(1)
            return doubleArrayOf(value(0) - green, value(2) - green)
        }
    }
}

/**
 * The lamp of a photo, and what a reference in it says of it.
 *
 * @property ratios (2) ln of the reference's raw red and blue over its green; null without a usable reference.
 * @property error one standard deviation of them.
 */
internal class ReferenceRatios(val lamp: Lamp, val ratios: DoubleArray?, val error: Double)
