package org.camssf.colour

import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.Rules
import org.camssf.spectra.Directions
import org.camssf.spectra.Lamp
import kotlin.math.max

/**
 * Signals, XYZ and XYZ over its white as functions of reflectance, under the lights of one or two photos; as in Python's
 * `camssf_colour.reflectance`.
 *
 * @property linear its last six outputs are XYZ as the view states it and XYZ over its white; before them the
 *   reflectance itself if it was asked for.
 * @property white (3) XYZ of the white that Lab is relative to.
 */
internal class SurfaceResponse private constructor(val linear: LinearResponse, val white: DoubleArray) {
    companion object {
        /**
         * @param lights of the photos; XYZ is under the first.
         * @param tolerances of the photos' references, which are the same object.
         * @param reflectance whether the reflectance is an output, too.
         * @throws InvalidArgument a curve without a response to a lamp.
         */
        fun of(lights: List<Light>, tolerances: List<Double>, view: View, reflectance: Boolean): SurfaceResponse {
            val signals = lights.map { rows(it) }
            val c = 3 * lights.size
            val first = lights[0]
            val functions = Tables.observer(view.observer)
            val aim = if (view.white == Adapted.LAMP) {
                null
            } else {
                white(Lamp.read(view.white.word).sharedValues, functions)
            }
            val (colours, white) = colorimetry(first.power, functions, aim)
            val none = List(OUTPUTS) { DoubleArray(SurfaceNodes.SIZE) }
            val ofLight = first.powerModes.indices.map { k ->
                val outputs = if (k < first.ofLamp) changed(first, k, functions, aim) else none
                lights.indices.flatMap { moved(lights[it], k, signals[it]) } + outputs
            }
            val p = first.ofLamp
            val moves = mapOf(
                Part.CURVES to ofLight.drop(p),
                Part.LAMP to ofLight.take(p),
                Part.REFERENCE to ofReference(lights, tolerances, signals).map { it + none },
            )
            val nodes = List(SurfaceNodes.SIZE) { a -> DoubleArray(SurfaceNodes.SIZE) { if (it == a) 1.0 else 0.0 } }
            val outputs = (if (reflectance) nodes else emptyList()) + colours
            val reduced = moves.mapValues { (_, errors) -> principal(errors, c + OUTPUTS) }
            return SurfaceResponse(LinearResponse(signals.flatten(), outputs, reduced), white)
        }

        /** XYZ (3) of a perfect white diffuser under a lamp. */
        fun white(power: DoubleArray, functions: Three): DoubleArray {
            val level = dot(power, functions[1])
            return DoubleArray(3) { dot(power, functions[it]) / level }
        }

        /** White-balanced signals (3) of (35) under a light. */
        private fun rows(light: Light): List<DoubleArray> = List(3) { c ->
            val whole = dot(light.power, light.curves[c])
            if (!(whole > 0 && whole.isFinite())) {
                throw InvalidArgument(
                    "A curve has no response to this lamp.",
                    "Check the lamp's spectrum, and the curves.",
                )
            }
            SurfaceNodes.fold(DoubleArray(Grid.SIZE) { light.power[it] * light.curves[c][it] / whole })
        }

        /** Changes (3) of (35) of a photo's signals by an error of lamp or curves. */
        private fun moved(light: Light, k: Int, rows: List<DoubleArray>): List<DoubleArray> = List(3) { c ->
            val whole = dot(light.power, light.curves[c])
            val move = DoubleArray(Grid.SIZE) {
                (light.powerModes[k][it] * light.curves[c][it] + light.power[it] * light.curveModes[k][c][it]) / whole
            }
            SurfaceNodes.fold(move).also { add(it, -move.sum(), rows[c]) }
        }

        /** Changes of all signals by the reference's smooth error, then by light that differs between two places. */
        private fun ofReference(
            lights: List<Light>,
            tolerances: List<Double>,
            signals: List<List<DoubleArray>>,
        ): List<List<DoubleArray>> {
            val smooth = Directions.of(Rules.shipped.number("covariance.chart_correlation")).columns
            val responses = lights.map { light ->
                List(3) { c ->
                    val whole = dot(light.power, light.curves[c])
                    DoubleArray(Grid.SIZE) { light.power[it] * light.curves[c][it] / whole }
                }
            }

            /** All signals, changed by so many tolerances of their photo's reference. */
            fun scaled(size: (Int, Int) -> Double) = signals.flatMapIndexed { j, rows ->
                List(3) { rows[it].times(tolerances[j] * size(j, it)) }
            }
            return smooth.map { column -> scaled { j, c -> dot(column, responses[j][c]) } } +
                lights.indices.map { place -> scaled { j, _ -> if (j == place) 1.0 else 0.0 } }
        }

        /** Changes (6) of (35) of the colorimetric outputs by an error of the lamp. */
        private fun changed(light: Light, k: Int, functions: Three, aim: DoubleArray?): List<DoubleArray> {
            val (up, down) = listOf(1.0, -1.0).map { sign ->
                val power = DoubleArray(Grid.SIZE) { max(light.power[it] + sign * light.powerModes[k][it], 0.0) }
                colorimetry(power, functions, aim).first
            }
            return up.zip(down) { a, b -> DoubleArray(a.size) { 0.5 * (a[it] - b[it]) } }
        }

        /** (6) of (35): XYZ as stated and XYZ over its white, as functions of reflectance; and that white's XYZ. */
        private fun colorimetry(
            power: DoubleArray,
            functions: Three,
            aim: DoubleArray?,
        ): Pair<List<DoubleArray>, DoubleArray> {
            val level = dot(power, functions[1])
            val xyz = functions.map { row ->
                SurfaceNodes.fold(DoubleArray(Grid.SIZE) { power[it] * row[it] / level })
            }
            val turn = aim?.let { Spaces.adaptation(white(power, functions), it) }
            val stated = if (turn == null) {
                xyz
            } else {
                List(3) { row ->
                    DoubleArray(SurfaceNodes.SIZE) { n -> (0..2).sumOf { turn[3 * row + it] * xyz[it][n] } }
                }
            }
            val white = aim ?: white(power, functions)
            val relative = List(3) { row -> DoubleArray(SurfaceNodes.SIZE) { stated[row][it] / white[row] } }
            return stated + relative to white
        }

        /** Errors of so many rows each as fewer independent ones of the same covariance, but for LEAST of its trace. */
        private fun principal(moves: List<List<DoubleArray>>, rows: Int): List<List<DoubleArray>> {
            val gram = Array(moves.size) { a ->
                DoubleArray(moves.size) { b -> (0 until rows).sumOf { dot(moves[a][it], moves[b][it]) } }
            }
            val parts = Symmetric.eigen(gram)
            val whole = parts.sumOf { max(it.first, 0.0) }
            var rest = whole
            return parts.filter { (size, _) -> (rest > LEAST * whole).also { rest -= size } }.map { (_, axis) ->
                List(rows) { row ->
                    DoubleArray(SurfaceNodes.SIZE).also { for (k in moves.indices) add(it, axis[k], moves[k][row]) }
                }
            }
        }

        /** Colorimetric outputs: XYZ and XYZ over its white. */
        const val OUTPUTS = 6

        /** The smallest errors are left out up to this share of the variance of all. */
        private const val LEAST = 1e-4
    }
}
