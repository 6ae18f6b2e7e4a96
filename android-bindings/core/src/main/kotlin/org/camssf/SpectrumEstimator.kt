package org.camssf

import org.camssf.colour.ColourCamera
import org.camssf.colour.NoColour
import org.camssf.colour.Part
import org.camssf.colour.PhotoLight
import org.camssf.colour.RawRegion
import org.camssf.colour.Spaces
import org.camssf.colour.SurfaceNodes
import org.camssf.colour.SurfacePosterior
import org.camssf.colour.SurfacePrior
import org.camssf.colour.SurfaceResponse
import org.camssf.colour.SurfaceSpectrum
import org.camssf.colour.View
import org.camssf.colour.WeighedLamps
import kotlin.math.hypot

/**
 * Reflectances of surfaces from their raw signals in one photo, or in two under different lights, by this camera; the
 * numbers equal those of Python's `camssf.colour.spectrum`, and docs/spectrum.md says what they are worth.
 *
 * ```
 * val (white, cheek) = RawRegion.measure(frame.mosaic, listOf(whiteArea, cheekArea))
 * val light = PhotoLight(Lamp.read("D55"), Reference(white, reflectance = 0.9))
 * val estimator = SpectrumEstimator.of(calibrated, listOf(light), SurfacePrior.read("skin"))
 * val skin = estimator.spectrumOf(cheek)                // skin.reflectance, skin.index(SkinIndex.ERYTHEMA)
 * ```
 *
 * It holds no native memory and no files and is immutable; safe to share between threads.
 */
