package org.camssf.colour

import org.camssf.Grid
import org.camssf.Nodes
import org.camssf.Rules
import org.camssf.spectra.Directions
import org.camssf.spectra.Lamp
import kotlin.math.exp
import kotlin.math.ln
import kotlin.math.max

/**
 * Computes colours under one lamp, in the same order of steps as Python's `camssf.colour.standard`. It holds the
 * transform, the transforms refitted with each error of lamp and curves, and the errors on cross-validated surfaces.
 *
 * @param tolerance relative error of the reference's reflectance.
 */
internal class Lit(val light: Light, view: View, tolerance: Double) {
    private val functions = Tables.observer(view.observer)
    private val chosen = Transform.choose(light.power, light.curves, functions, view.kind)
    private val aim = if (view.white == Adapted.LAMP) {
        null
    } else {
        Learned.truth(Lamp.read(view.white.word).sharedValues, functions).second
    }
    private val turn = aim?.let { Spaces.adaptation(chosen.white, it) }

    val kind: Kind get() = chosen.kind

    /** (3) XYZ of the white that Lab is relative to. */
    val white: DoubleArray = aim ?: chosen.white

    /** (p, 3) coefficients of the stated XYZ, chromatically adapted if the view asks for it. */
    val coefficients: DoubleArray = turned(chosen.coefficients, turn)

    /** Lamp times curves, on the grid. */
    private val seen: Three = Learned.lit(light.power, light.curves)
    private val level = DoubleArray(3) { seen[it].sum() }
    private val matrix = Array(3) { c -> Nodes.fold(DoubleArray(Grid.SIZE) { seen[c][it] / level[c] }) }

    /** The refitted transforms for each error, one standard deviation up and down. */
    private val steps: List<Pair<Step, Step>>

    /** (K) of (n, 3) changes of the surfaces' signals by each error, divided by their level. */
    private val relative: List<DoubleArray>

    /**
     * (K') of (3) relative changes of the signals by the reference's smooth error and by light that varies with
     * place.
     */
    private val ofReference: List<DoubleArray>

    /** ln r/g and ln b/g of the surfaces, (n, 2). */
    private val known: DoubleArray

    private val missed: List<DoubleArray>

    init {
        val truth = chosen.white to Learned.truth(light.power, functions).first
        steps = light.powerModes.indices.map { k -> step(k, 1.0, truth) to step(k, -1.0, truth) }
        relative = light.powerModes.indices.map { moves(it) }
        val smooth = Directions.of(Rules.shipped.number("covariance.chart_correlation")).columns
        ofReference = smooth.map { row -> DoubleArray(3) { c -> tolerance * dot(row, seen[c]) / level[c] } } +
            DoubleArray(3) { Rules.shipped.number("covariance.drift") }
        known = DoubleArray(chosen.signals.size / 3 * 2) { ratio(chosen.signals, it / 2 * 3, it % 2) }
        missed = List(chosen.signals.size / 3) { outer(chosen.residual, 3 * it) }
    }

    /** A refitted transform, and the white that Lab is relative to. */
    private class Step(val coefficients: DoubleArray, val white: DoubleArray)

    private fun step(k: Int, sign: Double, truth: Pair<DoubleArray, DoubleArray>): Step {
        val ofLamp = k < light.ofLamp
        val power = if (ofLamp) {
            DoubleArray(Grid.SIZE) { max(light.power[it] + sign * light.powerModes[k][it], 0.0) }
        } else {
            light.power
        }
        val curves = Array(3) { c ->
            DoubleArray(Grid.SIZE) { light.curves[c][it] + sign * light.curveModes[k][c][it] }
        }
        val learned = if (ofLamp) {
            Learned.of(power, curves, functions)
        } else {
            Learned(Learned.signals(power, curves), truth.second, truth.first)
        }
        val fitted = Transform.fit(learned, kind) ?: throw NoColour.error()
        val moved = aim?.let { Spaces.adaptation(learned.white, it) }
        return Step(turned(fitted, moved), aim ?: learned.white)
    }

    private fun moves(k: Int): DoubleArray {
        val moved = Array(3) { c ->
            DoubleArray(Grid.SIZE) {
                light.powerModes[k][it] * light.curves[c][it] + light.power[it] * light.curveModes[k][c][it]
            }
        }
        val shift = Learned.through(moved) { level[it] }
        val whole = DoubleArray(3) { moved[it].sum() / level[it] }
        val sensed = chosen.signals
        return DoubleArray(shift.size) {
            (shift[it] - sensed[it] * whole[it % 3]) / Transform.level(sensed, it - it % 3)
        }
    }

