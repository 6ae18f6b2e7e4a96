package org.camssf.colour

import org.camssf.CalibrationException
import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.Recovered
import org.camssf.Refused
import org.camssf.Rules
import org.camssf.SavedResult
import org.camssf.json.JsonText
import org.camssf.photo.DocumentForm
import org.camssf.photo.PhysicalCamera
import org.camssf.recovery.LearnedBasis
import org.camssf.spectra.Lamp
import kotlin.math.max
import kotlin.math.min
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
 * @property ownWhite the calibration's white; null if it is not known.
 * @property camera that the curves belong to.
 */
internal class ColourCamera private constructor(
    val values: Three,
    val modes: List<Three>,
    val ownWhite: OwnWhite?,
    val camera: CameraOfCurves,
) {
    companion object {
        /**
         * Reads the camera of a result's text, or of the excerpt of one that a passport holds.
         *
         * @throws InvalidArgument a refused result, or a text that is no result.
         */
        fun parse(text: String): ColourCamera {
            if (EXCERPT in text) ofExcerpt(text)?.let { return it }
            when (val result = SavedResult.read(text)) {
                is Recovered -> return of(result)

                is Refused -> throw InvalidArgument(
                    "This result was refused (${result.error.code}): it has no curves.", result.error.advice,
                )
            }
        }

        /**
         * The camera of a result. The modes come from the result's covariance if possible; otherwise from its bands,
         * assuming that errors are smooth over 10 nm and independent between the channels.
         */
        fun of(result: Recovered): ColourCamera {
            val photo = result.capture.shots[0].photo
            val camera = CameraOfCurves(photo.make, photo.model, photo.camera)
            val curves = result.answer.curves
            val values = curves.values.toTypedArray()
            return of(values, curves.std?.toTypedArray(), curves.channelGain, StoredLamp.of(result), camera) { lamp ->
                val basis = LearnedBasis.of(result.basis.name, result.provenance.basis)
                ofCode(basis, result.basis.priorScale, curves.codeCovariance, values, lamp)
            }
        }

        /**
         * The camera of a passport's excerpt, which has neither covariance nor the lamp's power; null for another text.
         */
        private fun ofExcerpt(text: String): ColourCamera? {
            try {
                val excerpt = JsonText.parse(text) as Map<*, *>
                if (excerpt["format"] != FORMAT) return null
                fun numbers(of: Any?) = (of as List<*>).map { (it as Number).toDouble() }.toDoubleArray()
                fun curves(of: Any?) = Array(3) { c -> numbers((of as Map<*, *>)[COLOURS[c]]) }
                val named = excerpt["camera"] as Map<*, *>
                val shot = (excerpt["shots"] as List<*>)[0] as Map<*, *>
                require((shot["patches"] as List<*>).isEmpty()) { "it is no passport's excerpt" }
                val camera = CameraOfCurves(named["make"] as String, named["model"] as String, PhysicalCamera())
                val std = excerpt["ssf_std"]?.let { curves(it) }
                val lamp = lampOf((shot["lamp"] as Map<*, *>)["name"] as String)
                return of(curves(excerpt["ssf"]), std, numbers(excerpt["channel_gain"]), lamp, camera) { null }
            } catch (error: CalibrationException) {
                throw error
            } catch (error: RuntimeException) { // a missing or malformed field
                val words = "This is no excerpt that a passport holds (${error.message?.lines()?.first()})."
                throw InvalidArgument(words, DocumentForm.ADVICE, cause = error)
            }
        }

        /** The lamp of this name; null for a file's, or a light that was not named. */
        private fun lampOf(name: String): Lamp? = try {
            Lamp.read(name)
        } catch (_: InvalidArgument) {
            null
        }

        /**
         * The camera of these curves of peak 1 and their standard deviations.
         *
         * @param gain (3) raw white of each channel relative to green.
         * @param lamp of that white; null if it is unknown.
         * @param ofCode the modes from the covariance of the curves' code under a lamp; null if there are none.
         */
        fun of(
            values: Three,
            std: Three?,
            gain: DoubleArray,
            lamp: Lamp?,
            camera: CameraOfCurves,
            ofCode: (Lamp) -> List<Three>?,
        ): ColourCamera {
            val sized = (values.toList() + std.orEmpty()).all { it.size == Grid.SIZE } && gain.size == 3
            require(sized) { "curves of another size" }
            if (!values.all { curve -> curve.all { it.isFinite() } && curve.max() > 0 }) {
                throw InvalidArgument("A curve is not finite, or has no positive peak.", "Give measured curves.")
            }
            val ownWhite = lamp?.let { light ->
                val signals = List(3) { dot(light.sharedValues, values[it]) }
                if (gain.all { it > 0 } && signals.all { it > 0 }) OwnWhite(gain, light) else null
            }
            if (std == null) return ColourCamera(values, none, ownWhite, camera)
            if (!std.all { band -> band.all { it >= 0 && it.isFinite() } }) {
                throw InvalidArgument("A standard deviation is negative or not finite.", DocumentForm.ADVICE)
            }
            val modes = ownWhite?.let { ofCode(it.lamp) }?.let { withRest(it, std) }
                ?: ofBands(std)
            return ColourCamera(values, modes, ownWhite, camera)
        }

        /** Modes from the covariance of the curves' code on a basis, its lower triangle; null without either. */
        fun ofCode(
            basis: LearnedBasis?,
            scale: Double,
            triangle: DoubleArray?,
            values: Three,
            lamp: Lamp,
        ): List<Three>? {
            if (basis == null || triangle == null) return null
            val size = 3 * basis.atoms
            if (!(scale > 0 && scale.isFinite()) || triangle.size != size * (size + 1) / 2) return null
            val covariance = Array(size) { a ->
                DoubleArray(size) { b -> max(a, b).let { triangle[it * (it + 1) / 2 + min(a, b)] } }
            }
            return modes(values, covariance, basis, scale, lamp.sharedValues)
        }

        /**
         * Modes of the bands: these, where they are not wider, and those of what else the bands hold.
         *
         * The rest is what the basis misses, and the difference between mixed answers.
         */
        private fun withRest(modes: List<Three>, std: Three): List<Three> {
            val own = Array(3) { c -> DoubleArray(Grid.SIZE) { sqrt(variance(modes, c, it)) } }
            val within = modes.map { mode ->
                Array(3) { c ->
                    DoubleArray(Grid.SIZE) {
                        mode[c][it] * if (own[c][it] > std[c][it]) std[c][it] / own[c][it] else 1.0
                    }
                }
            }
            val rest = Array(3) { c ->
                DoubleArray(Grid.SIZE) {
                    val inside = min(own[c][it], std[c][it])
                    sqrt(max(std[c][it] * std[c][it] - inside * inside, 0.0))
                }
            }
            return if (rest.any { it.max() > 0 }) largest(within + ofBands(rest)) else within
        }

        private fun variance(modes: List<Three>, c: Int, m: Int): Double = modes.sumOf { it[c][m] * it[c][m] }

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
                    val step = DoubleArray(Grid.SIZE)
                    for (q in 0 until r) add(step, axis[c * r + q] * sqrt(max(size, 0.0)), moves[c][q])
                    step
                }
            }
            return largest(steps)
        }

        /**
         * Modes whose variance at each wavelength is that of the band; errors are independent between the channels.
         */
        private fun ofBands(std: Three): List<Three> {
            val smooth = unitErrors(BAND_CORRELATION)
            return largest(
                List(3 * smooth.size) { at ->
                    val c = at / smooth.size
                    Array(3) { channel ->
                        DoubleArray(Grid.SIZE) { m ->
                            if (channel == c) std[c][m] * smooth[at % smooth.size][m] else 0.0
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
                    val principal = DoubleArray(Grid.SIZE)
                    for ((i, mode) in modes.withIndex()) add(principal, axis[i], mode[c])
                    principal
                }
            }
        }

        private val COLOURS = listOf("red", "green", "blue")

        /** Format of a passport's excerpt. */
        private const val FORMAT = "camssf-result/1"
        private const val EXCERPT = "\"$FORMAT\""

        private val none = emptyList<Three>()

        /** Correlation length of a curve's errors if only its band is known, nm. */
        private val BAND_CORRELATION get() = Rules.shipped.number("colour.band_correlation")

        /** Modes with less than this fraction of the largest one's variance are left out. */
        private val LEAST get() = Rules.shipped.number("colour.least_mode")
    }
}

/** The error for curves and a lamp from which no colour can be computed. */
internal object NoColour {
    fun error(): InvalidArgument = InvalidArgument(
        "These curves are too uncertain to compute colour under this lamp.",
        "Check the curves and the lamp; calibrate with better photos.",
    )
}
