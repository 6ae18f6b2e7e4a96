package org.camssf.colour

import kotlin.math.exp
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.sqrt

/**
 * Signals and outputs as linear functions of reflectance at the 35 nodes, and their errors.
 *
 * @property signals (c) of (35); a perfect white gives 1 in each.
 * @property outputs (p) of (35): what is computed of the reflectance.
 * @property moves of each source of error its independent errors, one standard deviation each: changes (c + u) of (35)
 *   of the signals and of the last u outputs; the other outputs have none.
 */
internal class LinearResponse(
    val signals: List<DoubleArray>,
    val outputs: List<DoubleArray>,
    val moves: Map<Part, List<List<DoubleArray>>>,
)

/**
 * Outputs of one surface given its signals.
 *
 * @property mean (p).
 * @property parts terms of the covariance in the order of [Part], (p, p) each, row-major.
 * @property distance from the nearest surface of the prior, in standard deviations.
 * @property level that the signals were divided by.
 * @property signalCovariance (c, c) of the signals by all errors, row-major.
 */
internal class SurfaceOutputs(
    val mean: DoubleArray,
    val parts: List<DoubleArray>,
    val distance: Double,
    val level: Double,
    val signalCovariance: DoubleArray,
)

/**
 * The posterior of outputs given signals, for a prior of measured surfaces; the formulas are those of Python's
 * `camssf_colour.posterior` and stand in docs/spectrum.md. Immutable; safe to share between threads.
 */
internal class SurfacePosterior(private val prior: SurfacePrior, private val response: LinearResponse) {
    private val c = response.signals.size
    private val p = response.outputs.size
    private val u = response.moves.values.flatten().firstOrNull()?.let { it.size - c } ?: 0
    private val errors = c + 1 + u
    private val rows = response.signals + response.outputs
    private val count = prior.shapes.size

    /** Covariances (rows, rows) of signals and outputs by C, and by F. */
    private val byCommon = through(prior.common)
    private val byFine = through(SurfacePrior.fine)

    /** (N) the mean of A s_i that s_i is divided by. */
    private val scale = DoubleArray(count) { i -> response.signals.sumOf { dot(it, prior.shapes[i]) } / c }

    /** (N) of (rows): signals and outputs of s_i. */
    private val centres = List(count) { i -> DoubleArray(rows.size) { dot(rows[it], prior.shapes[i]) / scale[i] } }

    /** (N) of (q) of (rows): signals and outputs of the prior's changes of s_i. */
    private val changes = List(count) { i ->
        val s = prior.shapes[i]
        prior.changes.map { change ->
            val moved = DoubleArray(s.size) { s[it] * change[it] / scale[i] }
            DoubleArray(rows.size) { dot(rows[it], moved) }
        }
    }

    /** (N) A C_i Aᵀ, (c, c). */
    private val signalCovariances: List<DoubleArray>

    /** By source (N) covariances (errors, errors) of the signals over their level, of the level, of the outputs. */
    private val ofErrors: Map<Part, List<DoubleArray>>

    init {
        if (!scale.all { it > 0 }) throw NoColour.error()
        signalCovariances = List(count) { covariance(it, c) }
        ofErrors = response.moves.mapValues { (_, moves) -> List(count) { joint(moves, it) } }
    }

    private fun through(covariance: Array<DoubleArray>): Array<DoubleArray> {
        val half = rows.map { row ->
            DoubleArray(row.size).also { for (n in row.indices) add(it, row[n], covariance[n]) }
        }
        return Array(rows.size) { a -> DoubleArray(rows.size) { dot(half[a], rows[it]) } }
    }

    /** Covariance (n, n) of the first n rows by C_i; the surface's own change of the level is divided out. */
    private fun covariance(i: Int, n: Int): DoubleArray {
        val wide = prior.widths[i] * prior.widths[i] / (scale[i] * scale[i])
        val narrow = 1 / (scale[i] * scale[i])
        val covariance = DoubleArray(n * n) { wide * byCommon[it / n][it % n] + narrow * byFine[it / n][it % n] }
        for (change in changes[i]) for (at in covariance.indices) covariance[at] += change[at / n] * change[at % n]
        val share = DoubleArray(n) { a -> (0 until c).sumOf { covariance[a * n + it] } / c }
        val level = (0 until c).sumOf { share[it] } / c
        val centre = centres[i]
        for (at in covariance.indices) {
            val (a, b) = at / n to at % n
            covariance[at] += level * centre[a] * centre[b] - centre[a] * share[b] - share[a] * centre[b]
        }
        return covariance
    }

