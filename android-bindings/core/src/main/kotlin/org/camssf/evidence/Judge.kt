package org.camssf.evidence

import org.camssf.CalibrationException
import org.camssf.ChartUnfit
import org.camssf.FramesDiffer
import org.camssf.Glare
import org.camssf.Grid
import org.camssf.LampUnfit
import org.camssf.NotSensorRaw
import org.camssf.UnevenLight
import org.camssf.fixed
import org.camssf.median
import org.camssf.percent
import org.camssf.photo.FrameMeans
import org.camssf.photo.PatchMeans
import org.camssf.photo.Signals
import org.camssf.spectra.ChartTable
import kotlin.math.abs
import kotlin.math.expm1
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.sqrt

/**
 * Evidence → verdict, by the numbered rules of Python's `camssf.evidence.verdict`. RMSRE has no say: the same lamp stands on both
 * of its sides, so it stays small when the lamp is wrong.
 */
internal object Judge {
    /** z(T) from which the evidence contradicts itself; T / N from which nothing is left of it. */
    private const val SURPRISE = 3.5
    private const val HOPELESS = 10.0

    /** xᵀ x of the three channels from which the curves are unlike a camera's, and from which they are none. */
    private const val STRANGE = 13.0
    private const val ALIEN = 60.0

    /** Added to both for each further shot: with more evidence the code is less bound to its prior. */
    private const val FREER = 7.0

    /** dT₄ from which another lamp explains the photo better, and from which the named one is out of the question. */
    private const val RIVAL = 15.0
    private const val CONDEMNED = 200.0

    /** Lamps tried in the place of the named one. */
    val RIVALS = listOf(
        "2300K", "2856K", "3500K", "D:4300", "D:5000", "D:6500", "D:10000", "LED-B1", "LED-B3", "LED-B5", "LED-V1",
        "FL2", "FL7", "FL11",
    )

    /** Shots of a capture beyond which rivals are not tried: each costs a solution a rival. */
    const val MOST_RIVALLED = 4

    /** What a suspect may explain by chance and by the chart's own error. */
    private const val SUSPECT = 32.0

    /** Of the surprise beyond N that a suspect must explain to be named for it. */
    private const val SHARE = 0.4

    /** ln by which the raw white may differ from what the file's colour matrix foretells. */
    private const val TINTED = 0.20

    /** Share of white that the darkest patch may give before light lies over the chart, and before it hides it. */
    private const val VEIL = 0.10
    private const val FOG = 0.25

    /** The paper's number of colours; fewer carry less than its accuracy. */
    private const val FEW_PATCHES = 12

    /** Share of the sensor's range below which the white leaves the dark patches to noise. */
    private const val DARK_WHITE = 0.10

    /** Agreement of the patches with the chart's own colours below which the corners deserve a look. */
    private const val POOR_POSE = 0.90

    /** Grain below which noise is missing, texture above which a patch is not flat. */
    private const val SMOOTH = 0.6
    private const val ROUGH = 0.015

    /** Relative difference of the two greens above which they are not both green. */
    private const val GREENS = 0.06

    /** Share of outliers among a patch's samples above which something lies on it. */
    private const val DIRTY = 0.06

    /** Widest mean 95 % half-width, in parts of the peak, that still tells cameras apart. */
    private const val VAGUE = 0.10

    private class Limit(val name: String, val code: String, val advice: String)

    fun judge(case: Case): Verdict {
        val told = case.told
        val signals = told.signals
        val found = told.surprise()
        val each = case.each()
        val reasons = ArrayList<Reason>()
        reasons += surprises(found, each, told.table)
        case.shots.forEachIndexed { j, shot ->
            val name = "shot ${j + 1}"
            reasons += exposure(name, signals, j, shot.means)
            reasons += few(name, signals, j, shot.means)
            reasons += samples(name, signals, j, shot.means, told.table)
            if (shot.pose.score < POOR_POSE) {
                reasons += Reason(
                    "chart_unfit",
                    "$name: the patches agree only ${fixed(shot.pose.score, 2)} with the chart's own colours.",
                    "Look at the outlines in the report, check the chart's name, or give the corners anew.",
                    shot.pose.score,
                    POOR_POSE,
                )
            }
        }
        case.shots.forEachIndexed { j, shot ->
            reasons += tint("shot ${j + 1}", shot.lamp.name, case.foretold[j], case.single[j])
        }
        if (case.shots.size == 1 || each.none { accused(it) != null }) reasons += rival(case, found.weighted)
        if (told.ssf.std != null) {
            val width = (0..2).sumOf { told.ssf.band(it)!!.average() } / 3
            if (width > VAGUE) {
                reasons += Reason(
                    "underexposed",
                    "the 95 % band is ±${fixed(width, 2)} of the peak wide on average: this capture knows little.",
                    "Add a white frame, a second shot under another lamp, or a photo with more light.",
                    width,
                    VAGUE,
                )
            }
        }
        if (reasons.any { it.fatal }) return Verdict("refused", reasons)
        return Verdict(if (reasons.isEmpty()) "accepted" else "doubtful", reasons)
    }

