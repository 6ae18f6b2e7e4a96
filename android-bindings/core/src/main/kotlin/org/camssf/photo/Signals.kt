package org.camssf.photo

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
 * Arrays are (k, n, 3) row-major, columns R, G, B. Each call copies one (0.6 kB per shot of 24 patches), so the
 * caller may modify it; keep the array instead of calling in a loop. Safe to pass between threads.
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
    public fun copyValues(): DoubleArray = sharedValues.copyOf()

    /** Standard error of y, 1, propagated from the frames' standard errors. */
    public fun copyStandardError(): DoubleArray = sharedError.copyOf()

    /** Mean of the chart photo, DN. */
    public fun copyChart(): DoubleArray = sharedChart.copyOf()

    /** White level W of Eq. (5), DN, dark level included, with fallbacks filled in. */
    public fun copyWhite(): DoubleArray = sharedWhite.copyOf()

    /** Dark level D of Eq. (5), DN, with fallbacks filled in. */
    public fun copyDark(): DoubleArray = sharedDark.copyOf()

    /**
     * (k, n) false where a patch must not enter the fit (clipped, lost in noise, not selected, or the white itself).
     */
    public fun copyUsed(): BooleanArray = sharedUsed.copyOf()

    /** The fallbacks used. */
    public val assumptions: List<Assumption> = assumptions.frozen()

    override fun toString(): String = "Signals(shots=$shots, patches=$patches, used=${sharedUsed.count { it }})"

    /** The signals under even illumination: each is multiplied by the light correction `level` (k, n). */
    internal fun levelled(level: DoubleArray): Signals = Signals(
        shots,
        patches,
        DoubleArray(sharedValues.size) { sharedValues[it] * level[it / 3] },
        DoubleArray(sharedError.size) { sharedError[it] * level[it / 3] },
        sharedChart,
        sharedWhite,
        sharedDark,
        sharedUsed,
        assumptions,
    )

    /** The signals of shot j alone. */
    internal fun only(j: Int): Signals {
        fun part(all: DoubleArray) = all.copyOfRange(3 * patches * j, 3 * patches * (j + 1))
        return Signals(
            1,
            patches,
            part(sharedValues),
            part(sharedError),
            part(sharedChart),
            part(sharedWhite),
            part(sharedDark),
            sharedUsed.copyOfRange(patches * j, patches * (j + 1)),
            assumptions,
        )
    }

    /** The same signals; only the selected patches (n) enter the fit. */
    internal fun restrictedTo(allowed: BooleanArray): Signals = Signals(
        shots,
        patches,
        sharedValues,
        sharedError,
        sharedChart,
        sharedWhite,
        sharedDark,
        BooleanArray(sharedUsed.size) { sharedUsed[it] && allowed[it % patches] },
        assumptions,
    )
}
