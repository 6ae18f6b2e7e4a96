package org.camssf.evidence

import org.camssf.LeastSquares
import org.camssf.Rules
import org.camssf.curves.Ssf
import org.camssf.photo.ChartPose
import org.camssf.photo.Signals
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.pow
import kotlin.math.sqrt

/** What may be wrong with a capture: the suspects of rule 3, by the words of Python and rules.json. */
internal enum class Cause(val word: String) {
    VEIL("veil"),
    WHITE("white"),
    LIGHT("light"),
    TONE("tone"),
    PATCH("patch"),
}

/**
 * One way in which a capture may be wrong, and what it would explain of T.
 *
 * @property patch 0-based; null where it is of no patch.
 * @property gain of T.
 * @property amount its size where it has one direction, in units of that; 0 else.
 */
internal class Suspect(val cause: Cause, val patch: Int?, val gain: Double, val amount: Double)

/**
 * How ill the answer fits what was told: rules 1 to 3 of docs/verdict.md.
 *
 * @property residual part of T, summed over the channels.
 * @property prior the other part.
 * @property count N.
 * @property suspects in the order of rule 3, patches last.
 */
internal class Surprise(val residual: Double, val prior: Double, val count: Int, val suspects: List<Suspect>) {
    /** T. */
    val total: Double get() = residual + prior

    /** T₄. */
    val weighted: Double get() = residual + Rules.shipped.number("verdict.prior_weight") * prior

    /** T as a standard normal number (Wilson and Hilferty 1931). */
    val z: Double
        get() {
            val spread = 2.0 / (9.0 * count)
            return ((total / count).pow(1.0 / 3.0) - (1.0 - spread)) / sqrt(spread)
        }

    /** The strongest suspect, a veil's favoured, if it explains enough: a share of a surprise, else the bound. */
    fun accused(): Suspect? {
        val favour = Rules.shipped.number("verdict.veil_favour")
        val strongest = suspects.maxByOrNull { it.gain * if (it.cause == Cause.VEIL) favour else 1.0 } ?: return null
        val share = Rules.shipped.number("verdict.share")
        val enough = if (z > SURPRISE) share * (total - count) else Rules.shipped.number("verdict.suspect")
        return strongest.takeIf { it.gain > enough }
    }

    companion object {
        /** z(T) from which the evidence contradicts itself. */
        val SURPRISE: Double get() = Rules.shipped.number("verdict.surprise")
    }
}