    /** The error that a refused verdict raises: its gravest reason's. */
    fun refusal(verdict: Verdict): CalibrationException {
        val reason = verdict.reasons.first { it.fatal }
        val (message, advice) = reason.message to reason.advice
        return when (reason.code) {
            "glare" -> Glare(message, advice, reason.value, reason.threshold)
            "chart_unfit" -> ChartUnfit(message, advice, reason.value, reason.threshold)
            "frames_differ" -> FramesDiffer(message, advice, reason.value, reason.threshold)
            "uneven_light" -> UnevenLight(message, advice, reason.value, reason.threshold)
            "not_sensor_raw" -> NotSensorRaw(message, advice, reason.value, reason.threshold)
            "lamp_unfit" -> LampUnfit(message, advice, reason.value, reason.threshold)
            else -> error("no verdict refuses for ${reason.code}")
        }
    }

    private fun used(signals: Signals, shot: Int): List<Int> =
        (0 until signals.patches).filter { signals.used[shot * signals.patches + it] }

    /**
     * The strongest suspect of a shot, a veil counted 1.2-fold (a tone curve looks much like it), if it explains enough:
     * [SHARE] of a surprise, else [SUSPECT].
     */
    fun accused(one: Surprise): Suspect? {
        val strongest = one.suspects.maxByOrNull { it.gain * if (it.kind == "veil") 1.2 else 1.0 } ?: return null
        val enough = if (one.z > SURPRISE) SHARE * (one.total - one.count) else SUSPECT
        return strongest.takeIf { it.gain > enough }
    }

    /** Rules 2 and 3: the strongest suspect of each shot, else that nothing explains the surprise. */
    private fun surprises(found: Surprise, each: List<Surprise>, table: ChartTable): List<Reason> {
        val reasons = ArrayList<Reason>()
        val hopeless = found.total > HOPELESS * found.count
        each.forEachIndexed { j, one ->
            val suspect = accused(one) ?: return@forEachIndexed
            val limit = accusation(suspect, table)
            val value = if (hopeless) found.total / found.count else suspect.gain
            val bound = if (hopeless) HOPELESS else SUSPECT
            reasons += Reason(limit.code, "shot ${j + 1}: ${limit.name}", limit.advice, value, bound, hopeless)
        }
        val worst = each.maxOfOrNull { it.z } ?: found.z
        if (reasons.isEmpty() && (hopeless || max(found.z, worst) > SURPRISE)) {
            val size = fixed(sqrt(found.total / found.count), 1)
            val together = each.size > 1 && worst <= SURPRISE
            reasons += Reason(
                "chart_unfit",
                if (together) {
                    "the shots contradict each other: together they are off by $size times what was to be " +
                        "expected, each alone is not."
                } else {
                    "the patches are off by $size times what was to be expected, and no single cause explains it."
                },
                "Check that the chart named is the one in the photo and the lamp its light; a printed copy or a " +
                    "faded chart has other spectra than the table.",
                if (hopeless) found.total / found.count else max(found.z, worst),
                if (hopeless) HOPELESS else SURPRISE,
                hopeless,
            )
        }
        val (strange, alien) = listOf(STRANGE, ALIEN).map { it + FREER * (each.size - 1) }
        if (found.prior > strange) {
            reasons += Reason(
                "lamp_unfit",
                "the curves are unlike any camera's (${fixed(found.prior, 0)}, where cameras stay below " +
                    "${fixed(strange, 0)}).",
                "Check the lamp, and that neither the photo nor the white frame went through a converter.",
                found.prior,
                if (found.prior > alien) alien else strange,
                found.prior > alien,
            )
        }
        return reasons
    }

