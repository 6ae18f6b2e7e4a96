package org.camssf.colour

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.doubleOrNull
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.CalibrationException
import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.recovery.LearnedBasis
import org.camssf.spectra.Directions
import org.camssf.spectra.Lamp
import org.camssf.spectra.list
import org.camssf.spectra.numbers
import org.camssf.spectra.part
import org.camssf.spectra.text
import kotlin.math.abs
import kotlin.math.max
import kotlin.math.sqrt

/**
 * The calibration's raw white, which fixes the relative scale of the three channels.
 *
 * @property raw (3) white signal of each channel relative to green.
 * @property lamp of that shot.
 */
internal class OwnWhite(val raw: DoubleArray, val lamp: Lamp)

/**
 * A camera's curves and the modes of their errors, for colour computations.
 *
 * @property values each channel's peak = 1.
 * @property modes independent error modes of the curves, each one standard deviation long; empty for curves without
 *   uncertainty.
 * @property own the calibration's white; null if it is not known.
 */
internal class ColourCamera private constructor(val values: Three, val modes: List<Three>, val own: OwnWhite?) {
    companion object {
        /**
         * Reads the camera of a result document. The modes come from the document's covariance if possible; otherwise
         * from its bands, assuming that errors are smooth over 10 nm and independent between the channels.
         *
         * @param lamp lamp of its first shot; if null, it is read by its name in the document.
         * @throws InvalidArgument a refused result, or a text that is not a result document.
         */
        fun parse(document: String, lamp: Lamp? = null): ColourCamera {
            val result = try {
                Json.parseToJsonElement(document).jsonObject
            } catch (error: IllegalArgumentException) {
                throw broken(error)
            }
            return try {
                of(result, lamp)
            } catch (error: CalibrationException) {
                throw error
            } catch (error: RuntimeException) { // a missing or malformed field
                throw broken(error)
            }
        }

        private fun broken(cause: RuntimeException) = InvalidArgument(
            "This is no result that camssf wrote (${cause.message?.lines()?.first()}).",
            "Give the text of a \"camssf-result/1\", as Calibration.toJson has it.",
            cause = cause,
        )

        private fun of(result: JsonObject, lamp: Lamp?): ColourCamera {
            if ("ssf" !in result) {
                val reason = result.part("verdict").list("reasons").first().jsonObject
                throw InvalidArgument(
                    "This result was refused: it has no curves.",
                    reason.text("advice"),
                )
            }
            val values = curves(result.part("ssf"))
            if (!values.all { curve -> curve.all { it.isFinite() } && curve.max() > 0 }) {
                throw InvalidArgument("A curve is not finite, or has no positive peak.", "Give measured curves.")
            }
            val own = own(result, values, lamp)
            val std = (result["ssf_std"] as? JsonObject)?.let { curves(it) } ?: return ColourCamera(values, none, own)
            check(std.all { band -> band.all { it >= 0 && it.isFinite() } }) { "a band is no band" }
            return ColourCamera(values, own?.let { ofCode(result, values, std, it) } ?: ofBands(std), own)
        }

        private fun own(result: JsonObject, values: Three, lamp: Lamp?): OwnWhite? {
            val light = lamp ?: try {
                Lamp.read(result.list("shots").first().jsonObject.part("lamp").text("name"))
            } catch (_: InvalidArgument) {
                return null // the lamp was a measured file, so the relative scale of the channels is not known
            }
            val raw = result.numbers("channel_gain").also { check(it.size == 3) { "${it.size} gains" } }
            val seen = List(3) { dot(light.sharedValues, values[it]) }
            return if (raw.all { it > 0 } && seen.all { it > 0 }) OwnWhite(raw, light) else null
        }

        /**
         * Modes from the document's covariance; null if it has none, or if it does not reproduce the document's
         * bands.
         */
        private fun ofCode(result: JsonObject, values: Three, std: Three, own: OwnWhite): List<Three>? {
            val triangle = (result["code_covariance"] as? JsonArray)?.let { numbers(it) } ?: return null
            val basis = LearnedBasis.of(result.text("basis")) ?: return null
            val scale = result["prior_scale"]?.jsonPrimitive?.doubleOrNull ?: 1.0
            val size = 3 * basis.atoms
            if (!(scale > 0 && scale.isFinite()) || triangle.size != size * (size + 1) / 2) return null
            val covariance = Array(size) { a ->
                DoubleArray(size) { b -> max(a, b).let { triangle[it * (it + 1) / 2 + minOf(a, b)] } }
            }
            val modes = modes(values, covariance, basis, scale, own.lamp.sharedValues)
            var apart = 0.0
            for (c in 0..2) {
                for (m in 0 until Grid.SIZE) {
                    val found = sqrt(modes.sumOf { it[c][m] * it[c][m] })
                    apart = if (found.isNaN()) Double.NaN else max(apart, abs(found - std[c][m]))
                }
            }
            return modes.takeIf { apart < SAME_BAND * std.maxOf { it.max() } }
        }

        /**
         * Modes of curves with peak 1, from the covariance (3 r, 3 r) of their code.
         *
         * The basis is anchored to the white L, so no code changes Σ L s dλ; this gives the curves' scale. With
         * ŝ = s / s_p, where s peaks at p, an error d s changes ŝ by (d s - ŝ d s_p) / s_p.
         */
        private fun modes(
            values: Three,
            covariance: Array<DoubleArray>,
            basis: LearnedBasis,
            prior: Double,
            white: DoubleArray,
        ): List<Three> {
            val r = basis.atoms
            val moves = List(3) { c ->
                val mean = basis.mean[c]
                val level = dot(mean, white)
                val scale = level / dot(values[c], white)
                val top = values[c].indices.maxByOrNull { values[c][it] }!!
                val peak = values[c][top]
                List(r) { q ->
                    val atom = basis.dictionary[c][q]
                    val share = prior * dot(white, atom) / level
                    val anchored = DoubleArray(Grid.SIZE) { prior * atom[it] - mean[it] * share }
                    DoubleArray(Grid.SIZE) {
                        (anchored[it] - values[c][it] / peak * anchored[top]) / (scale * peak)
                    }
                }
            }
            val steps = Symmetric.eigen(covariance).map { (size, axis) ->
                Array(3) { c ->
                    val found = DoubleArray(Grid.SIZE)
                    for (q in 0 until r) add(found, axis[c * r + q] * sqrt(max(size, 0.0)), moves[c][q])
                    found
                }
            }
            return largest(steps)
        }

        /**
         * Modes whose variance at each wavelength is that of the band; errors are independent between the channels.
         */
        private fun ofBands(std: Three): List<Three> {
            val smooth = Directions.of(BAND_CORRELATION).columns
            val sizes = DoubleArray(Grid.SIZE) { m -> sqrt(smooth.sumOf { it[m] * it[m] }) }
            return largest(
                List(3 * smooth.size) { at ->
                    val c = at / smooth.size
                    Array(3) { own ->
                        DoubleArray(Grid.SIZE) { m ->
                            if (own == c) std[c][m] * (smooth[at % smooth.size][m] / sizes[m]) else 0.0
                        }
                    }
                },
            )
        }

        /** Reduces the modes to principal ones, the largest first; those below LEAST are left out. */
        private fun largest(modes: List<Three>): List<Three> {
            val gram = Array(modes.size) { DoubleArray(modes.size) }
            for (a in modes.indices) {
                for (b in 0..a) {
                    gram[a][b] = (0..2).sumOf { dot(modes[a][it], modes[b][it]) }
                    gram[b][a] = gram[a][b]
                }
            }
            val parts = Symmetric.eigen(gram)
            val most = parts.firstOrNull()?.first ?: 0.0
            return parts.filter { it.first > LEAST * most && most > 0 }.map { (_, axis) ->
                Array(3) { c ->
                    val found = DoubleArray(Grid.SIZE)
                    for ((i, mode) in modes.withIndex()) add(found, axis[i], mode[c])
                    found
                }
            }
        }

        private fun curves(of: JsonObject): Three = Array(3) { c ->
            of.numbers(listOf("red", "green", "blue")[c]).also {
                check(it.size == Grid.SIZE) { "${it.size} numbers" }
            }
        }

        private val none = emptyList<Three>()

        /** Correlation length of a curve's errors if only its band is known, nm. */
        private const val BAND_CORRELATION = 10.0

        /**
         * Largest difference between a document's bands and those of its covariance, as a fraction of the largest
         * band.
         */
        private const val SAME_BAND = 0.02

        /** Modes with less than this fraction of the largest one's variance are left out. */
        private const val LEAST = 1e-6
    }
}

/** The error for curves and a lamp from which no colour can be computed. */
internal object NoColour {
    fun error(): InvalidArgument = InvalidArgument(
        "These curves are too uncertain to compute colour under this lamp.",
        "Check the curves and the lamp; calibrate with better photos.",
    )
}