/** What a surprise is about: an answer, and what it was told. */
internal class Told(
    val signals: Signals,
    val table: ChartTable,
    val lamps: List<Lamp>,
    val ssf: Ssf,
    val whiteReflectance: DoubleArray,
    val whiteTolerance: Double,
) {
    private val n = signals.patches

    /** Used signals, shot by shot: index into (k, n). */
    private val rows = signals.sharedUsed.indices.filter { signals.sharedUsed[it] }.toIntArray()

    /** The parts of the answer to shot j alone that concern that shot. */
    fun only(j: Int, answer: Ssf): Told = Told(
        signals.only(j),
        table,
        listOf(lamps[j]),
        answer.only(j, n),
        whiteReflectance,
        whiteTolerance,
    )

    /** Suspects are questioned where the pose of one shot is given. */
    fun surprise(pose: ChartPose? = null, whiteIsPatch: Boolean = false): Surprise {
        val residuals = List(3) { channel -> column(channel) { signals.sharedValues[it] - ssf.sharedPredicted[it] } }
        val precision = List(3) { channel -> Symmetric.inverse(Covariance(this, rows, channel).matrix()) }
        val weighed = List(3) { channel -> times(precision[channel], residuals[channel]) }
        val residual = (0..2).sumOf { channel -> dot(residuals[channel], weighed[channel]) }
        val prior = if (ssf.sharedStd != null) ssf.sharedCode.sumOf { it * it } else 0.0
        val suspects = if (pose == null) emptyList() else Questioning(precision, weighed).suspects(pose, whiteIsPatch)
        return Surprise(residual, prior, 3 * rows.size, suspects)
    }

    private fun column(channel: Int, value: (Int) -> Double): DoubleArray = DoubleArray(rows.size) {
        value(3 * rows[it] + channel)
    }

    /** Rule 3: Σ⁻¹ of each channel, and Σ⁻¹ r. */
    private inner class Questioning(
        private val precision: List<Array<DoubleArray>>,
        private val weighed: List<DoubleArray>,
    ) {
        private val signal = List(3) { channel -> column(channel) { signals.sharedValues[it] } }

        /** One direction: how every signal would move, a column a channel. */
        private fun way(value: (Int, Int) -> Double): List<DoubleArray> =
            List(3) { channel -> DoubleArray(rows.size) { value(channel, it) } }

        fun suspects(pose: ChartPose, whiteIsPatch: Boolean): List<Suspect> {
            val ways = LinkedHashMap<Cause, List<List<DoubleArray>>>()
            ways[Cause.VEIL] = listOf(way { channel, row -> 1.0 - signal[channel][row] })
            if (!whiteIsPatch) {
                ways[Cause.WHITE] = List(3) { own -> scaled { channel, _ -> if (channel == own) 1.0 else 0.0 } }
            }
            ways[Cause.LIGHT] = unevenness(pose, whiteIsPatch)
            val darkest = Rules.shipped.number("verdict.darkest_tone")
            ways[Cause.TONE] = listOf(scaled { channel, row -> ln(max(signal[channel][row], darkest)) })
            return ways.map { (cause, directions) ->
                val (gain, amount) = gain(directions)
                Suspect(cause, null, gain, amount)
            } + rows.indices.map { row -> Suspect(Cause.PATCH, rows[row] % n, alone(row), 0.0) }
        }

        /** The signals, times something. */
        private fun scaled(by: (Int, Int) -> Double): List<DoubleArray> =
            way { channel, row -> signal[channel][row] * by(channel, row) }

        private fun unevenness(pose: ChartPose, whiteIsPatch: Boolean): List<List<DoubleArray>> {
            val (across, down) = places(pose)
            return listOfNotNull(
                scaled { _, row -> across[row] },
                scaled { _, row -> down[row] },
                scaled { _, row -> across[row] * across[row] + down[row] * down[row] },
                if (whiteIsPatch) signal else null,
            )
        }

        /** What one wrong patch would explain. */
        private fun alone(row: Int): Double = (0..2).sumOf { channel ->
            weighed[channel][row] * weighed[channel][row] / precision[channel][row][row]
        }

        /** What a suspect explains, and its amount. */
        private fun gain(ways: List<List<DoubleArray>>): Pair<Double, Double> {
            val slope = DoubleArray(ways.size) { d -> (0..2).sumOf { dot(ways[d][it], weighed[it]) } }
            val solved = ways.map { way -> List(3) { times(precision[it], way[it]) } }
            val curvature = Array(ways.size) { a ->
                DoubleArray(ways.size) { b -> (0..2).sumOf { dot(ways[a][it], solved[b][it]) } }
            }
            val ridge = 1e-12 * ways.indices.sumOf { curvature[it][it] } + 1e-300
            for (d in ways.indices) curvature[d][d] += ridge
            val amounts = LeastSquares.solve(curvature, slope) ?: return 0.0 to 0.0
            return dot(slope, amounts) to if (ways.size == 1) amounts[0] else 0.0
        }
    }

    /** X, Y of the used patches. */
    private fun places(pose: ChartPose): List<DoubleArray> {
        val centres = List(2) { axis ->
            DoubleArray(rows.size) { row ->
                (0..3).sumOf { pose.sharedQuads[8 * (rows[row] % n) + 2 * it + axis] } / 4
            }
        }
        val size = max(centres.maxOf { it.max() - it.min() }, 1.0)
        return centres.map { axis ->
            val middle = axis.average()
            DoubleArray(axis.size) { (axis[it] - middle) / size }
        }
    }
}

private fun times(matrix: Array<DoubleArray>, vector: DoubleArray): DoubleArray =
    DoubleArray(matrix.size) { dot(matrix[it], vector) }