    /** Words, code and advice for a suspect. */
    private fun accusation(suspect: Suspect, table: ChartTable): Limit = when (suspect.kind) {
        "patch" -> Limit(
            "patch ${table.patches[suspect.patch!!]} is not what the chart's table says.",
            "chart_unfit",
            "Look for a reflection, dirt or a finger on it, leave it out of the fit, or give the chart's own " +
                "measured table.",
        )

        "veil" -> if (suspect.amount > 0) {
            Limit(
                "dark patches are too bright, as if ${percent(suspect.amount, 1)} of white lay over all.",
                "glare",
                "Shade the lens, turn the chart away from reflections, and add a dark frame: the black level may " +
                    "be off.",
            )
        } else {
            Limit(
                "dark patches are too dark, as if the dark frame held ${percent(-suspect.amount, 1)} of white.",
                "frames_differ",
                "Take the dark frame again, lens cap on, with the photo's own exposure time and ISO.",
            )
        }

        "white" -> Limit(
            "all patches are off by a factor of their own in each channel: the white frame is not of this light.",
            "frames_differ",
            "Take the white frame again, in the chart's place, under the same lamp, with the same exposure.",
        )

        "light" -> Limit(
            "the patches' errors follow their places: the light changes across the chart.",
            "uneven_light",
            "Light the chart evenly, without shadows, keep it in the middle of the photo, and add a white frame.",
        )

        else -> Limit(
            "the signals are not linear: they follow a tone curve, about y^${fixed(1 + suspect.amount, 2)}.",
            "not_sensor_raw",
            "Photograph in the camera's plain RAW (DNG) mode; a converter or a merged photo bends them.",
        )
    }

    /** Rule 4: of all shots and lamps the one that fits best. */
    private fun rival(case: Case, weighted: Double): List<Reason> {
        val best = case.rivals.minByOrNull { it.weighted } ?: return emptyList()
        val gain = weighted - best.weighted
        if (gain <= RIVAL) return emptyList()
        val told = case.shots[best.shot].lamp.name
        return listOf(
            Reason(
                "lamp_unfit",
                "shot ${best.shot + 1}: the photo fits ${best.lamp} far better than $told.",
                "Check the lamp; the light is more like ${best.lamp}. If it is not, measure it.",
                gain,
                if (gain > CONDEMNED) CONDEMNED else RIVAL,
                gain > CONDEMNED,
            ),
        )
    }

    /** Rule 5, by the answer to that shot alone. */
    private fun tint(name: String, lamp: String, foretold: List<Foretold>, told: Told): List<Reason> {
        val signals = told.signals
        val patches = used(signals, 0)
        val curves = told.ssf
        val raw = DoubleArray(3) { c ->
            patches.sumOf { signals.white[3 * it + c] - signals.dark[3 * it + c] } / patches.size
        }
        fun seen(light: DoubleArray, c: Int) = (0 until Grid.SIZE).sumOf {
            light[it] * curves.sharedValues[3 * it + c]
        }
        val off = foretold.minOfOrNull { neutral ->
            val ratio = DoubleArray(3) { c ->
                ln(raw[c] / (neutral.white[c] * seen(curves.lamp, c) / seen(neutral.light, c)))
            }
            max(abs(ratio[0] - ratio[1]), abs(ratio[2] - ratio[1]))
        }
        if (off == null || off <= TINTED) return emptyList()
        return listOf(
            Reason(
                "lamp_unfit",
                "$name: the white is off by ${percent(expm1(off), 0)} in red or blue from what the file's own " +
                    "colour matrix foretells under $lamp.",
                "Check the lamp, look for a second light and for coloured walls, and measure the light at the chart.",
                off,
                TINTED,
            ),
        )
    }

    private fun few(name: String, signals: Signals, shot: Int, means: PatchMeans): List<Reason> {
        val used = used(signals, shot)
        if (used.size >= FEW_PATCHES) return emptyList()
        val unused = (0 until signals.patches).filter { it !in used }
        val clipped = unused.any { i -> (0..2).any { means.chart.clipped[3 * i + it] > 0 } }
        return listOf(
            Reason(
                if (clipped) "overexposed" else "underexposed",
                "$name: only ${used.size} of ${signals.patches} patches carry a signal.",
                if (clipped) "Take the photo again with less exposure." else "Take the photo again with more light.",
                used.size.toDouble(),
                FEW_PATCHES.toDouble(),
            ),
        )
    }

