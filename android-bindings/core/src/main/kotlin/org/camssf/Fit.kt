package org.camssf

import org.camssf.curves.Engine
import org.camssf.curves.Evidence
import org.camssf.curves.Frames
import org.camssf.curves.Known
import org.camssf.curves.OnnxEngine
import org.camssf.curves.Penalties
import org.camssf.curves.Recover
import org.camssf.curves.Ssf
import org.camssf.curves.Tensor
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.Signals
import org.camssf.spectra.Lamp

/**
 * One capture's rows to curves, by the model, again and again: with some patches left out, with another lamp, by one shot
 * alone.
 */
internal class Fit(
    private val engine: Engine,
    private val capture: MeasuredCapture,
    private val signals: Signals,
    private val settings: Settings,
) {
    private val table = capture.chart
    private val n = table.patches.size
    private val k = capture.shots.size

    /** The paper's basis, which knows of no error in the chart and has no prior. */
    val paper: Boolean = engine.basis == OnnxEngine.PAPER

    /** Whether the shots have white frames. */
    val framed: Boolean = capture.shots[0].means.white != null

    /** Of the shots, as given. */
    val lamps: List<Lamp> = capture.shots.map { it.lamp }

    /** Reflectance (681) of what stood for white: the white frame's card, or the chart's own white patch. */
    val white: DoubleArray

    /** One standard deviation of its relative error, 1. */
    val whiteTolerance: Double

    init {
        val share = capture.whiteReflectance ?: 1.0
        white = if (framed) DoubleArray(Grid.SIZE) { share } else table.reflectance(table.white)
        whiteTolerance = if (framed) WHITE_TOLERANCE else table.sharedTolerance[table.white]
    }

    /** Patches, 0-based, that enter the fit of some shot, of `used` (k, n). */
    fun taken(used: BooleanArray): IntArray =
        (0 until n).filter { i -> (0 until k).any { used[it * n + i] } }.toIntArray()

    /**
     * The curves of the `used` (k, n) patches; they predict all of them.
     *
     * @param gamma (1) or (3) the l1 penalty; null takes the settings' or the basis'.
     * @throws LampUnfit a lamp without power on the grid.
     * @throws NotConverged there is no proof.
     */
    fun curves(used: BooleanArray, gamma: DoubleArray?, lamps: List<Lamp> = this.lamps): Ssf {
        val taken = taken(used)
        val t = taken.size
        fun rows(values: DoubleArray) = Tensor(
            DoubleArray(3 * k * t) { at -> values[3 * (at / (3 * t) * n + taken[at / 3 % t]) + at % 3] },
            k,
            t,
            3,
        )
        val unused = HIDDEN
        val hidden = DoubleArray(3 * k * n) { if (used[it / 3]) signals.sharedError[it] else unused }
        val evidence = Evidence(
            rows(signals.sharedValues),
            rows(hidden),
            Known(
                Tensor(taken.map { table.reflectance(it) }.flatten(), t, Grid.SIZE),
                Tensor(DoubleArray(t) { if (paper) 0.0 else table.sharedTolerance[taken[it]] }, t),
                Tensor(white, Grid.SIZE),
                whiteTolerance,
                Tensor(lamps.map { it.sharedValues }.flatten(), k, Grid.SIZE),
                Tensor(DoubleArray(k) { lamps[it].tolerance }, k),
                modes(lamps),
            ),
        )
        val frames = Frames(rows(signals.sharedChart), rows(signals.sharedWhite), rows(signals.sharedDark))
        val found = Recover.recover(engine, evidence, frames, Penalties(settings.l2, gamma, settings.nonnegative))
        return found.predicting(predict(found))
    }

    /** (k, q, 681), filled up with zeros where a lamp has fewer. */
    private fun modes(lamps: List<Lamp>): Tensor {
        val q = lamps.maxOf { it.sharedModes.size }
        val modes = DoubleArray(k * q * Grid.SIZE)
        for ((j, lamp) in lamps.withIndex()) {
            lamp.sharedModes.forEachIndexed { i, mode -> mode.copyInto(modes, (j * q + i) * Grid.SIZE) }
        }
        return Tensor(modes, k, q, Grid.SIZE)
    }

    /** Signals (k, n, 3) of all patches. */
    private fun predict(ssf: Ssf): DoubleArray {
        val predicted = DoubleArray(3 * k * n)
        for (j in 0 until k) {
            for (c in 0..2) {
                val seen =
                    DoubleArray(Grid.SIZE) { ssf.sharedLamp[j * Grid.SIZE + it] * ssf.sharedValues[3 * it + c] }
                val level = (0 until Grid.SIZE).sumOf { white[it] * seen[it] }
                for (i in 0 until n) {
                    val from = i * Grid.SIZE
                    predicted[3 * (j * n + i) + c] =
                        (0 until Grid.SIZE).sumOf { table.sharedValues[from + it] * seen[it] } / level
                }
            }
        }
        return predicted
    }

    private companion object {
        /** Standard error of a signal that is used in another shot but not in this one: it then weighs nothing. */
        val HIDDEN get() = Rules.shipped.number("calibration.hidden")
        val WHITE_TOLERANCE get() = Rules.shipped.number("calibration.white_tolerance")
    }
}
