package org.camssf

import kotlin.math.abs
import kotlin.math.hypot
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.sqrt

/**
 * Why a result is not simply accepted.
 *
 * @property code word of the error vocabulary, the same in Python and JSON.
 * @property message what is wrong.
 * @property advice what to do next.
 * @property value the number that decided, or null.
 * @property threshold the bound it broke, or null.
 */
public class Reason internal constructor(
    public val code: String,
    public val message: String,
    public val advice: String,
    public val value: Double?,
    public val threshold: Double?,
    internal val fatal: Boolean = false,
)

/**
 * What the evidence says.
 *
 * @property status "accepted", "doubtful" (usable, with reasons) or "refused" (no curves).
 * @property reasons empty only when accepted.
 */
public class Verdict internal constructor(public val status: String, public val reasons: List<Reason>)

/** Evidence → verdict. RMSRE has no say: the same lamp stands on both of its sides, so it stays small when it is wrong. */
internal object Judge {
    /** Root mean square residual in units of its expected size from which the evidence contradicts itself. */
    private const val MISFIT = 3.0
    private const val IMPOSSIBLE = 10.0

    /** Share of white that the darkest patch may give before light lies over the chart, and before it hides it. */
    private const val VEIL = 0.10
    private const val FOG = 0.25

    /** Residual of one patch, likewise. */
    private const val STRANGE_PATCH = 5.0

    /** The paper's number of colours; fewer carry less than its accuracy. */
    private const val FEW_PATCHES = 12

    /** Share of the sensor's range below which the white leaves the dark patches to noise. */
    private const val DARK_WHITE = 0.10

    /** Change of the light across the chart, as residuals that follow the patches' places tell it. */
    private const val UNEVEN = 0.05

    /** Agreement of the patches with the chart's own colours below which the corners deserve a look. */
    private const val POOR_POSE = 0.90

    /** Most directions in which a lamp may be off. */
    private const val LOOSE = 2

    /** Widest mean 95 % half-width, in parts of the peak, that still tells cameras apart. */
    private const val VAGUE = 0.10
    private const val LAMP_UNFIT = "lamp_unfit"