    /** Rule 6, and outliers. */
    private fun samples(
        name: String,
        signals: Signals,
        shot: Int,
        means: PatchMeans,
        table: ChartTable,
    ): List<Reason> {
        val used = used(signals, shot)
        val reasons = ArrayList<Reason>()
        val chart = means.chart
        val dirt = List(signals.patches) { i -> (0..2).maxOf { chart.dead[3 * i + it] } }
        val share = dirt.max()
        if (share > DIRTY) {
            reasons += Reason(
                "chart_unfit",
                "$name: ${percent(share, 0)} of the samples of patch ${table.patches[dirt.indexOf(share)]} do not " +
                    "belong to the others.",
                "Look for a reflection, dirt or a finger on it.",
                share,
                DIRTY,
            )
        }
        val greens = median(
            used.map { i ->
                val (first, second) = chart.greens[2 * i] to chart.greens[2 * i + 1]
                abs(first - second) / max((first + second) / 2 - means.black[1], 1.0)
            }.toDoubleArray(),
        )
        if (greens > GREENS) {
            reasons += Reason(
                "not_sensor_raw",
                "$name: the two greens differ by ${percent(greens, 0)}.",
                "The file may name a wrong order of the colour filters: photograph with another app or camera mode.",
                greens,
                GREENS,
            )
        }
        if (means.white == null || means.dark == null) return reasons
        val (grain, texture) = noise(chart, means.white, means.dark, used)
        if (grain < SMOOTH) {
            reasons += Reason(
                "not_sensor_raw",
                "$name: the samples have ${percent(grain, 0)} of the noise that light must have.",
                "Photograph in the camera's plain RAW (DNG) mode, without noise reduction or 8-bit storage.",
                grain,
                SMOOTH,
            )
        }
        if (texture > ROUGH) {
            reasons += Reason(
                "blurred",
                "$name: the patches vary by ${percent(texture, 1)} inside: neighbours or shadows run into them.",
                "Focus on the chart, keep the camera still, and let the chart fill more of the frame.",
                texture,
                ROUGH,
            )
        }
        return reasons
    }

    /** Grain and texture: rule 6. */
    private fun noise(
        chart: FrameMeans,
        white: FrameMeans,
        dark: FrameMeans,
        used: List<Int>,
    ): Pair<Double, Double> {
        fun variance(frame: FrameMeans, i: Int) = frame.standardError[i] * frame.standardError[i] * frame.count[i]
        val at = used.flatMap { i -> (0..2).map { 3 * i + it } }
        val expected = DoubleArray(at.size) {
            val i = at[it]
            val share = (chart.mean[i] - dark.mean[i]) / (white.mean[i] - dark.mean[i])
            max(variance(dark, i) + (variance(white, i) - variance(dark, i)) * share, 1.0 / 12.0)
        }
        val grain = DoubleArray(at.size) { variance(chart, at[it]) / expected[it] }
        val texture = DoubleArray(at.size) {
            val signal = max(chart.mean[at[it]] - dark.mean[at[it]], 1.0)
            sqrt(max(variance(chart, at[it]) - expected[it], 0.0)) / signal
        }
        return median(grain) to median(texture)
    }

    /** The white's level, and light where there should be none. */
    private fun exposure(name: String, signals: Signals, shot: Int, means: PatchMeans): List<Reason> {
        val n = signals.patches
        val reasons = ArrayList<Reason>()
        val level = (0..2).maxOf { c ->
            (0 until n).sumOf {
                val i = 3 * (shot * n + it) + c
                (signals.white[i] - signals.dark[i]) / (means.saturation - signals.dark[i])
            } / n
        }
        if (level < DARK_WHITE) {
            reasons += Reason(
                "underexposed",
                "$name: the brightest channel of the white reaches ${percent(level, 0)} of the sensor's range.",
                "Expose longer, to about 80 %.",
                level,
                DARK_WHITE,
            )
        }
        val veil = (0..2).maxOf { c -> (0 until n).minOf { signals.values[3 * (shot * n + it) + c] } }
        if (veil > VEIL) {
            reasons += Reason(
                "glare",
                "$name: the darkest patch gives ${percent(veil, 0)} of white; black ink gives 3 %.",
                "Turn the chart away from the reflection, and shade the lens.",
                veil,
                if (veil > FOG) FOG else VEIL,
                veil > FOG,
            )
        }
        return reasons
    }
}
