package org.camssf.photo

import org.camssf.InvalidArgument
import org.camssf.Overexposed
import org.camssf.Underexposed
import org.camssf.percent
import kotlin.math.hypot
import kotlin.math.sqrt

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
 * Arrays are (k, n, 3) row-major, columns R, G, B; do not write into them.
 *
 * @property shots k.
 * @property patches n.
 * @property values y, 1.
 * @property standardError of y, 1, propagated from the frames' standard errors.
 * @property chart mean of the chart photo, DN.
 * @property white what Eq. (5) divided by, DN; fallbacks filled in.
 * @property dark what it subtracted, DN; fallbacks filled in.
 * @property used (k, n): false where a patch must not enter the fit (clipped, lost in noise, or the white itself).
 * @property assumptions the fallbacks taken.
 */
public class Signals internal constructor(
    public val shots: Int,
    public val patches: Int,
    public val values: DoubleArray,
    public val standardError: DoubleArray,
    public val chart: DoubleArray,
    public val white: DoubleArray,
    public val dark: DoubleArray,
    public val used: BooleanArray,
    public val assumptions: List<Assumption>,
) {
    internal companion object {
        /** Share of clipped samples from which a patch, or a white frame, is no measurement. */
        const val CLIPPED = 0.01

        /** Part of the sensor's range that the white signal must reach in every channel. */
        const val FAINT = 0.005

        /** Largest relative standard error of the white signal. */
        const val NOISY = 0.05

        /** A patch whose signal is below this many of its standard errors in some channel is lost in noise. */
        const val LOST = 3.0

        /** Patches that must be left in every shot. */
        const val FEWEST = 6

        /**
         * Divides every patch by the white at its own place.
         *
         * Standard errors, with b = W - D: se_y² = (se_C² + y² se_W² + (y - 1)² se_D²) / b². Fallbacks, each named in
         * `assumptions`: no dark frame: D is the file's black level, se_D = 0; no white frame: the chart's white patch
         * w stands in, b = C_w - D_w, its own row is not used, and se_y² = (se_C² + se_D² + y² (se_Cw² + se_Dw²)) / b².
         *
         * @param names of the chart's n patches.
         * @param white index of its white patch.
         * @throws InvalidArgument no shot, or another number of patches than the table has.
         * @throws Overexposed the white is clipped, or clipping leaves fewer than 6 patches.
         * @throws Underexposed the white lies hardly above the dark, or noise leaves fewer than 6 patches.
         */
        fun normalise(shots: List<PatchMeans>, names: List<String>, white: Int): Signals {
            if (shots.isEmpty()) {
                throw InvalidArgument("No shot was given.", "Give at least one photo of the chart.")
            }
            val k = shots.size
            val n = names.size
            val whole = Signals(
                k,
                n,
                DoubleArray(3 * k * n),
                DoubleArray(3 * k * n),
                DoubleArray(3 * k * n),
                DoubleArray(3 * k * n),
                DoubleArray(3 * k * n),
                BooleanArray(k * n),
                shots.flatMapIndexed { j, shot -> assumptions(shot, names[white.coerceIn(0, n - 1)], j + 1) },
            )
            shots.forEachIndexed { j, shot -> whole.fill(j, shot, white) }
            return whole
        }

        private fun assumptions(shot: PatchMeans, white: String, number: Int): List<Assumption> = listOfNotNull(
            Assumption(
                "white_from_patch",
                "shot $number: no white frame: the chart's patch '$white' stands in, " +
                    "so light that falls off across the chart is not corrected.",
            ).takeIf { shot.white == null },
            Assumption(
                "dark_from_black_level",
                "shot $number: no dark frame: the black level in the file stands in.",
            ).takeIf { shot.dark == null },
        )
    }

    /** Shot j alone. */
    internal fun only(j: Int): Signals {
        fun part(all: DoubleArray) = all.copyOfRange(3 * patches * j, 3 * patches * (j + 1))
        return Signals(
            1,
            patches,
            part(values),
            part(standardError),
            part(chart),
            part(white),
            part(dark),
            used.copyOfRange(patches * j, patches * (j + 1)),
            assumptions,
        )
    }

    private fun fill(shot: Int, means: PatchMeans, w: Int) {
        val number = shot + 1
        val size = 3 * patches
        if (means.chart.mean.size != size) {
            throw InvalidArgument(
                "Shot $number has ${means.chart.mean.size / 3} patches, the table has $patches.",
                "Use the pose and the table of the same chart.",
            )
        }
        val c = means.chart.mean
        val seC = means.chart.standardError
        val d = means.dark?.mean ?: DoubleArray(size) { means.black[it % 3] }
        val seD = means.dark?.standardError ?: DoubleArray(size)
        val frame = means.white
        val b = frame?.mean ?: DoubleArray(size) { c[3 * w + it % 3] - d[3 * w + it % 3] + d[it] }
        val seW = frame?.standardError ?: DoubleArray(size) { hypot(seC[3 * w + it % 3], seD[3 * w + it % 3]) }
        val ceiling = frame?.clipped ?: means.chart.clipped.copyOfRange(3 * w, 3 * w + 3)
        checkWhite(DoubleArray(size) { b[it] - d[it] }, seW, ceiling, means, number)
        val from = shot * size
        for (i in 0 until size) {
            val y = (c[i] - d[i]) / (b[i] - d[i])
            val weight = if (frame == null) 1.0 else (y - 1) * (y - 1)
            values[from + i] = y
            standardError[from + i] =
                sqrt(seC[i] * seC[i] + y * y * (seW[i] * seW[i]) + weight * (seD[i] * seD[i])) / (b[i] - d[i])
        }
        c.copyInto(chart, from)
        b.copyInto(white, from)
        d.copyInto(dark, from)
        val clipped = BooleanArray(patches) { i -> (0..2).any { means.chart.clipped[3 * i + it] > CLIPPED } }
        val lost = BooleanArray(patches) { i ->
            (3 * i..3 * i + 2).any { LOST * hypot(seC[it], seD[it]) > c[it] - d[it] }
        }
        for (i in 0 until patches) {
            used[shot * patches + i] = !clipped[i] && !lost[i] && !(frame == null && i == w)
        }
        checkLeft(shot, clipped.count { it }, lost.count { it })
    }

    private fun checkWhite(
        signal: DoubleArray,
        standardError: DoubleArray,
        clipped: DoubleArray,
        shot: PatchMeans,
        number: Int,
    ) {
        val word = if (shot.white == null) "white patch" else "white frame"
        val share = clipped.max()
        if (share > CLIPPED) {
            throw Overexposed(
                "Shot $number: up to ${percent(share, 1)} of a patch's samples are at the ceiling in the $word.",
                "Take chart and white again with less exposure: white below 80 % in its brightest channel.",
                share,
                CLIPPED,
            )
        }
        val level = signal.indices.minOf { signal[it] / (shot.saturation - shot.black[it % 3]) }
        if (!(level >= FAINT)) {
            throw Underexposed(
                "Shot $number: in one channel the $word lies only ${percent(level, 2)} of the range above dark.",
                "Expose longer or use more light, and check that white and dark frame are not swapped.",
                level,
                FAINT,
            )
        }
        val noise = signal.indices.maxOf { standardError[it] / signal[it] }
        if (noise > NOISY) {
            throw Underexposed(
                "Shot $number: the $word is known to ${percent(noise, 0)} only.",
                "Expose longer or use more light; fill the frame with the chart.",
                noise,
                NOISY,
            )
        }
    }

    /** Refuses fewer than 6 patches, for the reason that took more of them. */
    private fun checkLeft(shot: Int, over: Int, under: Int) {
        val left = (0 until patches).count { used[shot * patches + it] }
        if (left >= FEWEST) return
        val message = "Shot ${shot + 1}: only $left of $patches patches are usable ($over clipped, $under " +
            "lost in noise), $FEWEST are needed."
        val threshold = FEWEST.toDouble()
        if (over >= under) {
            throw Overexposed(message, "Take the photo again with less exposure.", left.toDouble(), threshold)
        }
        throw Underexposed(message, "Take the photo again with more exposure or light.", left.toDouble(), threshold)
    }
}
