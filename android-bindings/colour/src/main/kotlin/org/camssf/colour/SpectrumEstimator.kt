package org.camssf.colour

import org.camssf.CalibrationResult
import org.camssf.FramesDiffer
import org.camssf.InvalidArgument
import org.camssf.LampUnfit
import org.camssf.Recovered
import org.camssf.Rows
import org.camssf.RuntimeUnfit
import org.camssf.UnitDiffers
import org.camssf.flatten
import org.camssf.frozen

/**
 * Reflectances of surfaces from their raw signals in one photo, or in two under different lights, by this camera; the
 * numbers equal those of Python's `camssf_colour.spectrum`, and docs/spectrum.md says what they are worth.
 *
 * ```kotlin
 * fun erythema(result: Recovered, photo: Mosaic, whiteArea: Region, cheekArea: Region): Double {
 *     val (white, cheek) = RawRegion.measure(photo, listOf(whiteArea, cheekArea))
 *     val light = PhotoLight(Lamp.read("daylight"), Reference(white, reflectance = 0.9))
 *     val estimator = SpectrumEstimator.of(result, listOf(light), SurfacePrior.read("skin"))
 *     return estimator.spectrumOf(cheek).index(SkinIndex.ERYTHEMA).value
 * }
 * ```
 *
 * It runs small models with ONNX Runtime, as [Standardiser] does; it holds no native memory and no files of its own and
 * is immutable; safe to share between threads. Its functions take some ten milliseconds: any thread but the main one.
 */