    private fun joint(moves: List<List<DoubleArray>>, i: Int): DoubleArray {
        val s = prior.shapes[i]
        val covariance = DoubleArray(errors * errors)
        val one = DoubleArray(errors)
        for (move in moves) {
            for (row in 0 until c) one[row] = dot(move[row], s) / scale[i]
            val level = (0 until c).sumOf { one[it] } / c
            for (row in 0 until c) one[row] -= centres[i][row] * level
            one[c] = level
            for (row in 0 until u) one[c + 1 + row] = dot(move[c + row], s) / scale[i]
            for (at in covariance.indices) covariance[at] += one[at / errors] * one[at % errors]
        }
        return covariance
    }

    /** As `ofErrors`, of independent errors of z with these variances (c). */
    private fun ofNoise(i: Int, variances: DoubleArray): DoubleArray {
        val covariance = DoubleArray(errors * errors)
        val one = DoubleArray(errors)
        for (k in 0 until c) {
            for (row in 0 until c) one[row] = (if (row == k) 1.0 else 0.0) - centres[i][row] / c
            one[c] = 1.0 / c
            for (at in covariance.indices) covariance[at] += variances[k] * one[at / errors] * one[at % errors]
        }
        return covariance
    }

    /** Per surface of the prior what a weight needs: V_i⁻¹ (c, c), ln of the weight but for d_iᵀ V_i⁻¹ d_i, and V_i. */
    private inner class WeightTerms(noise: DoubleArray?) {
        val ofNoise = noise?.let { variances -> List(count) { ofNoise(it, variances) } }
        val inverse = Array(count) { DoubleArray(c * c) }
        val log = DoubleArray(count)

        init {
            for (i in 0 until count) {
                // Nothing changes the mean of z, so any variance of it serves.
                val spread = Array(c) { a ->
                    DoubleArray(c) { b -> signalCovariances[i][a * c + b] + total(i, a * errors + b) + 1.0 }
                }
                val root = Symmetric.root(spread) ?: throw NoColour.error()
                val unit = Array(c) { a -> DoubleArray(c) { if (it == a) 1.0 else 0.0 } }
                val inverted = Symmetric.solve(root, unit)
                for (at in inverse[i].indices) inverse[i][at] = inverted[at / c][at % c]
                log[i] = prior.logWeights[i] - root.indices.sumOf { ln(root[it][it]) }
            }
        }

        /** One number of the sum of all errors' covariances. */
        fun total(i: Int, at: Int): Double =
            ofErrors.values.sumOf { it[i][at] } + (ofNoise?.let { it[i][at] } ?: 0.0)

        /** d_iᵀ V_i⁻¹ d_i, and d_i into `off`. */
        fun square(i: Int, z: DoubleArray, bright: Double, off: DoubleArray): Double {
            val centre = centres[i]
            for (a in 0 until c) off[a] = z[a] - bright * centre[a]
            val precision = inverse[i]
            var square = 0.0
            for (a in 0 until c) {
                var row = 0.0
                for (b in 0 until c) row += precision[a * c + b] * off[b]
                square += off[a] * row
            }
            return square
        }
    }

    /** G_i (p, c), with the errors' own changes of the outputs; and M C_i Aᵀ (p, c) of the covariance of all rows. */
    private fun gain(i: Int, terms: WeightTerms, full: DoubleArray): Pair<DoubleArray, DoubleArray> {
        val n = rows.size
        val crossed = DoubleArray(p * c) { full[(c + it / c) * n + it % c] }
        val moved = DoubleArray(p * c) {
            val (row, column) = it / c to it % c
            val last = row - (p - u)
            val output = if (last >= 0) terms.total(i, (c + 1 + last) * errors + column) else 0.0
            crossed[it] - centres[i][c + row] * terms.total(i, c * errors + column) + output
        }
        val inverse = terms.inverse[i]
        val gain = DoubleArray(p * c) { at ->
            (0 until c).sumOf { moved[at - at % c + it] * inverse[it * c + at % c] }
        }
        return gain to crossed
    }

