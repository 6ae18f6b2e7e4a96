package org.camssf.verdict

import org.camssf.Rules
import kotlin.math.pow
import kotlin.math.sqrt

/** Possible errors of a capture: the explanations of rule 3, named and ordered as in Python and rules.json. */
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
