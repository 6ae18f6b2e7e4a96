package org.camssf.recovery

import org.camssf.Rules
import kotlin.math.exp
import kotlin.math.min

/**
 * Weighs whether the chart has faded: its colours are duller than in its table.
 *
 * Where a camera seems to belong to no family ([UnfamiliarCamera]), the chart may be the reason. Fading is described by
 * one number for the whole chart ([org.camssf.spectra.faded]). Python's camssf.recovery.faded_chart.
 */
internal object FadedChart {
    /** Prior probability that a chart has faded. */
    private val FADED get() = Rules.shipped.number("choice.faded")

    /** Amounts v that are weighed. */
    private val amounts: DoubleArray
        get() = DoubleArray(Rules.shipped.whole("choice.fading_steps")) {
            (it + 1) * Rules.shipped.number("choice.fading")
        }

    /**
     * The chart's most probable fading, the posterior mean of v, or 0 if its posterior odds are below
     * [Choice.CLEAR].
     *
     * @param logEvidences ln of the marginal likelihood of the signals for each fading v, over all hypotheses.
     */
    fun fading(logEvidences: (DoubleArray) -> DoubleArray): Double {
        val amounts = amounts
        val nats = logEvidences(doubleArrayOf(0.0) + amounts)
        val prior = FADED / (1.0 - FADED) / amounts.size
        val odds = amounts.indices.map { prior * exp(min(nats[it + 1] - nats[0], LARGEST)) }
        if (!(odds.sum() >= Choice.CLEAR)) return 0.0
        return amounts.indices.sumOf { amounts[it] * odds[it] } / odds.sum()
    }

    private const val LARGEST = 700.0
}
