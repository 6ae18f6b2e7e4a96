package org.camssf.colour

import org.camssf.CalibrationException
import org.camssf.CalibrationResult
import org.camssf.ColourOutOfReach
import org.camssf.FramesDiffer
import org.camssf.InvalidArgument
import org.camssf.LampUnfit
import org.camssf.Recovered
import org.camssf.Refusal
import org.camssf.Rows
import org.camssf.RuntimeUnfit
import org.camssf.UnitDiffers
import org.camssf.UnsupportedRaw
import org.camssf.frozen
import org.camssf.photo.LensShading
import org.camssf.photo.Mosaic
import org.camssf.photo.PhotoSource
import org.camssf.spectra.Lamp

/** The colour space that [Standardiser.standardise] writes. */
public enum class Space {
    /** X, Y, Z; Y of a perfect white diffuser is 1. */
    XYZ,

    /** L*, a*, b*. */
    LAB,
}

/**
 * Converts raw signals of this camera under a lamp to CIE XYZ and Lab, with their covariance; the numbers equal those
 * of Python's `camssf_colour.standard_colour`.
 *
 * A colour is the posterior of XYZ given the signals, with measured surfaces as the prior of reflectance
 * (docs/spectrum.md). The raw ratios of the reference constrain the lamp.
 *
 * ```kotlin
 * fun lab(result: Recovered, photo: Mosaic, whiteArea: Region, stripArea: Region): Rows {
 *     val (white, strip) = RawRegion.measure(photo, listOf(whiteArea, stripArea))
 *     val standardiser = Standardiser.of(result, Lamp.read("daylight"), Reference(white, reflectance = 0.9))
 *     return standardiser.colourOf(strip).lab
 * }
 * ```
 *
 * Create it again if light or reference change, not for each picture. The first picture makes a table for each lamp,
 * four if the lamp is unknown. It runs small models with ONNX Runtime, which the first one opens for the whole process;
 * it holds no native memory and no files of its own and is immutable; safe to share between threads. Its functions take
 * some milliseconds, a first picture more: any thread but the main one.
 */
