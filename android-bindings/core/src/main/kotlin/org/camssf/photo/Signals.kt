package org.camssf.photo

import org.camssf.frozen

/**
 * A fallback that entered the result, for the report.
 *
 * @property code a word.
 * @property message a sentence.
 */
public class Assumption(public val code: String, public val message: String)

/**
 * Signals y of k shots of n patches: the paper's Eq. (5), (chart - dark) / (white - dark).
 *
 * Arrays are (k, n, 3) row-major, columns R, G, B; each call copies one (0.6 kB a shot of 24 patches), so what a caller
 * writes changes nothing here: keep the array in a loop. Safe to pass between threads.
 *
 * @property shots k.
 * @property patches n.
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
    public val values: DoubleArray get() = sharedValues.copyOf()

    /** Standard error of y, 1, propagated from the frames' standard errors. */
    public val standardError: DoubleArray get() = sharedError.copyOf()

    /** Mean of the chart photo, DN. */
    public val chart: DoubleArray get() = sharedChart.copyOf()

    /** What Eq. (5) divided by, DN; fallbacks filled in. */
    public val white: DoubleArray get() = sharedWhite.copyOf()

    /** What it subtracted, DN; fallbacks filled in. */
    public val dark: DoubleArray get() = sharedDark.copyOf()

    /** (k, n): false where a patch must not enter the fit (clipped, lost in noise, not asked for, or the white itself). */
    public val used: BooleanArray get() = sharedUsed.copyOf()

    /** The fallbacks taken. */
    public val assumptions: List<Assumption> = assumptions.frozen()

    /** As even light would have given them: times a level (k, n). */
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

    /** Shot j alone. */
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

    /** The same signals, of which only patches (n) that are asked for enter the fit. */
    internal fun askedFor(asked: BooleanArray): Signals = Signals(
        shots,
        patches,
        sharedValues,
        sharedError,
        sharedChart,
        sharedWhite,
        sharedDark,
        BooleanArray(sharedUsed.size) { sharedUsed[it] && asked[it % patches] },
        assumptions,
    )
}
