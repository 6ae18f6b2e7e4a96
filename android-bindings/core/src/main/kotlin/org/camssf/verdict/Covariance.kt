package org.camssf.verdict

import org.camssf.Grid
import org.camssf.Rules
import org.camssf.photo.Signals
import org.camssf.spectra.Directions
import kotlin.math.max
import kotlin.math.sqrt

/** The rows of the used signals: patch by patch, shot by shot, then red, green, blue. */
internal class Rows(signals: Signals) {
    private val n = signals.patches

    /** Index of each row into (k, n, 3). */
    val at: IntArray

    /** Patches that at least one shot uses. */
    val patches: IntArray

    /** The first row of each of these patches, then the number of rows. */
    val starts: IntArray

    init {
        val shots = List(n) { i -> (0 until signals.shots).filter { signals.sharedUsed[it * n + i] } }
        patches = (0 until n).filter { shots[it].isNotEmpty() }.toIntArray()
        starts = patches.fold(intArrayOf(0)) { all, i -> all + (all.last() + 3 * shots[i].size) }
        at = patches.flatMap { i -> shots[i].flatMap { j -> List(3) { 3 * (j * n + i) + it } } }.toIntArray()
    }

    val size: Int get() = at.size

    fun shot(row: Int): Int = at[row] / (3 * n)

    fun patch(row: Int): Int = at[row] / 3 % n

    fun channel(row: Int): Int = at[row] % 3

    /** Selects the rows from values (k, n, 3). */
    fun of(values: DoubleArray): DoubleArray = DoubleArray(size) { values[at[it]] }
}

/**
 * Covariance Σ of the used signals of all three channels at the answer: rule 1 of docs/verdict.md.
 *
 * Σ = D + U Uᵀ. D has one block for each patch: its noise and the chart's error there. U has one column for each
 * error that many rows share: errors of the white, of each lamp, and of the light on the patches. [Precision] applies
 * the inverse of Σ in this form.
 */
internal class Covariance(private val inputs: VerdictInputs, private val rows: Rows) {
    private val white = inputs.whiteReflectance
    private val tolerance = inputs.table.sharedTolerance
    private val signal = rows.of(inputs.signals.sharedValues)
    private val predicted = rows.of(inputs.ssf.sharedPredicted)
    private val long = Directions.of(number("chart_correlation"))
    private val short = Directions.of(number("table_correlation"))
    private val smooth = Directions.of(number("lamp_correlation"))
    private val relativePart = number("relative")
    private val absolutePart = number("absolute")
    private val edgePart = number("edge")
    private val channelShare = number("channel_share")
    private val independentShare = number("independent_share")
    private val floor = number("floor")
    private val drift = number("drift")
    private val patches = rows.patches.size

    /** R of the patches, then ρ_w; dR/dλ of the patches, then 1. */
    private val reflectances = Spectra(patches + 1) { at, m ->
        if (at < patches) reflectance(rows.patches[at], m) else white[m]
    }
    private val slopes = Spectra(patches + 1) { at, m -> if (at < patches) slope(rows.patches[at], m) else 1.0 }

    /** Of each shot and channel. */
    private val linearised =
        List(inputs.lamps.size) { shot -> List(3) { channel -> LinearisedSignals(shot, channel) } }

    /**
     * Integrals of spectra with a channel's curve and a shot's lamp: for each spectrum a row, along the directions of
     * an error; that of ρ_w or of 1 is last.
     */
    private inner class LinearisedSignals(shot: Int, channel: Int) {
        /** L s dλ / W. */
        private val light = DoubleArray(Grid.SIZE) {
            inputs.ssf.sharedLamp[shot * Grid.SIZE + it] * inputs.ssf.sharedValues[3 * it + channel] * Grid.STEP
        }

        init {
            val whole = dot(light, white)
            for (m in light.indices) light[m] /= whole
        }

        val relative = reflectances.along(long.columns, light)
        val edges = slopes.along(short.columns, light)
        val lampModes = reflectances.along(smooth.columns, light)
        val modes = reflectances.along(inputs.lamps[shot].sharedModes, light)
    }

    /** The blocks of D, one for each patch. */
    val blocks: List<Array<DoubleArray>> = List(patches) { block(it) }

    /**
     * U (rows, errors): derivative of each row by the shared errors, first the white's, then lamp by lamp, then the
     * light's.
     */
    val shared: Array<DoubleArray>

    init {
        val widths = inputs.lamps.map { smooth.columns.size + 1 + it.sharedModes.size }
        val starts = widths.runningFold(long.columns.size) { from, width -> from + width }
        val lightFrom = starts.last()
        val light = inputs.gains?.modes?.let { 4 * it.shape[0] * it.shape[1] } ?: 0
        shared = Array(rows.size) { row ->
            DoubleArray(lightFrom + light).also {
                fill(it, row, starts[rows.shot(row)])
                uneven(it, row, lightFrom)
            }
        }
    }

