package org.camssf.colour

import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.Nodes
import org.camssf.Rules
import org.camssf.recovery.Tensor
import org.camssf.spectra.Directions
import org.camssf.spectra.Lamp
import kotlin.math.max

/**
 * The lamp of a photo, and what a reference in it says of it.
 *
 * @property ratios (2) ln of the reference's raw red and blue over its green; null without a usable reference.
 * @property error one standard deviation of them.
 * @property tolerance relative error of the reference's reflectance.
 * @property modes errors (681) of its reflectance over `tolerance`; null for smooth ones.
 */
internal class ReferenceRatios(
    val lamp: Lamp,
    val ratios: DoubleArray?,
    val error: Double,
    val tolerance: Double,
    val modes: List<DoubleArray>? = null,
)

/**
 * Signals, XYZ and XYZ over its white as functions of reflectance, under the lights of one or two photos; lamps and
 * curves, which are the same in both, are conditioned on the raw ratios of the references.
 *
 * @property names of the lamps.
 * @property chiSquared χ² of the ratios, two degrees of freedom a photo; null without them.
 */
internal class SurfaceResponse private constructor(
    val names: List<String>,
    val chiSquared: Double?,
    private val arrays: Map<String, Tensor>,
) {
    /** (c, 35) signals; a perfect white gives 1 in each. */
    val signals: Tensor get() = arrays.getValue("signals")

    /** (6, 35) XYZ as the view states it, under the first light, and XYZ over its white. */
    val outputs: Tensor get() = arrays.getValue("outputs")

    /** (3) XYZ of the white that Lab is relative to. */
    val white: DoubleArray get() = arrays.getValue("white").values

    /** ln of the density of the ratios; 0 without them. */
    val logEvidence: Double get() = arrays.getValue("log_evidence").values[0]

    /** (3) of (69): signals of the first photo as functions of reflectance at the 5-nm nodes. */
    val reachable: List<DoubleArray> get() = List(3) {
        arrays.getValue("reachable").values.copyOfRange(it * Nodes.SIZE, (it + 1) * Nodes.SIZE)
    }

    /** Changes (K, c + 6, 35) of signals and outputs by each source's errors, reduced to the largest. */
    fun moves(): Map<String, Tensor> = arrays.filterKeys { it.startsWith(MOVES) }.mapValues { principal(it.value) }

    companion object {
        /**
         * @param photos of each a lamp, and ratios of a reference; they are ignored if the camera's own white is not
         *   known.
         * @throws InvalidArgument a curve without a response to a lamp.
         */
        fun of(camera: ColourCamera, photos: List<ReferenceRatios>, view: View): SurfaceResponse {
            val modes = photos.map { modes(it.lamp) }
            val own = camera.ownWhite
            val measured = DoubleArray(photos.size) { if (own != null && photos[it].ratios != null) 1.0 else 0.0 }
            val functions = Tables.observer(view.observer)
            val adapted = view.white != Adapted.LAMP
            val ofReference = photos[0].modes
                ?: Directions.of(Rules.shipped.number("covariance.chart_correlation")).columns
            val arrays = SurfaceModels.lights.run(
                mapOf(
                    "curves" to columns(camera.values),
                    "curve_modes" to Tensor.stack(camera.modes.ifEmpty { listOf(NONE) }.map { columns(it) }),
                    "lamp" to tensor(photos.map { it.lamp.sharedValues }),
                    "lamp_modes" to tensor(modes.flatten()),
                    "of_photo" to tensor(
                        photos.indices.map { j ->
                            modes.flatMapIndexed { i, one -> one.map { if (i == j) 1.0 else 0.0 } }.toDoubleArray()
                        },
                    ),
                    "ratios" to tensor(photos.map { it.ratios ?: DoubleArray(2) }),
                    "ratio_error" to Tensor(DoubleArray(photos.size) { photos[it].error }, photos.size),
                    "measured" to Tensor(measured, photos.size),
                    "own_raw" to Tensor(own?.raw ?: DoubleArray(3) { 1.0 }, 3),
                    "own_lamp" to Tensor(own?.lamp?.sharedValues ?: DoubleArray(Grid.SIZE) { 1.0 }, Grid.SIZE),
                    "own_modes" to tensor(own?.let { modes(it.lamp) } ?: listOf(NONE[0])),
                    "tolerance" to Tensor(DoubleArray(photos.size) { photos[it].tolerance }, photos.size),
                    "smooth" to tensor(ofReference),
                    "observer" to columns(functions),
                    "aim" to Tensor(if (adapted) white(view.white, functions) else DoubleArray(3) { 1.0 }, 3),
                    "adapted" to Tensor.scalar(if (adapted) 1.0 else 0.0),
                ),
            )
            fun isFinite(name: String) = arrays.getValue(name).values.all { it.isFinite() }
            if (!isFinite("log_evidence")) throw NoColour.error()
            if (!(isFinite("level") && arrays.getValue("level").values.all { it > 0 })) {
                throw InvalidArgument(
                    "A curve has no response to this lamp.",
                    "Check the lamp's spectrum, and the curves.",
                )
            }
            if (!arrays.keys.all { isFinite(it) }) throw NoColour.error()
            val chiSquared = arrays.getValue("chi_squared").values[0].takeIf { measured.any { it > 0 } }
            return SurfaceResponse(photos.map { it.lamp.name }, chiSquared, arrays)
        }

        /** XYZ (3) of a perfect white diffuser under an illuminant. */
        private fun white(illuminant: Adapted, functions: Three): DoubleArray {
            val power = Lamp.read(illuminant.word).sharedValues
            return DoubleArray(3) { dot(power, functions[it]) / dot(power, functions[1]) }
        }

        /** Error modes (681) of a lamp, relative to its power: its own, and its smooth error; zeros if it has none. */
        fun modes(lamp: Lamp): List<DoubleArray> {
            val length = Rules.shipped.number("covariance.lamp_correlation")
            val smooth = if (lamp.tolerance > 0) Directions.of(length).columns else emptyList()
            return (lamp.sharedModes + smooth.map { it.times(lamp.tolerance) }).ifEmpty { listOf(NONE[0]) }
        }

        /** Errors (K, rows, 35) as fewer independent ones of the same covariance, but for LEAST of its trace. */
        private fun principal(moves: Tensor): Tensor {
            val (size, rows) = moves.shape
            val errors = moves.rows()
            val gram = Array(size) { a -> DoubleArray(size) { b -> dot(errors[a], errors[b]) } }
            val parts = Symmetric.eigen(gram)
            val whole = parts.sumOf { max(it.first, 0.0) }
            var rest = whole
            val kept = parts.filterIndexed { i, (variance, _) ->
                (i == 0 || rest > LEAST * whole).also { rest -= variance }
            }
            val reduced = kept.map { (_, axis) ->
                DoubleArray(errors[0].size).also { for (k in 0 until size) add(it, axis[k], errors[k]) }
            }
            return Tensor(tensor(reduced).values, reduced.size, rows, SurfaceNodes.SIZE)
        }

        private val NONE: Three = Array(3) { DoubleArray(Grid.SIZE) }
        private const val MOVES = "moves by "

        /** The smallest errors are left out up to this share of the variance of all. */
        private val LEAST get() = Rules.shipped.number("colour.least_errors")
    }
}
