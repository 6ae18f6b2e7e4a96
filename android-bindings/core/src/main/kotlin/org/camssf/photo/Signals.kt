package org.camssf.photo

import org.camssf.Rows
import org.camssf.frozen

/**
 * A fallback on which the result relies, for the report.
 *
 * @property code identifies the fallback.
 * @property message a sentence.
 */
public class Assumption(public val code: String, public val message: String) {
    override fun equals(other: Any?): Boolean = other is Assumption && code == other.code && message == other.message

    override fun hashCode(): Int = 31 * code.hashCode() + message.hashCode()

    override fun toString(): String = "$code: $message"
}

/**
 * Signals y of k shots of n patches: the paper's Eq. (5), (chart - dark) / (white - dark).
 *
 * Rows are (k, n, 3), columns R, G, B. Safe to pass between threads.
 *
 * @property shots number of shots k.
 * @property patches number of patches n.
 */
public class Signals internal constructor(
    public val shots: Int,
    public val patches: Int,
    internal val sharedValues: DoubleArray,
    internal val sharedError: DoubleArray,
    internal val sharedChart: DoubleArray,
    internal val sharedWhite: DoubleArray,
    internal val sharedDark: DoubleArray,
    internal val sharedUsed: BooleanArray,
    assumptions: List<Assumption>,
) {
    /** y, 1. */
    public val values: Rows get() = rows(sharedValues)

    /** Standard error of y, 1, propagated from the frames' standard errors. */
    public val standardError: Rows get() = rows(sharedError)

    /** Mean of the chart photo, DN. */
    public val chart: Rows get() = rows(sharedChart)

    /** White level W of Eq. (5), DN, dark level included, with fallbacks filled in. */
    public val white: Rows get() = rows(sharedWhite)

    /** Dark level D of Eq. (5), DN, with fallbacks filled in. */
    public val dark: Rows get() = rows(sharedDark)

    /** False if a patch must not enter the fit (clipped, lost in noise, not selected, or the white itself). */
    public fun isUsed(shot: Int, patch: Int): Boolean = sharedUsed[shot * patches + patch]

    private fun rows(values: DoubleArray) = Rows(values, shots, patches, 3)

    /** The fallbacks used. */
    public val assumptions: List<Assumption> = assumptions.frozen()

    override fun toString(): String = "Signals(shots=$shots, patches=$patches, used=${sharedUsed.count { it }})"

    /** The signals under even illumination: each is multiplied by the light correction `level` (k, n). */
    internal fun levelled(level: DoubleArray): Signals = Signals(
        shots, patches, DoubleArray(sharedValues.size) { sharedValues[it] * level[it / 3] },
        DoubleArray(sharedError.size) { sharedError[it] * level[it / 3] }, sharedChart, sharedWhite, sharedDark,
        sharedUsed, assumptions,
    )

    /** The signals of shot j alone. */
    internal fun only(j: Int): Signals {
        fun part(all: DoubleArray) = all.copyOfRange(3 * patches * j, 3 * patches * (j + 1))
        return Signals(
            1, patches, part(sharedValues), part(sharedError), part(sharedChart), part(sharedWhite), part(sharedDark),
            sharedUsed.copyOfRange(patches * j, patches * (j + 1)), assumptions,
        )
    }

    /** Raw white (3) of shot j above dark, the mean over its used patches; NaN if it has none. */
    internal fun rawWhite(j: Int): DoubleArray {
        val own = (0 until patches).map { j * patches + it }.filter { sharedUsed[it] }
        return DoubleArray(3) { c -> own.sumOf { sharedWhite[3 * it + c] - sharedDark[3 * it + c] } / own.size }
    }

    /** The same signals; only the selected patches (n) enter the fit. */
    internal fun restrictedTo(allowed: BooleanArray): Signals =
        using(BooleanArray(sharedUsed.size) { sharedUsed[it] && allowed[it % patches] })

    /** The same signals, of which these (k, n) enter the fit. */
    internal fun using(used: BooleanArray): Signals = Signals(
        shots, patches, sharedValues, sharedError, sharedChart, sharedWhite, sharedDark, used, assumptions,
    )
}