    /** y φ of each gain mode of the row's shot: the part common to the channels, and the part independent in each. */
    private fun uneven(factors: DoubleArray, row: Int, from: Int) {
        val gains = inputs.gains ?: return
        val (_, g, n) = gains.modes.shape
        val shot = rows.shot(row)
        for (q in 0 until g) {
            val step = signal[row] * gains.modes.values[(shot * g + q) * n + rows.patch(row)]
            val at = from + 4 * (shot * g + q)
            factors[at] = step
            factors[at + 1 + rows.channel(row)] = gains.own * step
        }
    }

    private fun fill(factors: DoubleArray, row: Int, lampFrom: Int) {
        val own = linearised[rows.shot(row)][rows.channel(row)]
        val patch = rows.patches.binarySearch(rows.patch(row))
        own.relative[patches].forEachIndexed { q, answer ->
            factors[q] = inputs.whiteTolerance * predicted[row] * answer
        }

        // A relative change of the lamp changes the signals of patch and white: (R - ŷ ρ_w) L s dλ / W.
        fun change(along: Array<DoubleArray>, q: Int) = along[patch][q] - predicted[row] * along[patches][q]
        val lampModes = smooth.columns.size
        val width = inputs.lamps[rows.shot(row)].tolerance
        for (q in 0 until lampModes) factors[lampFrom + q] = width * change(own.lampModes, q)
        factors[lampFrom + lampModes] = drift * predicted[row]
        for (q in own.modes[patches].indices) factors[lampFrom + lampModes + 1 + q] = change(own.modes, q)
    }

    private fun block(at: Int): Array<DoubleArray> {
        val first = rows.starts[at]
        val size = rows.starts[at + 1] - first
        val chart = List(size) { chart(first + it, at) }
        val block = Array(size) { DoubleArray(size) }
        for (a in 0 until size) {
            for (b in 0..a) {
                // A wrong reflectance affects all channels; a part of the variance is independent in each.
                val share = if (rows.channel(first + a) == rows.channel(first + b)) 1.0 else channelShare
                block[a][b] = share * dot(chart[a], chart[b])
                block[b][a] = block[a][b]
            }
            block[a][a] += independent(first + a)
        }
        return block
    }

    /** Derivative of a row by its patch's errors: relative, absolute, of wavelength. */
    private fun chart(row: Int, at: Int): DoubleArray {
        val own = linearised[rows.shot(row)][rows.channel(row)]
        val width = tolerance[rows.patch(row)]
        val long = own.relative[at].size
        val short = own.edges[at].size
        return DoubleArray(long + 2 * short) {
            when {
                it < long -> width * relativePart * own.relative[at][it]
                it < long + short -> width * absolutePart * own.edges[patches][it - long]
                else -> width * edgePart * own.edges[at][it - long - short]
            }
        }
    }

    /** Variance of a row that is independent of all others. */
    private fun independent(row: Int): Double {
        val noise = inputs.signals.sharedError[rows.at[row]]
        val own = independentShare * tolerance[rows.patch(row)] * signal[row]
        return max(noise * noise + own * own, floor * floor)
    }

    private fun number(word: String): Double = Rules.shipped.number("covariance.$word")

    private fun reflectance(patch: Int, at: Int): Double = inputs.table.sharedValues[patch * Grid.SIZE + at]

    /** Central difference of R per nm, one-sided at the ends. */
    private fun slope(patch: Int, at: Int): Double {
        val after = minOf(at + 1, Grid.SIZE - 1)
        val before = max(at - 1, 0)
        return (reflectance(patch, after) - reflectance(patch, before)) / (Grid.STEP * (after - before))
    }
}

/** Spectra as columns, (681, size), so that one loop sums all of them. */
private class Spectra(private val size: Int, value: (Int, Int) -> Double) {
    private val values = DoubleArray(Grid.SIZE * size) { value(it % size, it / size) }

    /** Σ direction · weight · spectrum over the grid: (size, directions). */
    fun along(directions: List<DoubleArray>, weight: DoubleArray): Array<DoubleArray> {
        val found = Array(size) { DoubleArray(directions.size) }
        val sums = DoubleArray(size)
        for ((q, direction) in directions.withIndex()) {
            sums.fill(0.0)
            for (m in 0 until Grid.SIZE) {
                val factor = direction[m] * weight[m]
                val from = m * size
                for (i in sums.indices) sums[i] += factor * values[from + i]
            }
            for (i in sums.indices) found[i][q] = sums[i]
        }
        return found
    }
}

internal fun dot(a: DoubleArray, b: DoubleArray): Double {
    var total = 0.0
    for (i in a.indices) total += a[i] * b[i]
    return total
}