public class SpectrumEstimator private constructor(
    private val photos: List<PhotoLight>,
    private val answers: List<Answer>,
    private val weights: DoubleArray,

    /** Of the surfaces. */
    public val prior: SurfacePrior,

    /** How XYZ and Lab are stated. */
    public val view: View,
) {
    override fun toString(): String = "SpectrumEstimator($lamps, $prior, $view)"

    /** One combination of lamps. */
    private class Answer(
        val names: List<String>,
        val chiSquared: Double?,
        val response: SurfaceResponse,
        val posterior: SurfacePosterior,
    )

    /** The compared combinations of lamps with their weights. */
    public val lamps: List<WeighedLamps> = answers.mapIndexed { i, each ->
        WeighedLamps(each.names.frozen(), weights[i])
    }.frozen()

    /** χ² of the references' raw ratios under the most probable lamps; null if they were not used. */
    public val chiSquared: Double? = answers[weights.indices.maxByOrNull { weights[it] }!!].chiSquared

    /** (3) XYZ of the white that Lab is relative to; a copy. */
    public val white: DoubleArray get() = mean(answers.map { it.response.white })

    /**
     * The spectrum of a region.
     *
     * @param regions the surface in each photo, in the order of the photos.
     * @throws InvalidArgument not one region a photo.
     */
    public fun spectrumOf(vararg regions: RawRegion): SurfaceSpectrum =
        spectrumOf(regions.map { it.sharedRaw }.flatten(), regions.map { it.sharedError }.flatten())

    /**
     * The spectrum of raw signals.
     *
     * @param raw R, G, B of the surface in each photo in turn, black subtracted, in its reference's unit.
     * @param standardError of `raw`.
     * @throws InvalidArgument another number of signals, or invalid ones.
     */
    public fun spectrumOf(raw: DoubleArray, standardError: DoubleArray): SurfaceSpectrum {
        val count = 3 * photos.size
        if (raw.size != count || standardError.size != count) {
            throw InvalidArgument(
                "A surface in ${photos.size} photos has $count signals, not ${raw.size}.",
                "Give R, G, B of each photo, and their standard errors.",
            )
        }
        check(standardError)
        val references = List(count) { photos[it / 3].reference }
        val scale = DoubleArray(count) { references[it].reflectance / references[it].sharedRaw[it % 3] }
        val y = DoubleArray(count) { raw[it] * scale[it] }
        return seen(
            y,
            DoubleArray(count) {
                val ofReference = references[it].sharedError[it % 3] / references[it].sharedRaw[it % 3]
                hypot(standardError[it] * scale[it], y[it] * ofReference)
            },
        )
    }

    /** The spectrum of signals relative to a perfect white. */
    internal fun seen(y: DoubleArray, error: DoubleArray): SurfaceSpectrum {
        if (!y.all { it.isFinite() }) throw InvalidArgument("A signal is not finite.", "Give finite signals.")
        check(error)
        val found = answers.map { given(it, y, error) }
        val all = mixed(found.map { it.first })
        val numbers = all.covariance.asList() + all.labCovariance.asList() + all.lab.asList()
        if (!numbers.all { it.isFinite() }) throw NoColour.error()
        return SurfaceSpectrum(
            all,
            found.minOf { it.second },
            found.indices.sumOf { weights[it] * found[it].third },
        )
    }

    private fun check(error: DoubleArray) {
        if (!error.all { it.isFinite() && it >= 0 }) {
            throw InvalidArgument("A standard error is negative or not finite.", "Give standard errors ≥ 0.")
        }
    }

    /** Numbers, distance and the share that the photo removed, by one combination of lamps. */
    private fun given(
        answer: Answer,
        y: DoubleArray,
        error: DoubleArray,
    ): Triple<SurfaceSpectrum.Numbers, Double, Double> {
        val found = answer.posterior.given(y, error)
        val n = SurfaceNodes.SIZE
        val p = found.mean.size
        fun block(of: DoubleArray, from: Int, size: Int) =
            DoubleArray(size * size) { of[(from + it / size) * p + from + it % size] }
        val covariance = DoubleArray(p * p).also { whole ->
            for (part in found.parts) for (at in whole.indices) whole[at] += part[at]
        }
        val relative = found.mean.copyOfRange(n + 3, n + 6)
        val ones = DoubleArray(3) { 1.0 }
        val before = answer.posterior.priorVariance
        val inside = SurfaceNodes.wavelengths.indices.filter { SurfaceNodes.wavelengths[it] in 400.0..700.0 }
        val left = inside.sumOf { covariance[it * (p + 1)] } / inside.sumOf { found.level * found.level * before[it] }
        val numbers = SurfaceSpectrum.Numbers(
            found.mean.copyOf(n),
            block(covariance, 0, n),
            found.parts.map { block(it, 0, n) },
            found.mean.copyOfRange(n, n + 3),
            block(covariance, n, 3),
            Spaces.lab(relative, ones),
            Spaces.through(Spaces.slopes(relative, ones), block(covariance, n + 3, 3)),
        )
        return Triple(numbers, found.distance, 1 - left)
    }

    /** Mixes the answers by the law of total variance; their differences count as lamp error. */
    private fun mixed(found: List<SurfaceSpectrum.Numbers>): SurfaceSpectrum.Numbers {
        if (found.size == 1) return found[0]
        val reflectance = mean(found.map { it.reflectance })
        val xyz = mean(found.map { it.xyz })
        val lab = mean(found.map { it.lab })
        fun between(values: List<DoubleArray>, middle: DoubleArray) = mean(
            values.map { own ->
                val n = own.size
                DoubleArray(n * n) { (own[it / n] - middle[it / n]) * (own[it % n] - middle[it % n]) }
            },
        )
        fun sum(a: DoubleArray, b: DoubleArray) = DoubleArray(a.size) { a[it] + b[it] }
        val apart = between(found.map { it.reflectance }, reflectance)
        val parts = Part.values().map { part ->
            val own = mean(found.map { it.parts[part.ordinal] })
            if (part == Part.LAMP) sum(own, apart) else own
        }
        return SurfaceSpectrum.Numbers(
            reflectance,
            sum(mean(found.map { it.covariance }), apart),
            parts,
            xyz,
            sum(mean(found.map { it.xyzCovariance }), between(found.map { it.xyz }, xyz)),
            lab,
            sum(mean(found.map { it.labCovariance }), between(found.map { it.lab }, lab)),
        )
    }

    private fun mean(values: List<DoubleArray>): DoubleArray {
        val found = DoubleArray(values[0].size)
        for ((i, each) in values.withIndex()) for (at in found.indices) found[at] += weights[i] * each[at]
        return found
    }

    public companion object {
        /**
         * Creates an estimator for a camera that was calibrated on this device.
         *
         * @param photos the lights of one photo, or of two. XYZ and Lab are under the first. The reference is taken for
         *   the same object in both.
         * @param prior of the surfaces.
         * @param view how to state XYZ and Lab.
         * @throws InvalidArgument not one or two photos; curves from which no spectrum can be computed; no lamp if the
         *   result's own white is unknown.
         * @throws LampUnfit a reference's raw ratios contradict its lamp.
         */
        @JvmStatic
        @JvmOverloads
        public fun of(
            calibrated: Calibrated,
            photos: List<PhotoLight>,
            prior: SurfacePrior = SurfacePrior.read("general"),
            view: View = View(),
        ): SpectrumEstimator {
            val own = calibrated.capture.shots[0].lamp.takeUnless { it.unnamed }
            return of(ColourCamera.parse(calibrated.toJson(), own), photos, prior, view)
        }

        /**
         * Creates an estimator for a camera whose result was stored, on this device or on a desktop.
         *
         * @param result the text of a "camssf-result/1", from [Calibration.toJson].
         * @throws InvalidArgument a refused or invalid result, and as `of`.
         * @throws LampUnfit a reference's raw ratios contradict its lamp.
         */
        @JvmStatic
        @JvmOverloads
        public fun read(
            result: String,
            photos: List<PhotoLight>,
            prior: SurfacePrior = SurfacePrior.read("general"),
            view: View = View(),
        ): SpectrumEstimator = of(ColourCamera.parse(result), photos, prior, view)

        internal fun of(
            camera: ColourCamera,
            photos: List<PhotoLight>,
            prior: SurfacePrior,
            view: View,
        ): SpectrumEstimator {
            if (photos.size !in 1..2) {
                throw InvalidArgument(
                    "A spectrum needs one or two photos, not ${photos.size}.",
                    "Give the light of each photo.",
                )
            }
            val (lights, weights) = PhotoLight.lights(camera, photos)
            val tolerances = photos.map { it.reference.tolerance }
            val answers = lights.map { own ->
                val response = SurfaceResponse.of(own, tolerances, view, reflectance = true)
                Answer(own.map { it.name }, own[0].chiSquared, response, SurfacePosterior(prior, response.linear))
            }
            return SpectrumEstimator(photos, answers, weights, prior, view)
        }
    }
}
