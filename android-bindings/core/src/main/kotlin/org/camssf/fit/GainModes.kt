package org.camssf.fit

import org.camssf.InvalidArgument
import org.camssf.Rules
import org.camssf.photo.ChartPose
import org.camssf.photo.MeasuredCapture
import org.camssf.recovery.Gains
import org.camssf.recovery.Tensor
import org.camssf.spectra.ChartLayout
import kotlin.math.max

/**
 * Gain modes: uneven light on the patches without a white frame (docs/maths.md, "Light that falls unevenly").
 * Python's camssf.fit.capture_fit, in its order.
 */
internal object GainModes {
    /**
     * Gain modes (k, g, n) of a capture's patches, and the size of each channel's own part relative to them.
     *
     * With a white frame the light on every patch is known, so there are no modes. Without one the chart's white
     * patch is the reference for all, and modes are relative to it: X and Y, X², XY and Y², and the white patch's own
     * level, each minus its value at the white patch.
     *
     * @param perPatch relative difference of the light from patch to patch, one standard deviation, if each patch was
     *   photographed separately: one mode a patch; without a white frame the white patch's gain is in all others.
     *   Null if the patches were in one photo.
     * @throws InvalidArgument `perPatch` outside (0, 1].
     */
    fun of(capture: MeasuredCapture, perPatch: Double?): Gains {
        val white = capture.chart.white
        val n = capture.chart.patches.size
        val k = capture.shots.size
        val framed = capture.shots[0].means.white != null
        val (each, own) = when {
            perPatch != null -> {
                if (!(perPatch > 0 && perPatch <= 1)) {
                    throw InvalidArgument(
                        "light cannot differ by $perPatch from patch to patch.",
                        "Write 8 % as 0.08.",
                    )
                }
                val ways = List(k) { onePerPatch(n, perPatch, white.takeUnless { framed }) }
                ways to 0.0
            }

            framed -> List(k) { emptyList<DoubleArray>() } to 0.0

            else -> {
                val layout = capture.chart.layout
                capture.shots.map { shot ->
                    smooth(shot.pose, layout, white, n).map { if (shot.means.evened) DoubleArray(n) else it }
                } to Rules.shipped.number("gains.own")
            }
        }
        val g = each[0].size
        val modes = DoubleArray(k * g * n) { each[it / (g * n)][it / n % g][it % n] }
        return Gains(Tensor(modes, k, g, n), own)
    }

    /** No modes, for a basis without a prior: there the fit has no errors but those of the signals. */
    fun none(capture: MeasuredCapture): Gains {
        val (k, n) = capture.shots.size to capture.chart.patches.size
        return Gains(Tensor(DoubleArray(0), k, 0, n), 0.0)
    }

    /** One mode a patch; the gain of patch `white`, the reference of all, is common to all the others. */
    private fun onePerPatch(n: Int, size: Double, white: Int?): List<DoubleArray> {
        val alone = (0 until n).filter { it != white }.map { i -> DoubleArray(n) { if (it == i) size else 0.0 } }
        return if (white == null) alone else alone + DoubleArray(n) { if (it == white) 0.0 else size }
    }

    /** Plane, bowl and the white patch's own level over the patches of one photo, relative to patch `white`. */
    private fun smooth(pose: ChartPose, layout: ChartLayout, white: Int, n: Int): List<DoubleArray> {
        val (x, y) = places(pose, n)
        val plane = Rules.shipped.number("gains.plane")
        val bowl = Rules.shipped.number("gains.bowl")
        val corner = Rules.shipped.number("gains.corner")
        val bent = listOf<(Int) -> Double>(
            { plane * x[it] },
            { plane * y[it] },
            { bowl * x[it] * x[it] },
            { bowl * x[it] * y[it] },
            { bowl * y[it] * y[it] },
        )
        // The level exists only if the white patch is at the chart's edge: inside, plane and bowl describe its light
        // too.
        val edge = white % layout.columns in setOf(0, layout.columns - 1) ||
            white / layout.columns in setOf(0, layout.rows - 1)
        val ways = if (edge) bent + { if (it == white) -corner else 0.0 } else bent
        return ways.map { way -> DoubleArray(n) { way(it) - way(white) } }
    }

    /**
     * (n) x and (n) y positions of the patches in the photo: 0 at their middle, from -1 to 1 along the longer side.
     */
    private fun places(pose: ChartPose, n: Int): List<DoubleArray> {
        val centres = List(2) { axis ->
            DoubleArray(n) { i -> (0..3).sumOf { pose.sharedQuads[8 * i + 2 * it + axis] } / 4 }
        }
        val size = max(centres.maxOf { it.max() - it.min() }, 1.0)
        return centres.map { axis ->
            val ends = axis.min() + axis.max()
            DoubleArray(n) { (2.0 * axis[it] - ends) / size }
        }
    }

    /** 1 - ĥ (k, n) from v̂ (k, g): the factor that corrects the signals to even light. */
    fun level(gains: Gains, code: DoubleArray): DoubleArray {
        val (k, g, n) = gains.modes.shape
        if (code.isEmpty()) return DoubleArray(k * n) { 1.0 }
        val darkest = Rules.shipped.number("gains.darkest")
        return DoubleArray(k * n) { at ->
            val (j, i) = at / n to at % n
            max(1.0 - (0 until g).sumOf { code[j * g + it] * gains.modes.values[(j * g + it) * n + i] }, darkest)
        }
    }
}