    /** Computes the colour of signals (3) with standard errors (3), in units of a perfect white diffuser. */
    fun colour(y: DoubleArray, error: DoubleArray): StandardColour {
        val xyz = xyz(y)
        val slopes = Spaces.slopes(xyz, white)
        val bright = Transform.level(y)

        fun stated(covariance: DoubleArray): Spread {
            val own = turn?.let { Spaces.through(it, covariance) } ?: covariance
            return Spread(own, Spaces.through(slopes, own))
        }

        val alike = likeness(y)
        val noise = List(3) { c -> DoubleArray(3) { if (it == c) error[c] else 0.0 } }
        val reference = ofReference.map { row -> DoubleArray(3) { y[it] * row[it] } }
        val (curves, lamp) = stepped(y)
        val parts = listOf(
            curves,
            lamp,
            stated(bySignal(y, noise)),
            stated(bySignal(y, reference)),
            stated(metamers(alike, bright)),
        )
        val whole = alike.sum()
        val ofLight = relative.map { row ->
            val found = DoubleArray(3)
            for (i in alike.indices) for (c in 0..2) found[c] += alike[i] / whole * row[3 * i + c]
            DoubleArray(3) { found[it] * bright }
        }
        val reach = Reach.distance(y, sum(ofLight + noise + reference), matrix)
        return StandardColour(xyz, Spaces.lab(xyz, white), parts, reach)
    }

    /** Stated XYZ (3) of signals (3). */
    private fun xyz(y: DoubleArray): DoubleArray = apply(coefficients, y)

    private fun apply(coefficients: DoubleArray, y: DoubleArray): DoubleArray =
        DoubleArray(3).also { kind.apply(coefficients, y, 0, it, 0) }

    /**
     * Covariances by the errors of the curves and of the lamp: each step is half the difference between the answers
     * up and down.
     */
    private fun stepped(y: DoubleArray): Pair<Spread, Spread> {
        val found = List(2) { Spread(DoubleArray(9), DoubleArray(9)) }
        for ((k, sides) in steps.withIndex()) {
            val (plus, minus) = sides.toList().map { apply(it.coefficients, y) }
            val into = found[if (k < light.ofLamp) 1 else 0]
            add(into.xyz, 1.0, outer(DoubleArray(3) { 0.5 * (plus[it] - minus[it]) }))
            val up = Spaces.lab(plus, sides.first.white)
            val down = Spaces.lab(minus, sides.second.white)
            add(into.lab, 1.0, outer(DoubleArray(3) { 0.5 * (up[it] - down[it]) }))
        }
        return found[0] to found[1]
    }

    /** Covariance (3, 3) of XYZ under the lamp by changes (3) of the signals. */
    private fun bySignal(y: DoubleArray, moves: List<DoubleArray>): DoubleArray = sum(
        moves.map { move ->
            val up = apply(chosen.coefficients, DoubleArray(3) { y[it] + move[it] })
            val down = apply(chosen.coefficients, DoubleArray(3) { y[it] - move[it] })
            DoubleArray(3) { 0.5 * (up[it] - down[it]) }
        },
    )

    /**
     * Covariance (3, 3) of the transform's error on surfaces that look similar to the camera. It is a weighted mean
     * over cross-validated surfaces: those near in ln r/g and ln b/g count most, and all together count as much as
     * COMMON near ones. Errors are proportional to the level of the signals.
     */
    private fun metamers(alike: DoubleArray, bright: Double): DoubleArray {
        val near = DoubleArray(9)
        for ((i, own) in missed.withIndex()) add(near, alike[i] + COMMON / missed.size, own)
        val whole = alike.sum() + COMMON
        return DoubleArray(9) { near[it] / whole * (bright * bright) }
    }

    /** (n) weights of similarity, 1 for a surface of the same ratios. */
    private fun likeness(y: DoubleArray): DoubleArray {
        val own = DoubleArray(2) { ratio(y, 0, it) }
        return DoubleArray(known.size / 2) { i ->
            val red = (own[0] - known[2 * i]) / NEARBY
            val blue = (own[1] - known[2 * i + 1]) / NEARBY
            exp(-0.5 * (red * red + blue * blue)) + 1e-12
        }
    }

    private fun ratio(signals: DoubleArray, from: Int, which: Int): Double {
        val least = 1e-3 * Transform.level(signals, from)
        return ln(max(signals[from + 2 * which], least)) - ln(max(signals[from + 1], least))
    }

    private companion object {
        /** Standard deviation of the similarity weight, in ln r/g and ln b/g. */
        const val NEARBY = 0.25

        /** Weight of all surfaces together, as a number of similar ones. */
        const val COMMON = 5.0

        /** Coefficients (p, 3) followed by the adaptation matrix `turn` (3, 3); unchanged if it is null. */
        fun turned(coefficients: DoubleArray, turn: DoubleArray?): DoubleArray {
            if (turn == null) return coefficients
            return DoubleArray(coefficients.size) { at ->
                (0..2).sumOf { coefficients[at - at % 3 + it] * turn[3 * (at % 3) + it] }
            }
        }

        fun outer(of: DoubleArray, from: Int = 0): DoubleArray =
            DoubleArray(9) { of[from + it / 3] * of[from + it % 3] }

        fun sum(moves: List<DoubleArray>): DoubleArray {
            val found = DoubleArray(9)
            for (move in moves) add(found, 1.0, outer(move))
            return found
        }
    }
}
