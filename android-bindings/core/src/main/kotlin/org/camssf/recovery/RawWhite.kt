package org.camssf.recovery

import org.camssf.Grid
import org.camssf.Rules
import org.camssf.spectra.Bundled
import org.camssf.spectra.Chromaticity
import org.camssf.spectra.Directions
import org.camssf.spectra.Lamp
import kotlin.math.PI
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.sqrt

/**
 * Narrows the kinds of an unnamed light by the chromaticity of the raw white (docs/maths.md, "Unnamed light"). A kind
 * whose chromaticities do not reach the white's keeps its lamp, and has the probability of wrong colour matrices.
 * Python's camssf.recovery.raw_white.
 */
internal object RawWhite {
    /**
     * The unnamed light with its kinds narrowed by the raw white; as given if the file has no usable matrix.
     *
     * @param white (3) raw values of the white, black level subtracted, any scale.
     * @param matrices of the file, one or two: temperature of the matrix's illuminant, K, and (3, 3) XYZ to raw.
     * @param reflectance (681) of the white.
     */
    fun given(
        light: Lamp,
        white: DoubleArray,
        matrices: List<Pair<Double, DoubleArray>>,
        reflectance: DoubleArray,
    ): Lamp {
        val measured = Chromaticity.of(white, matrices) ?: return light
        val right = ln(Rules.shipped.number("lamp.matrix_right"))
        val wrong = ln((1.0 - Rules.shipped.number("lamp.matrix_right")) / Rules.shipped.number("lamp.white_area"))
        val narrower = light.lamps.mapIndexed { i, lamp ->
            val (narrowed, logDensity) = narrow(lamp, measured, reflectance)
            val prior = light.logPrior[i] + Choice.logSum(listOf(right + logDensity, wrong))
            (if (right + logDensity > wrong) narrowed else lamp) to prior
        }
        return light.withLamps(narrower.map { it.first }, narrower.map { it.second })
    }

    /**
     * The lamp given u'v' (2) of its white, and ln of the probability density of these.
     *
     * L = L₀ (1 + Σ u m), u ~ N(0, I), and u'v' = f(L) + e with e ~ N(0, E), E = σ² I plus the part of the lamp's smooth
     * tolerance. Linearised at its own answer: H = ∂f / ∂u, S = H Hᵀ + E, û = Hᵀ S⁻¹ (u'v' - f + H û), and u has the
     * covariance I - Hᵀ S⁻¹ H.
     */
    fun narrow(lamp: Lamp, measured: DoubleArray, reflectance: DoubleArray): Pair<Lamp, Double> {
        val modes = lamp.sharedModes
        val values = lamp.sharedValues
        val functions = Bundled.observer().map { own -> DoubleArray(Grid.SIZE) { reflectance[it] * own[it] } }
        val smooth = Directions.of(Rules.shipped.number("covariance.lamp_correlation")).columns
        val error = Rules.shipped.number("lamp.white_error_${Lamp.plainKind(lamp.name)}")
        var code = DoubleArray(modes.size)
        var factor = DoubleArray(Grid.SIZE) { 1.0 }
        var gain = emptyList<DoubleArray>()
        var slope = emptyList<DoubleArray>()
        var logDensity = 0.0
        val darkest = Rules.shipped.number("gains.darkest")
        repeat(Rules.shipped.whole("lamp.expansions")) {
            val power = DoubleArray(Grid.SIZE) { values[it] * factor[it] }
            val at = Chromaticity.uv(xyz(power, functions))
            slope = modes.map { mode -> slope(power, functions) { values[it] * mode[it] } }
            val loose = smooth.map { column -> slope(power, functions) { power[it] * (lamp.tolerance * column[it]) } }
            val spread = Array(2) { a ->
                DoubleArray(2) { b ->
                    (slope + loose).sumOf { it[a] * it[b] } + if (a == b) error * error else 0.0
                }
            }
            val det = spread[0][0] * spread[1][1] - spread[0][1] * spread[1][0]
            fun solve(v: DoubleArray) = doubleArrayOf(
                (spread[1][1] * v[0] - spread[0][1] * v[1]) / det,
                (spread[0][0] * v[1] - spread[1][0] * v[0]) / det,
            )
            val off = DoubleArray(2) { a -> measured[a] - at[a] + code.indices.sumOf { code[it] * slope[it][a] } }
            gain = slope.map { solve(it) }
            code = DoubleArray(modes.size) { gain[it][0] * off[0] + gain[it][1] * off[1] }
            factor =
                DoubleArray(Grid.SIZE) { m -> max(1.0 + modes.indices.sumOf { code[it] * modes[it][m] }, darkest) }
            val solved = solve(off)
            logDensity = -0.5 * (off[0] * solved[0] + off[1] * solved[1] + ln(4.0 * PI * PI * det))
        }
        val left = Array(modes.size) { a ->
            DoubleArray(modes.size) { b ->
                (if (a == b) 1.0 else 0.0) - (gain[a][0] * slope[b][0] + gain[a][1] * slope[b][1])
            }
        }
        val root = root(left)
        val narrowed = modes.indices.map { b ->
            DoubleArray(Grid.SIZE) { m -> (b until modes.size).sumOf { root[it][b] * modes[it][m] } / factor[m] }
        }
        val power = DoubleArray(Grid.SIZE) { values[it] * factor[it] }
        return Lamp(lamp.name, Bundled.scaled(power), lamp.tolerance, narrowed, lamp.source) to logDensity
    }

    /** Cholesky factor of a covariance, a lower triangle. */
    private fun root(covariance: Array<DoubleArray>): Array<DoubleArray> {
        val rows = Array(covariance.size) { DoubleArray(covariance.size) }
        for (i in rows.indices) {
            for (j in 0..i) {
                val rest = covariance[i][j] - (0 until j).sumOf { rows[i][it] * rows[j][it] }
                rows[i][j] = if (i == j) sqrt(rest) else rest / rows[j][j]
            }
        }
        return rows
    }

    private fun xyz(power: DoubleArray, functions: List<DoubleArray>): DoubleArray =
        DoubleArray(3) { i -> (0 until Grid.SIZE).sumOf { power[it] * functions[i][it] } }

    /** Change (2) of u'v' of a power by a change of it. */
    private inline fun slope(power: DoubleArray, functions: List<DoubleArray>, change: (Int) -> Double): DoubleArray {
        val whole = xyz(power, functions)
        val moved = xyz(DoubleArray(Grid.SIZE) { change(it) }, functions)
        val at = Chromaticity.uv(whole)
        val turned = Chromaticity.divisor(moved)
        val divisor = Chromaticity.divisor(whole)
        return DoubleArray(2) { (moved[it] * Chromaticity.SCALE[it] - at[it] * turned) / divisor }
    }
}
