package org.camssf.photo

import org.camssf.CalibrationException
import org.camssf.FramesDiffer
import org.camssf.InvalidArgument
import org.camssf.Overexposed
import org.camssf.Refusal
import org.camssf.Rules
import org.camssf.Underexposed
import org.camssf.flatten
import kotlin.math.hypot
import kotlin.math.sqrt

/** Result of normalising one shot's patch means. */
internal sealed class Normalised {
    /** The signals of this shot, k = 1. */
    class Usable(val signals: Signals) : Normalised()

    /** The error because of which there are no signals. */
    class Unusable(val error: CalibrationException) : Normalised()
}

/** Computes signals from patch means: every patch signal is divided by the white signal at its place, Eq. (5). */
internal object Normalise {
    /** Share of clipped samples above which a patch, or the white, is unusable. */
    private val CLIPPED get() = Rules.shipped.number("signals.clipped")

    /** Fraction of the sensor's range that the white signal must reach in every channel. */
    private val FAINT get() = Rules.shipped.number("signals.faint")

    /** Largest relative standard error of the white signal. */
    private val NOISY get() = Rules.shipped.number("signals.noisy")

    /** A patch is lost in noise if its signal in some channel is below this many of its standard errors. */
    private val LOST get() = Rules.shipped.number("signals.lost")

    /** Number of usable patches that every shot needs. */
    private val FEWEST get() = Rules.shipped.whole("signals.fewest")

    /**
     * Computes the signals of all shots.
     *
     * Standard errors, with b = W - D: se_y² = (se_C² + y² se_W² + (y - 1)² se_D²) / b². Fallbacks, each named in
     * `assumptions`: no dark frame: D is the file's black level, se_D = 0; no white frame: the chart's white patch w
     * replaces it, b = C_w - D_w, row w is not used, and se_y² = (se_C² + se_D² + y² (se_Cw² + se_Dw²)) / b².
     *
     * @param names of the chart's n patches.
     * @param white index of its white patch.
     * @throws InvalidArgument no shot, or a number of patches that differs from the table's.
     * @throws Overexposed the white is clipped, or clipping leaves fewer than 6 patches.
     * @throws FramesDiffer the dark frame is brighter than the white frame.
     * @throws Underexposed the white signal is too weak or too noisy, or noise leaves fewer than 6 patches.
     */
    fun all(shots: List<PatchMeans>, names: List<String>, white: Int): Signals {
        if (shots.isEmpty()) throw InvalidArgument("No shot was given.", "Give at least one photo of the chart.")
        val found = shots.mapIndexed { j, shot ->
            when (val one = one(shot, names, white, j + 1)) {
                is Normalised.Usable -> one.signals
                is Normalised.Unusable -> throw one.error
            }
        }
        fun joined(of: (Signals) -> DoubleArray) = found.map(of).flatten()
        return Signals(
            shots.size,
            names.size,
            joined { it.sharedValues },
            joined { it.sharedError },
            joined { it.sharedChart },
            joined { it.sharedWhite },
            joined { it.sharedDark },
            BooleanArray(shots.size * names.size) { found[it / names.size].sharedUsed[it % names.size] },
            found.flatMap { it.assumptions },
        )
    }

