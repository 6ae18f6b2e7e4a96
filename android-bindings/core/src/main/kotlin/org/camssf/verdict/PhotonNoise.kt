package org.camssf.verdict

import org.camssf.Rules
import org.camssf.median
import org.camssf.photo.Estimate
import kotlin.math.abs
import kotlin.math.max
import kotlin.math.pow
import kotlin.math.sqrt

/**
 * Whether a colour's noise is that of its own photons, or of others' too: V = a + g (S + h O) + t S², Python's
 * camssf.photo.photon_noise.
 */
internal object PhotonNoise {
    private val FEWEST get() = Rules.shipped.whole("noise.fewest")
    private val ROUNDS get() = Rules.shipped.whole("noise.rounds")
    private val QUIET get() = Rules.shipped.number("noise.quiet")
    private val FAR get() = Rules.shipped.number("noise.far")
    private val SIGNIFICANT get() = Rules.shipped.number("noise.significant")

    /** Variance of rounding, in squared steps. */
    private const val ROUNDING = 1.0 / 12.0
    private const val ROBUST = 1.4826

    /**
     * h, weighed over the colours; null if no colour has photon noise to judge.
     *
     * @param signal (n, 3) of the patches, above black, DN.
     * @param variance (n, 3) of their samples, rounding included, DN².
     * @param count (n, 3) samples.
     * @param step DN between neighbouring values of the samples.
     */
    fun mixed(signal: DoubleArray, variance: DoubleArray, count: LongArray, step: Double): Estimate? {
        val own = (0..2).mapNotNull { colour ->
            val judged = (0 until signal.size / 3).filter { variance[3 * it + colour] > QUIET * step * step }
            if (judged.size < FEWEST) return@mapNotNull null
            val others = (0..2).filter { it != colour }
            ofColour(
                DoubleArray(judged.size) { max(signal[3 * judged[it] + colour], 0.0) },
                DoubleArray(judged.size) { i -> others.sumOf { signal[3 * judged[i] + it] } / 2.0 },
                DoubleArray(judged.size) { variance[3 * judged[it] + colour] },
                DoubleArray(judged.size) { count[3 * judged[it] + colour].toDouble() },
                ROUNDING * step * step,
            )
        }
        if (own.isEmpty()) return null
        val weight = own.sumOf { it.error.pow(-2) }
        return Estimate(own.sumOf { it.value / (it.error * it.error) } / weight, 1.0 / sqrt(weight))
    }

    /** h of one colour by least squares, reweighted; null if its noise does not grow with its signal. */
    private fun ofColour(
        own: DoubleArray,
        others: DoubleArray,
        variance: DoubleArray,
        count: DoubleArray,
        rounding: Double,
    ): Estimate? {
        val n = own.size
        val relative = DoubleArray(n) { sqrt(2.0 / max(count[it] - 3.0, 1.0)) }
        val one = DoubleArray(n) { 1.0 }
        val square = DoubleArray(n) { own[it] * own[it] }
        val photons = DoubleArray(n) { variance[it] - rounding }
        var predicted = variance
        var trust = one
        var scale = 1.0
        var fit = DoubleArray(3)
        repeat(ROUNDS) {
            val weight = DoubleArray(n) { trust[it] / (relative[it] * predicted[it]) }
            val (a, g, t) = LeastSquares.positive(listOf(one, own, square).map { it * weight }, photons * weight)
            val rest = DoubleArray(n) { photons[it] - t * square[it] }
            fit = LeastSquares(listOf(one, own, others).map { it * weight }).solve(rest * weight)
            val line = DoubleArray(n) { fit[0] + fit[1] * own[it] + fit[2] * others[it] }
            predicted = DoubleArray(n) { max(max(line[it], a + g * own[it]) + t * square[it] + rounding, rounding) }
            val off = DoubleArray(n) { abs(rest[it] - line[it]) / (relative[it] * predicted[it]) }
            scale = max(1.0, ROBUST * median(off))
            trust = DoubleArray(n) { 1.0 / sqrt(max(1.0, off[it] / (FAR * scale))) }
        }
        val weight = DoubleArray(n) { trust[it] / (relative[it] * predicted[it]) }
        val variances = LeastSquares(listOf(one, own, others).map { it * weight }).variances()
        if (fit[1] <= SIGNIFICANT * sqrt(variances[1])) return null
        return Estimate(fit[2] / fit[1], scale * sqrt(variances[2]) / fit[1])
    }

    private operator fun DoubleArray.times(other: DoubleArray) = DoubleArray(size) { this[it] * other[it] }
}

/** Least squares of few columns, by the modified Gram-Schmidt process on columns of length 1. */
internal class LeastSquares(columns: List<DoubleArray>) {
    private val length = columns.map { norm(it) }
    private val basis = ArrayList<DoubleArray>()
    private val triangle = Array(columns.size) { DoubleArray(columns.size) }

    init {
        for (j in columns.indices) {
            val rest = DoubleArray(columns[j].size) { columns[j][it] / length[j] }
            for (i in 0 until j) {
                triangle[i][j] = dot(basis[i], rest)
                for (k in rest.indices) rest[k] -= triangle[i][j] * basis[i][k]
            }
            triangle[j][j] = norm(rest)
            basis += DoubleArray(rest.size) { rest[it] / triangle[j][j] }
        }
    }

    fun solve(target: DoubleArray): DoubleArray {
        val rest = target.copyOf()
        val found = DoubleArray(basis.size) { i ->
            dot(basis[i], rest).also { for (k in rest.indices) rest[k] -= it * basis[i][k] }
        }
        return back(found).let { x -> DoubleArray(x.size) { x[it] / length[it] } }
    }

    /** The diagonal of the inverse of the columns' products. */
    fun variances(): DoubleArray {
        val inverse = basis.indices.map { j -> back(DoubleArray(basis.size) { if (it == j) 1.0 else 0.0 }) }
        return DoubleArray(basis.size) { i -> inverse.sumOf { it[i] * it[i] } / (length[i] * length[i]) }
    }

    private fun back(right: DoubleArray): DoubleArray {
        val x = right.copyOf()
        for (i in x.indices.reversed()) {
            for (j in i + 1 until x.size) x[i] -= triangle[i][j] * x[j]
            x[i] /= triangle[i][i]
        }
        return x
    }

    companion object {
        /** x ≥ 0 with the least error: the best of all sets of positive ones. */
        fun positive(columns: List<DoubleArray>, target: DoubleArray): DoubleArray {
            var best = DoubleArray(columns.size)
            var least = dot(target, target)
            for (set in 1 until (1 shl columns.size)) {
                val some = columns.indices.filter { set shr it and 1 == 1 }
                val own = LeastSquares(some.map { columns[it] }).solve(target)
                if (!own.all { it >= 0.0 }) continue
                val off = DoubleArray(target.size) { k ->
                    some.indices.sumOf { columns[some[it]][k] * own[it] } - target[k]
                }
                if (dot(off, off) < least) {
                    least = dot(off, off)
                    best = DoubleArray(columns.size) { i -> some.indexOf(i).let { if (it < 0) 0.0 else own[it] } }
                }
            }
            return best
        }

        private fun dot(a: DoubleArray, b: DoubleArray): Double {
            var sum = 0.0
            for (k in a.indices) sum += a[k] * b[k]
            return sum
        }

        private fun norm(a: DoubleArray) = sqrt(dot(a, a)).let { if (it > 0.0) it else 1.0 }
    }
}
