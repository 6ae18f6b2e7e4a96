package org.camssf.verdict

import org.camssf.Reason
import org.camssf.Rules
import org.camssf.photo.Estimate
import org.camssf.photo.PatchMeans
import kotlin.math.abs
import kotlin.math.max

/** Whether the samples are a sensor's own: rule 11 of docs/verdict.md, Python's camssf.verdict.processed. */
internal object Processed {
    /** By how much each colour's noise follows the others' photons; null if noise or samples do not suffice. */
    fun coloursMixed(means: PatchMeans): Estimate? {
        val noise = means.noise ?: return null
        if (means.evened) return null
        val chart = means.chart
        val size = chart.sharedMean.size
        val signal = DoubleArray(size) { chart.sharedMean[it] - means.sharedBlack[it % 3] }
        val variance = DoubleArray(size) { chart.sharedError[it] * chart.sharedError[it] * chart.sharedCount[it] }
        return PhotonNoise.mixed(signal, variance, chart.sharedCount, noise.step)
            ?.takeIf { it.error < Rules.shipped.number("verdict.mixing_error") }
    }

    /** Checks that no program has mixed, demosaiced or smoothed the samples of a shot. */
    fun reasons(means: PatchMeans, shot: Int, checks: Checks): List<Reason> {
        val noise = means.noise ?: return emptyList()
        val mixed = coloursMixed(means)
        val found = far("mixed", mixed, "mixed_errors", shot, checks).ifEmpty {
            far("demosaiced", noise.unlike, "demosaiced_errors", shot, checks)
        }
        // Noise that was smoothed away would hide a mixture, and does no harm by itself.
        if (found.isNotEmpty() || mixed != null) return found
        return far("smoothed", noise.like, "demosaiced_errors", shot, checks)
    }

    /** The reason `name` if a number is further from 0 than its limit and than so many standard errors. */
    private fun far(name: String, found: Estimate?, errors: String, shot: Int, checks: Checks): List<Reason> {
        if (found == null) return emptyList()
        val value = abs(found.value)
        val number = { rule: String -> Rules.shipped.number("verdict.$rule") }
        val beyond = max(number(name), number(errors) * found.error)
        checks.note(name, value, shot, beyond)
        if (value <= beyond) return emptyList()
        return listOf(Reasons.because(name, value, mapOf("shot" to shot + 1, "share" to value), threshold = beyond))
    }
}