    /** Normalises one shot; `number` is its number in the capture, from 1. The error is the one that [all] throws. */
    fun one(means: PatchMeans, names: List<String>, w: Int, number: Int): Normalised {
        val patches = names.size
        val size = 3 * patches
        val c = means.chart.sharedMean
        if (c.size != size) {
            return Normalised.Unusable(
                InvalidArgument(
                    "Shot $number has ${c.size / 3} patches, the table has $patches.",
                    "Use the pose and the table of the same chart.",
                ),
            )
        }
        val seC = means.chart.sharedError
        val d = means.dark?.sharedMean ?: DoubleArray(size) { means.sharedBlack[it % 3] }
        val seD = means.dark?.sharedError ?: DoubleArray(size)
        val frame = means.white
        val b = frame?.sharedMean ?: DoubleArray(size) { c[3 * w + it % 3] - d[3 * w + it % 3] + d[it] }
        val seW = frame?.sharedError ?: DoubleArray(size) { hypot(seC[3 * w + it % 3], seD[3 * w + it % 3]) }
        val share = means.chart.sharedClipped
        val ceiling = frame?.sharedClipped ?: share.copyOfRange(3 * w, 3 * w + 3)
        unfitWhite(DoubleArray(size) { b[it] - d[it] }, seW, ceiling, means, number)
            ?.let { return Normalised.Unusable(it) }
        val y = DoubleArray(size) { (c[it] - d[it]) / (b[it] - d[it]) }
        val error = DoubleArray(size) {
            val weight = if (frame == null) 1.0 else (y[it] - 1) * (y[it] - 1)
            sqrt(seC[it] * seC[it] + y[it] * y[it] * (seW[it] * seW[it]) + weight * (seD[it] * seD[it])) /
                (b[it] - d[it])
        }
        val clipped = BooleanArray(patches) { i -> (0..2).any { share[3 * i + it] > CLIPPED } }
        val lost = BooleanArray(patches) { i ->
            (3 * i..3 * i + 2).any { LOST * hypot(seC[it], seD[it]) > c[it] - d[it] }
        }
        val used = BooleanArray(patches) { !clipped[it] && !lost[it] && !(frame == null && it == w) }
        tooFew(used.count { it }, clipped.count { it }, lost.count { it }, patches, number)
            ?.let { return Normalised.Unusable(it) }
        val fallbacks = fallbacks(means, names[w.coerceIn(0, patches - 1)], number)
        return Normalised.Usable(Signals(1, patches, y, error, c.copyOf(), b.copyOf(), d.copyOf(), used, fallbacks))
    }

    private fun fallbacks(shot: PatchMeans, white: String, number: Int): List<Assumption> = listOfNotNull(
        Assumption(
            "white_from_patch",
            "shot $number: ${if (shot.evened) "the white frame only evens out the light" else "no white frame"}: " +
                "the chart's patch '$white' replaces it on all patches.",
        ).takeIf { shot.white == null },
        Assumption(
            "dark_from_black_level",
            "shot $number: no dark frame: the file's black level is used.",
        ).takeIf { shot.dark == null },
    )

    /** The error if the white signal is unusable as a divisor; null if it is usable. */
    private fun unfitWhite(
        signal: DoubleArray,
        standardError: DoubleArray,
        clipped: DoubleArray,
        shot: PatchMeans,
        number: Int,
    ): Refusal? {
        val black = shot.sharedBlack
        val word = if (shot.white == null) "white patch" else "white frame"
        val part = DoubleArray(signal.size) { signal[it] / (shot.saturation - black[it % 3]) }
        if (shot.white != null && shot.dark != null && 2 * part.count { it < -FAINT } > part.size) {
            return Refusal.of("frames_differ.swapped", "shot" to number)
        }
        val share = clipped.max()
        if (share > CLIPPED) {
            return Refusal.of(
                "overexposed.white", "shot" to number, "share" to share, "frame" to word, value = share,
                threshold = CLIPPED,
            )
        }
        val level = part.min()
        if (!(level >= FAINT)) {
            val words = arrayOf("shot" to number, "frame" to word)
            return if (level < 0) {
                Refusal.of("underexposed.white_below_dark", *words, value = level, threshold = FAINT)
            } else {
                Refusal.of("underexposed.weak_white", *words, "level" to level, value = level, threshold = FAINT)
            }
        }
        val noise = signal.indices.maxOf { standardError[it] / signal[it] }
        if (noise > NOISY) {
            return Refusal.of(
                "underexposed.noisy_white", "shot" to number, "frame" to word, "noise" to noise, value = noise,
                threshold = NOISY,
            )
        }
        return null
    }

    /**
     * The error if fewer than FEWEST patches are usable, classified by the more frequent cause; null if enough are
     * left.
     */
    private fun tooFew(left: Int, over: Int, under: Int, patches: Int, number: Int): Refusal? {
        if (left >= FEWEST) return null
        return Refusal.of(
            if (over >= under) "overexposed.few_left" else "underexposed.few_left",
            "shot" to number, "left" to left, "all" to patches, "over" to over, "under" to under, "least" to FEWEST,
            value = left.toDouble(), threshold = FEWEST.toDouble(),
        )
    }
}
