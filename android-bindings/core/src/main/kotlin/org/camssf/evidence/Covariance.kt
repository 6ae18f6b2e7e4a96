package org.camssf.evidence

import org.camssf.Grid
import org.camssf.Rules
import kotlin.math.ceil
import kotlin.math.exp
import kotlin.math.max
import kotlin.math.sqrt

/**
 * Rule 1 of docs/verdict.md: the covariance of a channel's rows, taken at the answer. A row is a used patch of a shot.
 *
 * @param rows of the used signals, shot by shot: index into (k, n).
 */
internal class Covariance(private val told: Told, private val rows: IntArray, private val channel: Int) {
    private val patches = told.signals.patches
    private val white = told.whiteReflectance
    private val long = Directions.of(number("chart_correlation"))
    private val short = Directions.of(number("table_correlation"))
    private val smooth = Directions.of(number("lamp_correlation"))
    private val relativePart = square(number("relative"))
    private val absolutePart = square(number("absolute"))
    private val edgePart = square(number("edge"))
    private val drift = square(number("drift"))
    private val independent = number("independent_share")
    private val floor = square(number("floor"))

    private val signal = column { told.signals.sharedValues[it] }
    private val error = column { told.signals.sharedError[it] }
    private val predicted = column { told.ssf.sharedPredicted[it] }

    /** v_j: what each shot's lamp and the curve make of a reflectance, in parts of the white signal. */
    private val light = told.lamps.indices.map { shot ->
        val seen = DoubleArray(Grid.SIZE) {
            told.ssf.sharedLamp[shot * Grid.SIZE + it] * told.ssf.sharedValues[3 * it + channel] * Grid.STEP
        }
        val whiteSignal = (0 until Grid.SIZE).sumOf { seen[it] * white[it] }
        DoubleArray(Grid.SIZE) { seen[it] / whiteSignal }
    }
    private val absolute = light.map { v -> short.along { v[it] } }
    private val whites = light.map { v -> long.along { v[it] * white[it] } }
    private val relative = rows.map { row -> long.along { light[shot(row)][it] * reflectance(patch(row), it) } }
    private val edges = rows.map { row -> short.along { light[shot(row)][it] * slope(patch(row), it) } }

    /** a_ij - ŷ_ij ρ v_j: how a row answers to a relative change of its lamp. */
    private val answers = rows.mapIndexed { at, row ->
        val v = light[shot(row)]
        DoubleArray(Grid.SIZE) { v[it] * (reflectance(patch(row), it) - predicted[at] * white[it]) }
    }
    private val bends = answers.map { answer -> smooth.along { answer[it] } }
    private val modes = answers.mapIndexed { at, answer ->
        val known = told.lamps[shot(rows[at])].sharedModes
        DoubleArray(known.size) { q -> (0 until Grid.SIZE).sumOf { answer[it] * known[q][it] } }
    }

    /** Σ, (rows, rows). */
    fun matrix(): Array<DoubleArray> {
        val sigma = Array(rows.size) { DoubleArray(rows.size) }
        for (a in rows.indices) {
            for (b in 0..a) {
                val value = shared(a, b)
                sigma[a][b] = value
                sigma[b][a] = value
            }
            val own = independent * told.table.sharedTolerance[patch(rows[a])] * signal[a]
            sigma[a][a] += max(square(error[a]) + square(own), floor)
        }
        return sigma
    }

    /** What two rows have in common: the white, the patch, the lamp. */
    private fun shared(a: Int, b: Int): Double {
        val both = predicted[a] * predicted[b]
        val one = shot(rows[a])
        val other = shot(rows[b])
        var value = square(told.whiteTolerance) * both * dot(whites[one], whites[other])
        if (patch(rows[a]) == patch(rows[b])) {
            value += square(told.table.sharedTolerance[patch(rows[a])]) * (
                relativePart * dot(relative[a], relative[b]) +
                    absolutePart * dot(absolute[one], absolute[other]) +
                    edgePart * dot(edges[a], edges[b])
                )
        }
        if (one == other) {
            value += square(told.lamps[one].tolerance) * dot(bends[a], bends[b])
            value += dot(modes[a], modes[b])
            value += drift * both
        }
        return value
    }

    private fun number(word: String): Double = Rules.shipped.number("covariance.$word")

    private fun square(value: Double): Double = value * value

    private fun shot(row: Int): Int = row / patches

    private fun patch(row: Int): Int = row % patches

    private fun column(value: (Int) -> Double) = DoubleArray(rows.size) { value(3 * rows[it] + channel) }

    private fun reflectance(patch: Int, at: Int): Double = told.table.sharedValues[patch * Grid.SIZE + at]

    /** Central difference of R per nm, one-sided at the ends. */
    private fun slope(patch: Int, at: Int): Double {
        val after = minOf(at + 1, Grid.SIZE - 1)
        val before = max(at - 1, 0)
        return (reflectance(patch, after) - reflectance(patch, before)) / (Grid.STEP * (after - before))
    }
}

/**
 * Φ of an error that is smooth over a length: column q is √(h / (ℓ √(π/2))) exp(-((λ - t_q) / ℓ)²), with h = ℓ / 2 and
 * t_q = 380 - 2 ℓ + q h up to the first at or beyond 720 + 2 ℓ.
 */
internal class Directions private constructor(length: Double) {
    private val columns: Array<DoubleArray>

    init {
        val step = length / 2.0
        val weight = sqrt(step / (length * sqrt(Math.PI / 2.0)))
        val grid = Grid.WAVELENGTHS
        columns = Array(ceil((340.0 + 4.0 * length) / step).toInt() + 1) { q ->
            val place = 380.0 - 2.0 * length + step * q
            DoubleArray(Grid.SIZE) {
                val u = (grid[it] - place) / length
                weight * exp(-u * u)
            }
        }
    }

    /** Φᵀ f. */
    inline fun along(f: (Int) -> Double): DoubleArray {
        val values = DoubleArray(Grid.SIZE) { f(it) }
        return project(values)
    }

    fun project(values: DoubleArray): DoubleArray = DoubleArray(columns.size) { dot(columns[it], values) }

    companion object {
        private val made = HashMap<Double, Directions>()

        /** Of that length, nm. */
        fun of(length: Double): Directions = synchronized(made) { made.getOrPut(length) { Directions(length) } }
    }
}

/** Symmetric positive definite matrices. */
internal object Symmetric {
    /** The inverse by Cholesky's factor. */
    fun inverse(matrix: Array<DoubleArray>): Array<DoubleArray> {
        val n = matrix.size
        val root = Array(n) { DoubleArray(n) }
        for (i in 0 until n) {
            for (j in 0..i) {
                var value = matrix[i][j]
                for (p in 0 until j) value -= root[i][p] * root[j][p]
                root[i][j] = if (i == j) sqrt(value) else value / root[j][j]
            }
        }
        val back = Array(n) { DoubleArray(n) } // root⁻¹, lower
        for (j in 0 until n) {
            back[j][j] = 1.0 / root[j][j]
            for (i in j + 1 until n) {
                var value = 0.0
                for (p in j until i) value -= root[i][p] * back[p][j]
                back[i][j] = value / root[i][i]
            }
        }
        val inverse = Array(n) { DoubleArray(n) }
        for (i in 0 until n) {
            for (j in 0..i) {
                var value = 0.0
                for (p in i until n) value += back[p][i] * back[p][j]
                inverse[i][j] = value
                inverse[j][i] = value
            }
        }
        return inverse
    }
}

internal fun dot(a: DoubleArray, b: DoubleArray): Double {
    var total = 0.0
    for (i in a.indices) total += a[i] * b[i]
    return total
}
