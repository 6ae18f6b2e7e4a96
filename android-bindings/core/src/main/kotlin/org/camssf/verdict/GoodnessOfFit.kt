package org.camssf.verdict

import org.camssf.LeastSquares
import org.camssf.Rules
import org.camssf.photo.ChartPose
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Signals
import org.camssf.recovery.Gains
import org.camssf.recovery.Ssf
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.pow
import kotlin.math.sqrt

/** Possible errors of a capture: the explanations of rule 3, named as in Python and rules.json. */
internal enum class Cause(val word: String) {
    VEIL("veil"),
    BLACK("black"),
    WHITE("white"),
    LIGHT("light"),
    TONE("tone"),
    PATCH("patch"),
}

/**
 * One possible error of a capture, and the part of T that it explains (rule 3).
 *
 * @property patch 0-based; null unless the cause is a patch.
 * @property gain the explained part of T.
 * @property amount size of the error in units of its direction if it has one direction, else 0.
 */
internal class Explanation(val cause: Cause, val patch: Int?, val gain: Double, val amount: Double)

/**
 * χ² of the residuals and of the prior (rules 1 to 3 of docs/verdict.md).
 *
 * @property residual part of T from the residuals, summed over the channels.
 * @property prior part of T from the prior.
 * @property count N, the degrees of freedom.
 * @property explanations in the order of rule 3, patches last.
 */
internal class GoodnessOfFit(
    val residual: Double,
    val prior: Double,
    val count: Int,
    val explanations: List<Explanation>,
) {
    /** T. */
    val total: Double get() = residual + prior

    /** z(T): T transformed to a standard normal number (Wilson and Hilferty 1931). */
    val z: Double
        get() {
            val spread = 2.0 / (9.0 * count)
            return ((total / count).pow(1.0 / 3.0) - (1.0 - spread)) / sqrt(spread)
        }

    /** The physically possible explanations: stray light cannot be negative; that would be a wrong black level. */
    private val possible: List<Explanation>
        get() = explanations.filterNot { mayBeBlack && it.cause == Cause.VEIL && it.amount < 0 }

    private val mayBeBlack: Boolean get() = explanations.any { it.cause == Cause.BLACK }

    /**
     * The likelier of stray light and a wrong black level if there is no dark frame, else null. Stray light has the
     * white's colour; a wrong black level is the same in every channel.
     */
    val offset: Explanation?
        get() = possible.filter { it.cause in OFFSETS }.maxByOrNull { it.gain }.takeIf { mayBeBlack }

    /** The strongest explanation, and the gain above which it is reported; null if there is none. */
    fun strongestExplanation(): Pair<Explanation, Double>? {
        val favour = Rules.shipped.number("verdict.veil_favour")
        val strongest = possible.maxByOrNull { it.gain * if (it.cause in OFFSETS) favour else 1.0 } ?: return null
        val share = Rules.shipped.number("verdict.share")
        val bound = if (z > GOODNESS_OF_FIT) share * (total - count) else Rules.shipped.number("verdict.explanation")
        return strongest to bound
    }

    /**
     * The explanation to report; null if none explains enough.
     *
     * This is the strongest one if its gain exceeds the limit of [strongestExplanation], else an offset above
     * [BLACK]. The several directions of a wrong white frame and of uneven light can imitate an offset, but an offset
     * can hardly imitate them. So an offset that explains more than `verdict.share` of their gain replaces them.
     */
    fun bestExplanation(): Explanation? {
        val (strongest, enough) = strongestExplanation() ?: return null
        val named = strongest.takeIf { it.gain > enough }
        val found = offset?.takeIf { it.gain > BLACK } ?: return named
        val share = Rules.shipped.number("verdict.share")
        val imitated = strongest.cause in FREE && found.gain > share * strongest.gain
        return named.takeUnless { imitated } ?: found
    }

    companion object {
        /** Limit of z(T): above it the answer does not fit its signals. */
        val GOODNESS_OF_FIT: Double get() = Rules.shipped.number("verdict.goodness_of_fit")

        /** Gain above which an offset is reported if there is no dark frame. */
        val BLACK: Double get() = Rules.shipped.number("verdict.black")

        /** Explanations that add to every signal; a tone curve has a similar effect. */
        private val OFFSETS = setOf(Cause.VEIL, Cause.BLACK)

        /** Explanations with several directions, common to all patches. */
        private val FREE = setOf(Cause.WHITE, Cause.LIGHT)
    }
}