    /**
     * Weighs the evidence behind an answer.
     *
     * The expected size of a residual is the root sum of squares of the signal's standard error and the chart's
     * tolerance; the lamp's own tolerance is left out, so a wrong lamp shows.
     */
    fun judge(signals: Signals, table: ChartTable, shots: List<MeasuredShot>, ssf: Ssf): Verdict {
        val n = signals.patches
        val misfit = DoubleArray(signals.values.size) {
            val expected = hypot(signals.standardError[it], table.tolerance[it / 3 % n] * signals.values[it])
            (signals.values[it] - ssf.predicted[it]) / max(expected, 1e-4)
        }
        val reasons = ArrayList<Reason>()
        shots.forEachIndexed { j, shot ->
            val name = "shot ${j + 1}"
            val used = (0 until n).filter { signals.used[j * n + it] }
            reasons += exposure(name, signals, j, shot.means)
            if (used.size < FEW_PATCHES) reasons += few(name, signals, j, used, shot.means)
            val unevenness = if (shot.means.white == null) fallOff(shot.pose, signals, j, ssf, used) else 0.0
            if (unevenness > UNEVEN) {
                reasons += Reason(
                    "uneven_light",
                    "$name: the light changes by ${percent(unevenness, 0)} across the chart and no white frame " +
                        "corrects it.",
                    "Add a white frame, or light the chart evenly and keep it in the middle of the photo.",
                    unevenness,
                    UNEVEN,
                )
            }
            if (shot.pose.score < POOR_POSE) {
                reasons += Reason(
                    "chart_unfit",
                    "$name: the patches agree only ${fixed(shot.pose.score, 2)} with the chart's own colours.",
                    "Look at the outlines in the report, check the chart's name, or give the corners by hand.",
                    shot.pose.score,
                    POOR_POSE,
                )
            }
            if (unevenness <= UNEVEN) { // else residuals accuse neither lamp nor chart
                reasons += residuals(name, misfit, j * n, used, table.patches)
            }
        }
        shots.forEachIndexed { j, shot ->
            if (shot.lamp.modes.size > LOOSE) {
                reasons += Reason(
                    LAMP_UNFIT,
                    "shot ${j + 1}: ${shot.lamp.name} is known by its kind alone, in ${shot.lamp.modes.size} " +
                        "directions: the bands hold the truth less often than they say.",
                    "Measure the lamp, or photograph the chart in daylight or under a bulb.",
                    shot.lamp.modes.size.toDouble(),
                    LOOSE.toDouble(),
                )
            }
        }
        if (ssf.std != null) {
            val width = (0..2).sumOf { ssf.band(it)!!.average() } / 3
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
        return if (reason.code == LAMP_UNFIT) {
            LampUnfit(reason.message, reason.advice, reason.value, reason.threshold)
        } else {
            Glare(reason.message, reason.advice, reason.value, reason.threshold)
        }
    }

    private fun few(name: String, signals: Signals, shot: Int, used: List<Int>, means: PatchMeans): Reason {
        val unused = (0 until signals.patches).filter { it !in used }
        val clipped = unused.any { i -> (0..2).any { means.chart.clipped[3 * i + it] > 0 } }
        return Reason(
            if (clipped) "overexposed" else "underexposed",
            "$name: only ${used.size} of ${signals.patches} patches carry a signal.",
            if (clipped) "Take the photo again with less exposure." else "Take the photo again with more light.",
            used.size.toDouble(),
            FEW_PATCHES.toDouble(),
        )
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

    /**
     * Range over the chart of the smooth part of ln(y / ŷ), a plane and a bowl; 0 where it explains less than half.
     * Only light acts on all three channels alike by place: the channels' mean is taken first.
     */
    private fun fallOff(pose: ChartPose, signals: Signals, shot: Int, ssf: Ssf, used: List<Int>): Double {
        val from = 3 * shot * signals.patches
        val seen = used.filter { i ->
            (0..2).all { signals.values[from + 3 * i + it] > 0 && ssf.predicted[from + 3 * i + it] > 0 }
        }
        if (seen.size < 8) return 0.0
        val places = List(2) { axis -> seen.map { i -> (0..3).sumOf { pose.quads[8 * i + 2 * it + axis] } / 4 } }
        val size = max(places.maxOf { it.max() - it.min() }, 1.0)
        val (x, y) = places.map { axis -> axis.average().let { middle -> axis.map { (it - middle) / size } } }
        val excess = DoubleArray(seen.size) { s ->
            (0..2).sumOf { ln(signals.values[from + 3 * seen[s] + it] / ssf.predicted[from + 3 * seen[s] + it]) } / 3
        }
        val middle = excess.average()
        for (i in excess.indices) excess[i] -= middle
        val design = Array(seen.size) { doubleArrayOf(1.0, x[it], y[it], x[it] * x[it] + y[it] * y[it]) }
        val weights = LeastSquares.solve(design, excess) ?: return 0.0
        val smooth = DoubleArray(seen.size) { i -> (0..3).sumOf { design[i][it] * weights[it] } }
        val explained = smooth.sumOf { it * it } / max(excess.sumOf { it * it }, 1e-300)
        return if (explained > 0.5) smooth.max() - smooth.min() else 0.0
    }

    /** Residuals of the used patches against their expected size. */
    private fun residuals(
        name: String,
        misfit: DoubleArray,
        from: Int,
        used: List<Int>,
        patches: List<String>,
    ): List<Reason> {
        val worst = used.map { i -> (0..2).maxOf { abs(misfit[3 * (from + i) + it]) } }
        val strangest = worst.indexOf(worst.max())
        fun size(of: List<Int>) = sqrt(
            of.sumOf { i ->
                (0..2).sumOf { misfit[3 * (from + i) + it].let { m -> m * m } }
            } / (3 * of.size),
        )
        val overall = size(used)
        val others = size(used.filterIndexed { at, _ -> at != strangest })
        if (others > MISFIT) {
            return listOf(
                Reason(
                    LAMP_UNFIT,
                    "$name: the curves leave ${fixed(overall, 1)} times the expected residual.",
                    "Check that the lamp is the light of this photo and the chart the one in it.",
                    overall,
                    if (others > IMPOSSIBLE) IMPOSSIBLE else MISFIT,
                    others > IMPOSSIBLE,
                ),
            )
        }
        if (worst[strangest] > STRANGE_PATCH) {
            return listOf(
                Reason(
                    "chart_unfit",
                    "$name: patch ${patches[used[strangest]]} is off by ${fixed(worst[strangest], 1)} times its " +
                        "expected error.",
                    "Look for a reflection, dirt or a finger on it, or give the chart's own measured table.",
                    worst[strangest],
                    STRANGE_PATCH,
                ),
            )
        }
        return emptyList()
    }
}