    /** The posterior of one surface, from its signals (c). */
    fun of(surface: RelativeSignals): SurfaceOutputs {
        val (y, error) = surface.values to surface.standardError
        val level = max(y.sum() / c, max(sqrt(dot(error, error)) / c, DARKEST))
        val z = DoubleArray(c) { y[it] / level }
        val bright = z.sum() / c
        val terms = WeightTerms(DoubleArray(c) { (error[it] / level).let { relative -> relative * relative } })
        val off = List(count) { DoubleArray(c) }
        val squares = DoubleArray(count) { terms.square(it, z, bright, off[it]) }
        val log = DoubleArray(count) { terms.log[it] - 0.5 * squares[it] }
        val most = log.maxOrNull()!!
        val kept = log.indices.filter { exp(log[it] - most) > NEGLIGIBLE }
        val whole = kept.sumOf { exp(log[it] - most) }
        val sources = ofErrors + (Part.NOISE to terms.ofNoise!!)
        val parts = Part.values().associateWith { DoubleArray(p * p) }
        val metamers = parts.getValue(Part.METAMERS)
        val mean = DoubleArray(p)
        val ofSignals = DoubleArray(c * c)
        val means = kept.map { i ->
            val weight = exp(log[i] - most) / whole
            val full = covariance(i, rows.size)
            val (gain, crossed) = gain(i, terms, full)
            val slopes = slopes(i, gain)
            for ((part, spreads) in sources) addThrough(parts.getValue(part), weight, slopes, spreads[i], errors)
            addLeft(metamers, weight, full, gain, crossed)
            addSignals(ofSignals, weight, i, terms)
            val outputs = DoubleArray(p) { row ->
                bright * centres[i][c + row] + (0 until c).sumOf { gain[row * c + it] * off[i][it] }
            }
            add(mean, weight, outputs)
            weight to outputs
        }
        for ((weight, outputs) in means) {
            for (at in metamers.indices) {
                metamers[at] += weight * (outputs[at / p] - mean[at / p]) * (outputs[at % p] - mean[at % p])
            }
        }
        return SurfaceOutputs(
            DoubleArray(p) { level * mean[it] },
            Part.values().map { part -> parts.getValue(part).also { scaled(it, level * level) } },
            sqrt(squares.minOrNull()!!),
            level,
            ofSignals.also { scaled(it, level * level) },
        )
    }

    /** into += weight B E Bᵀ with E of all errors and B = (1, A s_i): a change of the level moves all signals. */
    private fun addSignals(into: DoubleArray, weight: Double, i: Int, terms: WeightTerms) {
        val centre = centres[i]
        val last = terms.total(i, c * errors + c)
        for (at in into.indices) {
            val (a, b) = at / c to at % c
            val (left, right) = listOf(a, b).map { terms.total(i, c * errors + it) }
            val crossed = centre[a] * right + centre[b] * left
            into[at] += weight * (terms.total(i, a * errors + b) + crossed + centre[a] * centre[b] * last)
        }
    }

    /**
     * What the means of the first outputs need for any z of mean 1 without noise, of each surface of the prior: ln of
     * its weight is log - ½ zᵀ Q z, and the outputs are K z.
     *
     * @property log (N).
     * @property forms (N) of (6): Q₀₀, Q₁₁, Q₂₂, 2 Q₀₁, 2 Q₀₂, 2 Q₁₂.
     * @property maps (N) of (outputs, 3), row-major.
     */
    class Exact(val log: DoubleArray, val forms: List<DoubleArray>, val maps: List<DoubleArray>)

