package org.camssf.verdict

import org.camssf.Reason
import org.camssf.Rules
import org.camssf.median
import org.camssf.photo.FrameMeans
import org.camssf.photo.PatchMeans
import org.camssf.photo.Signals
import org.camssf.spectra.ChartTable
import kotlin.math.abs
import kotlin.math.max
import kotlin.math.sqrt

/** Checks exposure, usable patches, noise, green channels and dirt of one shot (rule 6 of docs/verdict.md). */
internal class ExposureAndNoise(
    private val signals: Signals,
    private val shot: Int,
    private val means: PatchMeans,
    private val table: ChartTable,
    private val checks: Checks,
) {
    private val chart = means.chart
    private val used = used(signals, shot)

    fun reasons(): List<Reason> = listOfNotNull(darkWhite(), darkestPatch(), few(), dirt(), greens()) + noise()

    private fun because(reason: String, value: Double, fatal: Boolean, vararg words: Pair<String, Any>): Reason =
        Reasons.because(reason, value, mapOf("shot" to shot + 1, *words), fatal)

    private fun bound(name: String): Double = Rules.shipped.number("verdict.$name")

    /** Checks the white's level. */
    private fun darkWhite(): Reason? {
        val patches = signals.patches
        val level = (0..2).maxOf { channel ->
            (0 until patches).sumOf {
                val i = 3 * (shot * patches + it) + channel
                (signals.sharedWhite[i] - signals.sharedDark[i]) / (means.saturation - signals.sharedDark[i])
            } / patches
        }
        checks.note("dark_white", level, shot)
        return if (level < bound("dark_white")) because("dark_white", level, false, "level" to level) else null
    }

    /** Checks the signal of the darkest patch. */
    private fun darkestPatch(): Reason? {
        val patches = signals.patches
        val veil = (0..2).maxOf { channel ->
            (0 until patches).minOf { signals.sharedValues[3 * (shot * patches + it) + channel] }
        }
        checks.note("veil", veil, shot)
        if (!(veil > bound("veil"))) return null
        return because("darkest_patch", veil, veil > bound("veil_refuses"), "share" to veil)
    }

    private fun few(): Reason? {
        checks.note("few_patches", used.size.toDouble(), shot)
        if (used.size >= Rules.shipped.whole("verdict.few_patches")) return null
        val unused = (0 until signals.patches).filter { it !in used }
        val clipped = unused.any { i -> (0..2).any { chart.sharedClipped[3 * i + it] > 0 } }
        val reason = if (clipped) "few_clipped" else "few_dark"
        return because(reason, used.size.toDouble(), false, "left" to used.size, "all" to signals.patches)
    }

    private fun dirt(): Reason? {
        val shares = List(signals.patches) { i -> (0..2).maxOf { chart.sharedDead[3 * i + it] } }
        val share = shares.max()
        checks.note("dirty", share, shot)
        if (!(share > bound("dirty"))) return null
        return because("dirt", share, false, "share" to share, "patch" to table.patches[shares.indexOf(share)])
    }

    private fun greens(): Reason? {
        val differences = used.map { i ->
            val (first, second) = chart.sharedGreens[2 * i] to chart.sharedGreens[2 * i + 1]
            abs(first - second) / max((first + second) / 2 - means.sharedBlack[1], 1.0)
        }
        val share = median(differences.toDoubleArray())
        checks.note("greens", share, shot)
        return if (share > bound("greens")) because("greens", share, false, "share" to share) else null
    }

    private fun noise(): List<Reason> {
        if (means.white == null || means.dark == null) return emptyList()
        val (grain, texture) = noise(means.white, means.dark)
        checks.note("smooth", grain, shot)
        checks.note("rough", texture, shot)
        return listOfNotNull(
            if (grain < bound("smooth")) because("smooth", grain, false, "grain" to grain) else null,
            if (texture > bound("rough")) because("rough", texture, false, "texture" to texture) else null,
        )
    }

    /** Grain and texture of the used patches (rule 6). */
    private fun noise(white: FrameMeans, dark: FrameMeans): Pair<Double, Double> {
        fun variance(frame: FrameMeans, i: Int) = frame.sharedError[i] * frame.sharedError[i] * frame.sharedCount[i]
        val at = used.flatMap { i -> (0..2).map { 3 * i + it } }
        val expected = DoubleArray(at.size) {
            val i = at[it]
            val share = (chart.sharedMean[i] - dark.sharedMean[i]) / (white.sharedMean[i] - dark.sharedMean[i])
            max(variance(dark, i) + (variance(white, i) - variance(dark, i)) * share, 1.0 / 12.0)
        }
        val grain = DoubleArray(at.size) { variance(chart, at[it]) / expected[it] }
        val texture = DoubleArray(at.size) {
            val signal = max(chart.sharedMean[at[it]] - dark.sharedMean[at[it]], 1.0)
            sqrt(max(variance(chart, at[it]) - expected[it], 0.0)) / signal
        }
        return median(grain) to median(texture)
    }
}