public class SpectrumEstimator private constructor(
    private val photos: List<PhotoLight>,
    private val answers: List<Answer>,
    private val weights: DoubleArray,
    private val camera: CameraOfCurves,

    /** Of the surfaces. */
    public val prior: SurfacePrior,

    /** How XYZ and Lab are stated. */
    public val view: View,
) {
    override fun toString(): String = "SpectrumEstimator($lamps, $prior, $view)"

    /** One combination of lamps. */
    private class Answer(val response: SurfaceResponse, prior: SurfacePrior) {
        val posterior = SurfacePosterior(prior, response, reflectance = true)
    }

    /** The compared combinations of lamps with their weights. */
    public val lamps: List<WeighedLamps> = answers.mapIndexed { i, answer ->
        WeighedLamps(answer.response.names.frozen(), weights[i])
    }.frozen()

    /** χ² of the references' raw ratios under the most probable lamps; null if they were not used. */
    public val chiSquared: Double? = answers[weights.indices.maxByOrNull { weights[it] }!!].response.chiSquared

    /** (3) XYZ of the white that Lab is relative to. */
    public val white: Rows get() = Rows(mean(answers.map { it.response.white }, weights), 3)

    /**
     * The spectrum of a region. Signals of another exposure than their reference's are scaled by exposure time × ISO,
     * as the files state them.
     *
     * @param regions the surface in each photo, in the order of the photos.
     * @throws InvalidArgument not one region a photo, or another lens shading than its reference's.
     * @throws FramesDiffer another camera than the result's or the reference's, or a photo of another exposure that
     *   does not state it.
     * @throws UnitDiffers another physical camera or lens.
     */
    public fun spectrumOf(vararg regions: RawRegion): SurfaceSpectrum {
        val factors = regions.mapIndexed { i, region ->
            camera.check(region.source)
            photos.getOrNull(i)?.reference?.source?.factor(region.source) ?: 1.0
        }
        return spectrumOf(
            regions.mapIndexed { i, region -> region.sharedRaw.times(factors[i]) }.flatten(),
            regions.mapIndexed { i, region -> region.sharedError.times(factors[i]) }.flatten(),
        )
    }

    /**
     * The spectrum of raw signals whose photos are not known, so that camera and exposure are not checked.
     *
     * @param raw R, G, B of the surface in each photo in turn, black subtracted, with the camera and exposure of its
     *   reference.
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
        val relative = photos.mapIndexed { i, photo ->
            fun ofPhoto(values: DoubleArray) = values.copyOfRange(3 * i, 3 * i + 3)
            photo.reference.relative(ofPhoto(raw), ofPhoto(standardError))
        }
        return spectrumOf(
            RelativeSignals(relative.map { it.values }.flatten(), relative.map { it.standardError }.flatten()),
        )
    }

    /** The spectrum of signals of all photos, (3) each. */
    internal fun spectrumOf(signals: RelativeSignals): SurfaceSpectrum {
        val conditioned = answers.map { conditioned(it, signals) }
        val mixture = mixed(conditioned.map { it.first })
        val numbers = mixture.covariance.asList() + mixture.labCovariance.asList() + mixture.lab.asList()
        if (!numbers.all { it.isFinite() }) throw NoColour.error()
        return SurfaceSpectrum(
            mixture,
            conditioned.minOf { it.second },
            conditioned.indices.sumOf { weights[it] * conditioned[it].third },
        )
    }

    /** Numbers, distance and the share that the photo removed, by one combination of lamps. */
    private fun conditioned(
        answer: Answer,
        signals: RelativeSignals,
    ): Triple<SurfaceSpectrum.Numbers, Double, Double> {
        val surface = answer.posterior.of(signals)
        val n = SurfaceNodes.SIZE
        val p = surface.mean.size
        fun block(of: DoubleArray, from: Int, size: Int) =
            DoubleArray(size * size) { of[(from + it / size) * p + from + it % size] }
        val covariance = DoubleArray(p * p).also { sum -> for (part in surface.parts) add(sum, 1.0, part) }
        val relative = surface.mean.copyOfRange(n + 3, n + 6)
        val ones = DoubleArray(3) { 1.0 }
        val inside = SurfaceNodes.wavelengths.indices.filter { SurfaceNodes.wavelengths[it] in 400.0..700.0 }
        val remaining = inside.sumOf { covariance[it * (p + 1)] }
        val ofPrior = inside.sumOf { surface.priorVariance[it] }
        val numbers = SurfaceSpectrum.Numbers(
            surface.mean.copyOf(n),
            block(covariance, 0, n),
            surface.parts.map { block(it, 0, n) },
            surface.mean.copyOfRange(n, n + 3),
            block(covariance, n, 3),
            Spaces.lab(relative, ones),
            Spaces.through(Spaces.slopes(relative, ones), block(covariance, n + 3, 3)),
        )
        return Triple(numbers, surface.distance, 1 - remaining / ofPrior)
    }

    /** Mixes the answers by the law of total variance; their differences count as lamp error. */
    private fun mixed(spectra: List<SurfaceSpectrum.Numbers>): SurfaceSpectrum.Numbers {
        if (spectra.size == 1) return spectra[0]
        fun mean(of: (SurfaceSpectrum.Numbers) -> DoubleArray): DoubleArray = mean(spectra.map(of), weights)
        fun between(of: (SurfaceSpectrum.Numbers) -> DoubleArray): DoubleArray = covariance(spectra.map(of), weights)
        fun sum(a: DoubleArray, b: DoubleArray) = DoubleArray(a.size) { a[it] + b[it] }
        val ofLamp = between { it.reflectance }
        val parts = Part.values().map { part ->
            val within = mean { it.parts[part.ordinal] }
            if (part == Part.LAMP) sum(within, ofLamp) else within
        }
        return SurfaceSpectrum.Numbers(
            mean { it.reflectance },
            sum(mean { it.covariance }, ofLamp),
            parts,
            mean { it.xyz },
            sum(mean { it.xyzCovariance }, between { it.xyz }),
            mean { it.lab },
            sum(mean { it.labCovariance }, between { it.lab }),
        )
    }

    public companion object {
        /**
         * Creates an estimator for a camera, from a calibration or [org.camssf.SavedResult.read].
         *
         * @param photos the lights of one photo, or of two. XYZ and Lab are under the first. The reference is taken for
         *   the same object in both.
         * @param prior of the surfaces.
         * @param view how to state XYZ and Lab.
         * @throws InvalidArgument not one or two photos; curves from which no spectrum can be computed; no lamp if the
         *   result's own white is unknown.
         * @throws LampUnfit a reference's raw ratios contradict its lamp.
         * @throws FramesDiffer a reference's photo is of another camera than the result.
         * @throws UnitDiffers the same, of two cameras of one model.
         * @throws RuntimeUnfit ONNX Runtime is missing, or of a version that reports its use.
         */
        @JvmStatic
        @JvmOverloads
        public fun of(
            result: Recovered,
            photos: List<PhotoLight>,
            prior: SurfacePrior = SurfacePrior.read("general"),
            view: View = View(),
        ): SpectrumEstimator = of(ColourCamera.of(result), photos, prior, view)

        /**
         * Creates an estimator for the camera of a passport, or of a result's text.
         *
         * @param result the excerpt that a passport holds, or the text of a result, from [CalibrationResult.toJson].
         * @throws InvalidArgument a refused or invalid result, and as `of`.
         * @throws LampUnfit a reference's raw ratios contradict its lamp.
         * @throws FramesDiffer a reference's photo is of another camera than the result.
         * @throws UnitDiffers the same, of two cameras of one model.
         * @throws RuntimeUnfit ONNX Runtime is missing, or of a version that reports its use.
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
            val (responses, weights) = PhotoLight.responses(camera, photos, view)
            val answers = responses.map { Answer(it, prior) }
            return SpectrumEstimator(photos, answers, weights, camera.camera, prior, view)
        }
    }
}
