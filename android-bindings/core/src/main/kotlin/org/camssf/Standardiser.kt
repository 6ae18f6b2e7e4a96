package org.camssf

import org.camssf.colour.ColourCamera
import org.camssf.colour.Lit
import org.camssf.colour.NoColour
import org.camssf.colour.PhotoLight
import org.camssf.colour.PixelTable
import org.camssf.colour.RawRegion
import org.camssf.colour.Reach
import org.camssf.colour.Reference
import org.camssf.colour.Spread
import org.camssf.colour.StandardColour
import org.camssf.colour.View
import org.camssf.colour.WeighedLamp
import org.camssf.spectra.Lamp
import kotlin.math.hypot

/** The colour space that [Standardiser.standardise] writes. */
public enum class Space {
    /** X, Y, Z; Y of a perfect white diffuser is 1. */
    XYZ,

    /** L*, a*, b*. */
    LAB,
}

/**
 * Converts raw signals of this camera under a lamp to CIE XYZ and Lab, with their covariance; the numbers equal those
 * of Python's `camssf.colour.standard_colour`.
 *
 * A colour is the posterior of XYZ given the signals, with measured surfaces as the prior of reflectance
 * (docs/spectrum.md). The raw ratios of the reference constrain the lamp.
 *
 * ```
 * val (white, strip) = RawRegion.measure(frame.mosaic, listOf(whiteArea, stripArea))
 * val standardiser = Standardiser.of(calibrated, Lamp.read("daylight"), Reference(white, reflectance = 0.9))
 * val colour = standardiser.colourOf(strip)              // colour.lab, colour.labCovariance
 * standardiser.standardise(preview, into = pixels)       // any number of pixels, no allocation for each
 * ```
 *
 * Create it again if light or reference change, not for each picture. The first picture makes a table for each lamp,
 * four if the lamp is unknown. It holds no native memory and no files and is immutable; safe to share between
 * threads.
 */