    /** For one photo, and so many outputs. */
    fun exact(outputs: Int): Exact {
        val terms = WeightTerms(null)
        val free = List(count) { i ->
            DoubleArray(9) { (if (it / 3 == it % 3) 1.0 else 0.0) - centres[i][it / 3] / 3 } // d = free z
        }
        val forms = List(count) { i ->
            val q = Spaces.product(Spaces.product(transposed(free[i]), terms.inverse[i]), free[i])
            doubleArrayOf(q[0], q[4], q[8], q[1] + q[3], q[2] + q[6], q[5] + q[7])
        }
        val maps = List(count) { i ->
            val gain = gain(i, terms, covariance(i, rows.size)).first
            DoubleArray(3 * outputs) { at ->
                val row = at / 3
                centres[i][3 + row] / 3 + (0..2).sumOf { gain[3 * row + it] * free[i][3 * it + at % 3] }
            }
        }
        return Exact(terms.log, forms, maps)
    }

    /** Changes (p, errors) of the outputs by the errors that are joint in `ofErrors`. */
    private fun slopes(i: Int, gain: DoubleArray): DoubleArray {
        val slopes = DoubleArray(p * errors)
        for (row in 0 until p) {
            for (a in 0 until c) slopes[row * errors + a] = -gain[row * c + a]
            slopes[row * errors + c] = -centres[i][c + row] // an error of the level scales all outputs
            val last = row - (p - u)
            if (last >= 0) slopes[row * errors + c + 1 + last] = 1.0
        }
        return slopes
    }

    /** into += weight (M C Mᵀ - G A C Mᵀ - (G A C Mᵀ)ᵀ + G A C Aᵀ Gᵀ). */
    private fun addLeft(
        into: DoubleArray,
        weight: Double,
        full: DoubleArray,
        gain: DoubleArray,
        crossed: DoubleArray,
    ) {
        val n = rows.size
        val inner = DoubleArray(c * c) { full[it / c * n + it % c] }
        addThrough(into, weight, gain, inner, c)
        for (a in 0 until p) {
            for (b in 0 until p) {
                var both = 0.0
                for (k in 0 until c) {
                    both += gain[a * c + k] * crossed[b * c + k] + gain[b * c + k] * crossed[a * c + k]
                }
                into[a * p + b] += weight * (full[(c + a) * n + c + b] - both)
            }
        }
    }

    /** into (p, p) += weight L Σ Lᵀ, with L (p, n) and Σ (n, n). */
    private fun addThrough(into: DoubleArray, weight: Double, left: DoubleArray, middle: DoubleArray, n: Int) {
        val half = DoubleArray(n)
        for (a in 0 until p) {
            half.fill(0.0)
            for (k in 0 until n) {
                val factor = weight * left[a * n + k]
                if (factor != 0.0) for (m in 0 until n) half[m] += factor * middle[k * n + m]
            }
            for (b in 0 until p) {
                var total = 0.0
                for (m in 0 until n) total += half[m] * left[b * n + m]
                into[a * p + b] += total
            }
        }
    }

    /** (p) variance of the outputs of a surface of level 1, without a photo. */
    val priorVariance: DoubleArray by lazy {
        val most = prior.logWeights.maxOrNull()!!
        val weights = DoubleArray(count) { exp(prior.logWeights[it] - most) }
        val whole = weights.sum()
        val mean = DoubleArray(p)
        for (i in 0 until count) for (row in 0 until p) mean[row] += weights[i] / whole * centres[i][c + row]
        val variance = DoubleArray(p)
        for (i in 0 until count) {
            val full = covariance(i, rows.size)
            for (row in 0 until p) {
                val apart = centres[i][c + row] - mean[row]
                variance[row] += weights[i] / whole * (full[(c + row) * (rows.size + 1)] + apart * apart)
            }
        }
        variance
    }

    private companion object {
        /** Surfaces with less than this share of the largest weight are left out. */
        const val NEGLIGIBLE = 1e-5

        /** Least level that signals are divided by. */
        const val DARKEST = 1e-6

        fun transposed(m: DoubleArray) = DoubleArray(9) { m[it % 3 * 3 + it / 3] }

        fun scaled(values: DoubleArray, factor: Double) {
            for (at in values.indices) values[at] *= factor
        }
    }
}