/** The k measured shots that a verdict judges, with their chart, lamps, white reference and answer. */
internal class VerdictInputs(
    val signals: Signals,
    val table: ChartTable,
    val lamps: List<Lamp>,
    val ssf: Ssf,
    val whiteReflectance: DoubleArray,
    val whiteTolerance: Double,
    gains: Gains? = null,
) {
    /** Gain modes of the light on the patches; null if there are none. */
    val gains: Gains? = gains?.takeIf { it.modes.values.isNotEmpty() }

    private val rows = Rows(signals)

    /** The inputs of shot j only, with the answer to that shot. */
    fun only(j: Int, answer: Ssf): VerdictInputs = VerdictInputs(
        signals.only(j),
        table,
        listOf(lamps[j]),
        answer.only(j, signals.patches),
        whiteReflectance,
        whiteTolerance,
        gains?.only(j),
    )

    /** Rules 1 and 2; with `shot`, for inputs of this shot only, also the explanations of rule 3. */
    fun goodnessOfFit(shot: MeasuredShot? = null): GoodnessOfFit {
        val covariance = Covariance(this, rows)
        val precision = Precision(covariance.blocks, covariance.shared)
        val off = rows.of(signals.sharedValues)
        for (row in off.indices) off[row] -= ssf.sharedPredicted[rows.at[row]]
        val residual = precision.weighed(off)
        val prior = if (ssf.sharedStd != null) ssf.sharedCode.sumOf { it * it } else 0.0
        val explanations = shot?.let { ExplainedParts(precision, residual, it).explanations() }.orEmpty()
        return GoodnessOfFit(dot(residual, residual), prior, rows.size, explanations)
    }

    /** Computes the explanations of rule 3 from Σ⁻¹ and the weighted residual. */
    private inner class ExplainedParts(
        private val precision: Precision,
        private val residual: DoubleArray,
        private val shot: MeasuredShot,
    ) {
        private val signal = rows.of(signals.sharedValues)

        /** One direction: the change of every signal. */
        private inline fun way(value: (Int) -> Double) = DoubleArray(rows.size) { value(it) }

        fun explanations(): List<Explanation> {
            val ways = LinkedHashMap<Cause, List<DoubleArray>>()
            ways[Cause.VEIL] = listOf(way { 1.0 - signal[it] })
            if (shot.means.dark == null) ways[Cause.BLACK] = listOf(blackLevel())
            if (shot.means.white != null) {
                ways[Cause.WHITE] = List(3) { own -> way { if (rows.channel(it) == own) signal[it] else 0.0 } }
            }
            ways[Cause.LIGHT] = unevenness()
            val darkest = Rules.shipped.number("verdict.darkest_tone")
            ways[Cause.TONE] = listOf(way { signal[it] * ln(max(signal[it], darkest)) })
            return ways.map { (cause, directions) ->
                val (gain, amount) = gain(directions)
                Explanation(cause, null, gain, amount)
            } + rows.patches.mapIndexed { at, patch ->
                Explanation(Cause.PATCH, patch, precision.alone(at, residual), 0.0)
            }
        }

        /** Direction of a wrong black level, in shares of the sensor's range. */
        private fun blackLevel(): DoubleArray {
            val (white, dark) = listOf(signals.sharedWhite, signals.sharedDark).map { rows.of(it) }
            return way { (1.0 - signal[it]) / ((white[it] - dark[it]) / (shot.means.saturation - dark[it])) }
        }

        private fun unevenness(): List<DoubleArray> {
            val (x, y) = places(shot.pose)
            // If Σ includes plane and bowl of the light, use the cubic terms.
            val falls = if (gains != null) {
                listOf(
                    way { signal[it] * x[it] * x[it] * x[it] },
                    way { signal[it] * x[it] * x[it] * y[it] },
                    way { signal[it] * x[it] * y[it] * y[it] },
                    way { signal[it] * y[it] * y[it] * y[it] },
                )
            } else {
                listOf(
                    way { signal[it] * x[it] },
                    way { signal[it] * y[it] },
                    way { signal[it] * (x[it] * x[it] + y[it] * y[it]) },
                )
            }
            return falls + listOfNotNull(signal.takeIf { shot.means.white == null })
        }

        /** Gain and amount of an explanation. */
        private fun gain(ways: List<DoubleArray>): Pair<Double, Double> {
            val solved = ways.map { precision.weighed(it) }
            val slope = DoubleArray(ways.size) { dot(solved[it], residual) }
            val curvature = Array(ways.size) { a -> DoubleArray(ways.size) { b -> dot(solved[a], solved[b]) } }
            val ridge = 1e-12 * ways.indices.sumOf { curvature[it][it] } + 1e-300
            for (d in ways.indices) curvature[d][d] += ridge
            val amounts = LeastSquares.solve(curvature, slope) ?: return 0.0 to 0.0
            return dot(slope, amounts) to if (ways.size == 1) amounts[0] else 0.0
        }
    }

    /** Centres X, Y of each row's patch, about their mean, divided by the larger range. */
    private fun places(pose: ChartPose): List<DoubleArray> {
        val centres = List(2) { axis ->
            DoubleArray(rows.size) { row ->
                (0..3).sumOf { pose.sharedQuads[8 * rows.patch(row) + 2 * it + axis] } / 4
            }
        }
        val size = max(centres.maxOf { it.max() - it.min() }, 1.0)
        return centres.map { axis ->
            val middle = axis.average()
            DoubleArray(axis.size) { (axis[it] - middle) / size }
        }
    }
}