public class Standardiser private constructor(
    private val lit: List<Lit>,
    private val weights: DoubleArray,
    private val reference: Reference,

    /** How colours are stated. */
    public val view: View,
) {
    override fun toString(): String = "Standardiser($lamps, $reference, $view)"

    private val scale = DoubleArray(3) { reference.reflectance / reference.sharedRaw[it] }

    /** The compared lamps with their weights; a given lamp is the only one. */
    public val lamps: List<WeighedLamp> =
        lit.mapIndexed { i, each -> WeighedLamp(each.light.name, weights[i]) }.frozen()

    /**
     * χ² of the reference's raw ratios under the most probable lamp, two degrees of freedom; null if they were not
     * used.
     */
    public val chiSquared: Double? = lit[best()].light.chiSquared

    /** (3) XYZ of the white that Lab is relative to, and that XYZ is adapted to if the view asks for it; a copy. */
    public val white: DoubleArray get() = mean(3) { it.white }

    private fun best(): Int = weights.indices.maxByOrNull { weights[it] }!!

    private inline fun mean(size: Int, of: (Lit) -> DoubleArray): DoubleArray {
        val found = DoubleArray(size)
        lit.forEachIndexed { i, each ->
            of(each).let { own ->
                for (at in found.indices) {
                    found[at] +=
                        weights[i] * own[at]
                }
            }
        }
        return found
    }

    /**
     * The colour of a region, measured in the photo of the reference or in another photo of the same exposure and
     * light.
     *
     * @throws ColourOutOfReach no surface can have this colour under this lamp.
     * @throws InvalidArgument invalid signals or standard errors.
     */
    public fun colourOf(region: RawRegion): StandardColour = colourOf(region.sharedRaw, region.sharedError)

    /**
     * The colour of raw signals.
     *
     * @param raw (3) R, G, B, black subtracted, in the reference's unit.
     * @param standardError (3) of `raw`.
     * @throws ColourOutOfReach no surface can have this colour under this lamp.
     * @throws InvalidArgument invalid signals or standard errors.
     */
    @JvmOverloads
    public fun colourOf(raw: DoubleArray, standardError: DoubleArray = DoubleArray(3)): StandardColour {
        if (raw.size != 3 || standardError.size != 3) {
            throw InvalidArgument("A colour has three signals, not ${raw.size}.", "Give R, G, B.")
        }
        check(standardError)
        val y = DoubleArray(3) { raw[it] * scale[it] }
        val error = DoubleArray(3) {
            hypot(standardError[it] * scale[it], y[it] * reference.sharedError[it] / reference.sharedRaw[it])
        }
        val found = seen(y, error)
        if (found.reach > Reach.FARTHEST) {
            throw ColourOutOfReach(
                "This colour cannot be a surface's colour under this lamp: ${fixed(found.reach, 1)} standard " +
                    "deviations from the nearest.",
                "Check the white reference and the lamp; leave out glare, light sources and fluorescent surfaces.",
                found.reach,
                Reach.FARTHEST,
            )
        }
        return found
    }

    /** The colour of signals (3) relative to a perfect white, without the check of reach. */
    internal fun seen(y: DoubleArray, error: DoubleArray): StandardColour {
        if (!y.all { it.isFinite() }) throw InvalidArgument("A signal is not finite.", "Give finite signals.")
        check(error)
        val found = mixed(lit.map { it.colour(y, error) })
        val numbers = found.parts.flatMap { it.xyz.asList() + it.lab.asList() } + found.sharedLab.asList()
        if (!numbers.all { it.isFinite() }) throw NoColour.error()
        return found
    }

    /** Mixes the answers by the law of total variance; their differences count as lamp error. */
    private fun mixed(answers: List<StandardColour>): StandardColour {
        if (answers.size == 1) return answers[0]
        fun mean(size: Int, of: (StandardColour) -> DoubleArray): DoubleArray {
            val found = DoubleArray(size)
            answers.forEachIndexed { i, each ->
                of(each).let {
                    for (at in 0 until size) {
                        found[at] +=
                            weights[i] * it[at]
                    }
                }
            }
            return found
        }
        val xyz = mean(3) { it.sharedXyz }
        val lab = mean(3) { it.sharedLab }
        fun between(middle: DoubleArray, of: (StandardColour) -> DoubleArray) = mean(9) { each ->
            val own = of(each)
            DoubleArray(9) { (own[it / 3] - middle[it / 3]) * (own[it % 3] - middle[it % 3]) }
        }
        val parts = List(answers[0].parts.size) { part ->
            Spread(mean(9) { it.parts[part].xyz }, mean(9) { it.parts[part].lab })
        }
        val lamp = parts[LAMP]
        val ofXyz = between(xyz) { it.sharedXyz }
        val ofLab = between(lab) { it.sharedLab }
        for (at in 0 until 9) {
            lamp.xyz[at] += ofXyz[at]
            lamp.lab[at] += ofLab[at]
        }
        return StandardColour(xyz, lab, parts, answers.minOf { it.reach })
    }

    /**
     * Converts pixels, for a live preview: without covariance and without an allocation for each pixel, by a table of
     * colours of exact signals; docs/spectrum.md states its error.
     *
     * @param raw R, G, B of each pixel in turn, black subtracted, in the reference's unit. Values below black count
     *   as black; NaN gives NaN.
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
        check(raw.size, into.size)
        val own = Pixel(space)
        for (i in raw.indices step 3) {
            own.see(raw[i].toDouble(), raw[i + 1].toDouble(), raw[i + 2].toDouble())
            for (c in 0..2) into[i + c] = own.found[c].toFloat()
        }
        return into
    }

    /** [standardise] in double precision. */
    @JvmOverloads
    public fun standardise(
        raw: DoubleArray,
        into: DoubleArray = DoubleArray(raw.size),
        space: Space = Space.LAB,
    ): DoubleArray {
        check(raw.size, into.size)
        val own = Pixel(space)
        for (i in raw.indices step 3) {
            own.see(raw[i], raw[i + 1], raw[i + 2])
            own.found.copyInto(into, i)
        }
        return into
    }

    private fun check(error: DoubleArray) {
        if (!error.all { it.isFinite() && it >= 0 }) {
            throw InvalidArgument("A standard error is negative or not finite.", "Give standard errors ≥ 0.")
        }
    }

    private fun check(size: Int, into: Int) {
        if (size % 3 != 0 || into != size) {
            throw InvalidArgument("$size numbers into $into are no pixels.", "Give three a pixel, in and out.")
        }
    }

    /** Work arrays of one pixel, reused by one call. */
    private inner class Pixel(private val space: Space) {
        val found = DoubleArray(3)
        private val own = DoubleArray(3)
        private val place = PixelTable.Place()
        private val tables = lit.map { it.table }

        fun see(r: Double, g: Double, b: Double) {
            found.fill(0.0)
            place.move(r * scale[0], g * scale[1], b * scale[2])
            for (i in weights.indices) {
                tables[i].colour(place, space == Space.LAB, own)
                for (c in 0..2) found[c] += weights[i] * own[c]
            }
        }
    }

    public companion object {
        /**
         * Creates a standardiser for a camera that was calibrated on this device.
         *
         * @param lamp of the photo, by name, by kind or measured; null mixes the four kinds by their likelihood given
         *   the reference's raw ratios.
         * @param reference a white or grey surface in the same light.
         * @throws InvalidArgument curves from which no colour can be computed, or no lamp if the result's own white
         *   is unknown.
         * @throws LampUnfit the reference's raw ratios contradict the lamp.
         */
        @JvmStatic
        @JvmOverloads
        public fun of(
            calibrated: Calibrated,
            lamp: Lamp?,
            reference: Reference,
            view: View = View(),
        ): Standardiser {
            val own = calibrated.capture.shots[0].lamp.takeUnless { it.unnamed }
            return of(ColourCamera.parse(calibrated.toJson(), own), lamp, reference, view)
        }

        /**
         * Creates a standardiser for a camera whose result was stored, on this device or on a desktop.
         *
         * @param result the text of a "camssf-result/1", from [Calibration.toJson].
         * @throws InvalidArgument a refused or invalid result; curves from which no colour can be computed, or no
         *   lamp if the result's own white is unknown.
         * @throws LampUnfit the reference's raw ratios contradict the lamp.
         */
        @JvmStatic
        @JvmOverloads
        public fun read(result: String, lamp: Lamp?, reference: Reference, view: View = View()): Standardiser =
            of(ColourCamera.parse(result), lamp, reference, view)

        private fun of(camera: ColourCamera, lamp: Lamp?, reference: Reference, view: View): Standardiser {
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
            val (lights, weights) = PhotoLight.lights(camera, listOf(PhotoLight(lamp, reference, raw, error)))
            return Standardiser(lights.map { Lit(it[0], view, reference.tolerance) }, weights, reference, view)
        }

        private const val LAMP = 1
    }
}