public class Standardiser private constructor(
    private val contexts: List<LampContext>,
    private val weights: DoubleArray,
    private val light: PhotoLight,
    internal val camera: ColourCamera,

    /** How colours are stated. */
    public val view: View,
) {
    internal val reference: Reference get() = light.reference

    /** Of pictures, by the white that they are adapted to; made when it is first needed. */
    private val pictureLights = PictureSpace.values().map { it.white }.distinct().associateWith { white ->
        lazy {
            val (responses, weights) = PhotoLight.responses(camera, listOf(light), View(white = white))
            PictureLights(responses, weights)
        }
    }

    override fun toString(): String = "Standardiser($lamps, $reference, $view)"

    /** The compared lamps with their weights; a named lamp is the only one. */
    public val lamps: List<WeighedLamp> =
        contexts.mapIndexed { i, context -> WeighedLamp(context.response.names.single(), weights[i]) }.frozen()

    /**
     * χ² of the reference's raw ratios under the most probable lamp, two degrees of freedom; null if they were not
     * used.
     */
    public val chiSquared: Double? = contexts[weights.indices.maxByOrNull { weights[it] }!!].response.chiSquared

    /** (3) XYZ of the white that Lab is relative to, and that XYZ is adapted to if the view asks for it. */
    public val white: Rows get() = Rows(mean(contexts.map { it.response.white }, weights), 3)

    /**
     * The colour of a region, measured in the photo of the reference or in another photo in the same light. Signals of
     * another exposure are scaled by exposure time × ISO, as the files state them.
     *
     * @throws ColourOutOfReach no surface can have this colour under this lamp.
     * @throws InvalidArgument invalid signals or standard errors, or another lens shading than the reference's.
     * @throws FramesDiffer another camera than the result's or the reference's, or a photo of another exposure that
     *   does not state it.
     * @throws UnitDiffers another physical camera or lens.
     */
    public fun colourOf(region: RawRegion): StandardColour = colourOf(region, reference)

    /** The same relative to another reference in the same light. */
    internal fun colourOf(region: RawRegion, white: Reference): StandardColour {
        val factor = factor(region.source, white)
        return reached(white.relative(region.sharedRaw.times(factor), region.sharedError.times(factor)))
    }

    /** What brings signals of another photo of this camera to the exposure of a reference. */
    internal fun factor(source: SignalSource, white: Reference = reference): Double {
        camera.camera.check(source)
        return white.source?.factor(source) ?: 1.0
    }

    /**
     * The colour of raw signals whose photo is not known, so that camera and exposure are not checked.
     *
     * @param raw (3) R, G, B, black subtracted, with the camera and exposure of the reference.
     * @param standardError (3) of `raw`.
     * @throws ColourOutOfReach no surface can have this colour under this lamp.
     * @throws InvalidArgument invalid signals or standard errors.
     */
    @JvmOverloads
    public fun colourOf(raw: DoubleArray, standardError: DoubleArray = DoubleArray(3)): StandardColour {
        if (raw.size != 3 || standardError.size != 3) {
            throw InvalidArgument("A colour has three signals, not ${raw.size}.", "Give R, G, B.")
        }
        return reached(reference.relative(raw, standardError))
    }

    /** The colour of signals (3) that a surface can have. */
    private fun reached(signals: RelativeSignals): StandardColour {
        val colour = colourOf(signals)
        if (colour.reach > SurfaceDistance.REACH) {
            throw Refusal.of(
                "colour_out_of_reach.colour", "distance" to colour.reach, value = colour.reach,
                threshold = SurfaceDistance.REACH,
            )
        }
        return colour
    }

    /** The colour of signals (3), without the check of reach. */
    internal fun colourOf(signals: RelativeSignals): StandardColour {
        val colour = mixed(contexts.map { it.colour(signals) })
        val numbers = colour.parts.flatMap { it.xyz.asList() + it.lab.asList() } + colour.sharedLab.asList()
        if (!numbers.all { it.isFinite() }) throw NoColour.error()
        return colour
    }

    /** Mixes the answers by the law of total variance; their differences count as lamp error. */
    private fun mixed(answers: List<StandardColour>): StandardColour {
        if (answers.size == 1) return answers[0]
        val (xyz, lab) = answers.map { it.sharedXyz } to answers.map { it.sharedLab }
        val parts = Part.values().map { part ->
            val spreads = answers.map { it.parts[part.ordinal] }
            Spread(mean(spreads.map { it.xyz }, weights), mean(spreads.map { it.lab }, weights))
        }
        val lamp = parts[Part.LAMP.ordinal]
        add(lamp.xyz, 1.0, covariance(xyz, weights))
        add(lamp.lab, 1.0, covariance(lab, weights))
        return StandardColour(mean(xyz, weights), mean(lab, weights), parts, answers.minOf { it.reach })
    }

    /**
     * Creates the picture of a photo in the light of the reference, usually the reference's own photo. Signals of
     * another exposure are scaled as in [colourOf]. The view does not matter, since the space states its own white.
     *
     * The first picture makes a table of colours for each lamp, in some seconds on a phone; it is kept.
     *
     * @param photo the whole photo, by the same camera.
     * @param space of the picture's numbers.
     * @param lensShading APPLY multiplies the samples by the file's gain maps; the same as for the reference.
     * @param dark the same view with the same settings and the torch off, if the reference was measured so: the picture
     *   is that in the torch's light alone. Nothing may move between the two.
     * @throws InvalidArgument a photo of which only a part is there, another lens shading than the reference's, or
     *   curves from which no colour can be computed.
     * @throws FramesDiffer another camera than the result's or the reference's, or a photo of another exposure that
     *   does not state it.
     * @throws UnitDiffers another physical camera or lens.
     * @throws UnsupportedRaw gain maps that cannot be applied.
     */
    @JvmOverloads
    public fun picture(
        photo: Mosaic,
        space: PictureSpace = PictureSpace.SRGB,
        lensShading: LensShading = LensShading.AS_STORED,
        dark: Mosaic? = null,
    ): StandardPicture = picture(PhotoSource.of(photo), space, lensShading, dark?.let { PhotoSource.of(it) })

    /**
     * As the other `picture`, for a photo that is read in bands, since it is too large for memory.
     *
     * @throws CalibrationException as the other `picture`, or the photo cannot be read.
     */
    @JvmOverloads
    public fun picture(
        photo: PhotoSource,
        space: PictureSpace = PictureSpace.SRGB,
        lensShading: LensShading = LensShading.AS_STORED,
        dark: PhotoSource? = null,
    ): StandardPicture {
        val parts = PictureParts.of(photo)
        val source = SignalSource(parts.facts, lensShading)
        val white = WhiteSignal.of(reference, factor(source), source)
        val lights = pictureLights.getValue(space.white).value
        return StandardPicture(parts, dark?.let { PictureParts.of(it) }, white, space, lensShading, lights)
    }

    /**
     * Converts the pixels of a photo, for a live preview: without covariance and without an allocation for each pixel,
     * by a table of colours of exact signals; docs/spectrum.md states its error. Signals of another exposure than the
     * reference's are scaled as in [colourOf]. A pixel with a clipped sample is NaN.
     *
     * @param pixels of the photo.
     * @param into receives three numbers a pixel; a preview can reuse it for every frame.
     * @param space the colour space of the output.
     * @throws InvalidArgument as [RawPixels.read], or a reference whose lens shading was corrected.
     * @throws FramesDiffer another camera than the result's or the reference's, or a photo of another exposure that
     *   does not state it.
     * @throws UnitDiffers another physical camera or lens.
     */
    @JvmOverloads
    public fun standardise(
        photo: Mosaic,
        pixels: RawPixels,
        into: FloatArray = FloatArray(3 * pixels.rows * pixels.columns),
        space: Space = Space.LAB,
    ): FloatArray {
        val factor = factor(SignalSource(photo.facts, LensShading.AS_STORED)).toFloat()
        pixels.read(photo, into)
        if (factor != 1f) for (i in into.indices) into[i] *= factor
        return standardise(into, into, space)
    }

    /**
     * Converts pixels whose photo is not known, as the other `standardise` does; camera and exposure are not checked.
     *
     * @param raw R, G, B of each pixel in turn, black subtracted, with the camera and exposure of the reference.
     *   Values below black count as black; NaN gives NaN.
     * @param into receives three numbers a pixel; may be `raw` itself.
     * @param space the colour space of the output.
     * @throws InvalidArgument array sizes that do not fit.
     */
    @JvmOverloads
    public fun standardise(
        raw: FloatArray,
        into: FloatArray = FloatArray(raw.size),
        space: Space = Space.LAB,
    ): FloatArray {
        convert(raw.size, into.size, space, { raw[it].toDouble() }) { i, value -> into[i] = value.toFloat() }
        return into
    }

    /** The same in double precision. */
    @JvmOverloads
    public fun standardise(
        raw: DoubleArray,
        into: DoubleArray = DoubleArray(raw.size),
        space: Space = Space.LAB,
    ): DoubleArray {
        convert(raw.size, into.size, space, { raw[it] }) { i, value -> into[i] = value }
        return into
    }

    private inline fun convert(
        size: Int,
        into: Int,
        space: Space,
        raw: (Int) -> Double,
        write: (Int, Double) -> Unit,
    ) {
        if (size % 3 != 0 || into != size) {
            throw InvalidArgument("$size numbers into $into are no pixels.", "Give three a pixel, in and out.")
        }
        val pixel = Pixel(space)
        for (i in 0 until size step 3) {
            pixel.read(raw(i), raw(i + 1), raw(i + 2))
            for (c in 0..2) write(i + c, pixel.colour[c])
        }
    }

    /** Work arrays of one pixel, reused by one call. */
    private inner class Pixel(private val space: Space) {
        val colour = DoubleArray(3)
        private val underLamp = DoubleArray(3)
        private val place = PixelTable.Place()
        private val tables = contexts.map { it.table }
        private val scale = reference.scale

        /** Sets [colour] to that of raw signals. */
        fun read(r: Double, g: Double, b: Double) {
            colour.fill(0.0)
            place.move(r * scale[0], g * scale[1], b * scale[2])
            for (i in weights.indices) {
                tables[i].colour(place, space == Space.LAB, underLamp)
                for (c in 0..2) colour[c] += weights[i] * underLamp[c]
            }
        }
    }

    public companion object {
        /**
         * Creates a standardiser for a camera, from a calibration or [org.camssf.SavedResult.read].
         *
         * @param lamp of the photo, by name, by kind or measured; null mixes the four kinds by their likelihood given
         *   the reference's raw ratios.
         * @param reference a white or grey surface in the same light.
         * @throws InvalidArgument curves from which no colour can be computed, or no lamp if the result's own white
         *   is unknown.
         * @throws LampUnfit the reference's raw ratios contradict the lamp.
         * @throws FramesDiffer the reference's photo is of another camera than the result.
         * @throws UnitDiffers the same, of two cameras of one model.
         * @throws RuntimeUnfit ONNX Runtime is missing, or of a version that reports its use.
         */
        @JvmStatic
        @JvmOverloads
        public fun of(
            result: Recovered,
            lamp: Lamp?,
            reference: Reference,
            view: View = View(),
        ): Standardiser = of(ColourCamera.of(result), lamp, reference, view)

        /**
         * Creates a standardiser for the camera of a passport, or of a result's text.
         *
         * @param result the excerpt that a passport holds, or the text of a result, from [CalibrationResult.toJson].
         * @throws InvalidArgument a refused or invalid result; curves from which no colour can be computed, or no
         *   lamp if the result's own white is unknown.
         * @throws LampUnfit the reference's raw ratios contradict the lamp.
         * @throws FramesDiffer the reference's photo is of another camera than the result.
         * @throws UnitDiffers the same, of two cameras of one model.
         * @throws RuntimeUnfit ONNX Runtime is missing, or of a version that reports its use.
         */
        @JvmStatic
        @JvmOverloads
        public fun read(result: String, lamp: Lamp?, reference: Reference, view: View = View()): Standardiser =
            of(ColourCamera.parse(result), lamp, reference, view)

        internal fun of(camera: ColourCamera, lamp: Lamp?, reference: Reference, view: View): Standardiser {
            val error = (0..2).maxOf { reference.sharedError[it] / reference.sharedRaw[it] }
            return of(camera, lamp, reference, view, reference.sharedRaw, error)
        }

        /**
         * @param raw of the reference, whose ratios constrain the lamp; null to leave them out.
         * @param error relative standard error of `raw`.
         */
        internal fun of(
            camera: ColourCamera,
            lamp: Lamp?,
            reference: Reference,
            view: View,
            raw: DoubleArray?,
            error: Double,
        ): Standardiser {
            val photo = PhotoLight(lamp, reference, raw, error)
            val (responses, weights) = PhotoLight.responses(camera, listOf(photo), view)
            return Standardiser(responses.map { LampContext(it) }, weights, photo, camera, view)
        }
    }
}
