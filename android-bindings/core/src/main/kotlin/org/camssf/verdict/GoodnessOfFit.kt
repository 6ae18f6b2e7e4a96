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

/** What may be wrong with a capture: the explanations of rule 3, by the words of Python and rules.json. */
internal enum class Cause(val word: String) {
    VEIL("veil"),
    BLACK("black"),
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
internal class Explanation(val cause: Cause, val patch: Int?, val gain: Double, val amount: Double)

/**
 * How ill the answer fits what was told: rules 1 to 3 of docs/verdict.md.
 *
 * @property residual part of T, summed over the channels.
 * @property prior the other part.
 * @property count N.
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

    /** T as a standard normal number (Wilson and Hilferty 1931). */
    val z: Double
        get() {
            val spread = 2.0 / (9.0 * count)
            return ((total / count).pow(1.0 / 3.0) - (1.0 - spread)) / sqrt(spread)
        }

    /** Light over the chart only adds: a veil that takes away is the black level, where that may be it. */
    private val possible: List<Explanation>
        get() = explanations.filterNot { mayBeBlack && it.cause == Cause.VEIL && it.amount < 0 }

    private val mayBeBlack: Boolean get() = explanations.any { it.cause == Cause.BLACK }

    /**
     * The likelier of stray light and a wrong black level, where no dark frame was taken; null where one was. Stray light
     * has the white's colour, a wrong black level is the same in every channel.
     */
    val offset: Explanation?
        get() = possible.filter { it.cause in OFFSETS }.maxByOrNull { it.gain }.takeIf { mayBeBlack }

    /** The strongest suspect, and the gain beyond which it is named. */
    fun strongestExplanation(): Pair<Explanation, Double>? {
        val favour = Rules.shipped.number("verdict.veil_favour")
        val strongest = possible.maxByOrNull { it.gain * if (it.cause in OFFSETS) favour else 1.0 } ?: return null
        val share = Rules.shipped.number("verdict.share")
        return strongest to if (z > SURPRISE) share * (total - count) else Rules.shipped.number("verdict.suspect")
    }

    /**
     * The strongest suspect, if it explains enough: a share of a surprise, or the bound. Else the offset.
     *
     * The several directions of a wrong white frame and of uneven light can follow an offset; an offset hardly follows
     * them. So one that alone explains that share of what they do is named in their place.
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
        /** z(T) from which the evidence contradicts itself. */
        val SURPRISE: Double get() = Rules.shipped.number("verdict.surprise")

        /** χ² beyond which an offset is named, where no dark frame was taken. */
        val BLACK: Double get() = Rules.shipped.number("verdict.black")

        /** Suspects that add to every signal; a tone curve looks much like them. */
        private val OFFSETS = setOf(Cause.VEIL, Cause.BLACK)

        /** Suspects of several directions for all patches. */
        private val FREE = setOf(Cause.WHITE, Cause.LIGHT)
    }
}

/** What a surprise is about: an answer, and what it was told. */
internal class VerdictInputs(
    val signals: Signals,
    val table: ChartTable,
    val lamps: List<Lamp>,
    val ssf: Ssf,
    val whiteReflectance: DoubleArray,
    val whiteTolerance: Double,
    gains: Gains? = null,
) {
    /** How the light on the patches may be off; null where that is known. */
    val gains: Gains? = gains?.takeIf { it.modes.values.isNotEmpty() }

    private val rows = Rows(signals)

    /** The parts of the answer to shot j alone that concern that shot. */
    fun only(j: Int, answer: Ssf): VerdictInputs = VerdictInputs(
        signals.only(j),
        table,
        listOf(lamps[j]),
        answer.only(j, signals.patches),
        whiteReflectance,
        whiteTolerance,
        gains?.only(j),
    )

    /** Suspects are questioned where the one shot is given. */
    fun surprise(shot: MeasuredShot? = null): GoodnessOfFit {
        val covariance = Covariance(this, rows)
        val precision = Precision(covariance.blocks, covariance.shared)
        val off = rows.of(signals.sharedValues)
        for (row in off.indices) off[row] -= ssf.sharedPredicted[rows.at[row]]
        val residual = precision.weighed(off)
        val prior = if (ssf.sharedStd != null) ssf.sharedCode.sumOf { it * it } else 0.0
        val explanations = shot?.let { Questioning(precision, residual, it).explanations() }.orEmpty()
        return GoodnessOfFit(dot(residual, residual), prior, rows.size, explanations)
    }

    /** Rule 3: by Σ⁻¹, and what it makes of the residual. */
    private inner class Questioning(
        private val precision: Precision,
        private val residual: DoubleArray,
        private val shot: MeasuredShot,
    ) {
        private val signal = rows.of(signals.sharedValues)

        /** One direction: how every signal would move. */
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

        /** A black level that is off, in parts of the sensor's range. */
        private fun blackLevel(): DoubleArray {
            val (white, dark) = listOf(signals.sharedWhite, signals.sharedDark).map { rows.of(it) }
            return way { (1.0 - signal[it]) / ((white[it] - dark[it]) / (shot.means.saturation - dark[it])) }
        }

        private fun unevenness(): List<DoubleArray> {
            val (x, y) = places(shot.pose)
            // Where a plane and a bowl were solved for, they stand in Σ: what is beyond them.
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

        /** What a suspect explains, and its amount. */
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

    /** X, Y of each row's patch. */
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
