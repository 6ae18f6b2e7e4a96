package org.camssf

import org.camssf.photo.Signals
import org.camssf.spectra.Lamp
import kotlin.math.max

/** Says in words how large each error source of the uncertainty budget is. */
internal object BudgetWords {
    private val FAINTEST get() = Rules.shipped.number("calibration.faintest")

    /** The size of each source by its name in the budget. */
    fun sizes(fit: CaptureFit, signals: Signals, lightPerPatch: Double?): Map<String, String> {
        val chart = short(Rules.shipped.number("covariance.chart_correlation"))
        val lamps = short(Rules.shipped.number("covariance.lamp_correlation"))
        return mapOf(
            "noise" to "standard errors of the signals, median ${percent(noise(signals), 2)}",
            "chart" to "${percent(median(fit.table.sharedTolerance), 1)} a patch, smooth over $chart nm, " +
                "more in the deep red, the same under every lamp",
            "white" to "${percent(fit.whiteTolerance, 1)}, smooth over $chart nm",
            "lamp" to fit.lamps.joinToString { percent(it.tolerance, 1) } + ", smooth over $lamps nm",
            "lamp modes" to fit.lamps.joinToString { "${Lamp.kindOf(it.name) ?: it.name}: ${it.sharedModes.size}" },
            "uneven light" to evenness(fit, lightPerPatch),
            "unseen" to "the part of the prior's variance that the signals do not reduce, " +
                "and what every basis misses",
            "which lamp" to "the difference between the results for each kind of light",
        )
    }

    /** Median standard error of the used signals, relative to the signal. */
    private fun noise(signals: Signals): Double {
        val used = signals.sharedValues.indices.filter { signals.sharedUsed[it / 3] }
        return median(used.map { signals.sharedError[it] / max(signals.sharedValues[it], FAINTEST) }.toDoubleArray())
    }

    private fun evenness(fit: CaptureFit, lightPerPatch: Double?): String {
        lightPerPatch?.let { return "${percent(it, 1)} from patch to patch, the same for all channels" }
        if (fit.gains.modes.values.isEmpty()) return "none: a white frame was taken"
        val (plane, bowl) = listOf("plane", "bowl").map { percent(Rules.shipped.number("gains.$it"), 0) }
        return "$plane of plane and $bowl of bowl across the chart, no white frame"
    }
}
