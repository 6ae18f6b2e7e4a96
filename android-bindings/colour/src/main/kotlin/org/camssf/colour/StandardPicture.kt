package org.camssf.colour

import org.camssf.CalibrationException
import org.camssf.CalibrationResult
import org.camssf.FramesDiffer
import org.camssf.InvalidArgument
import org.camssf.Recovered
import org.camssf.Rows
import org.camssf.RuntimeUnfit
import org.camssf.UnitDiffers
import org.camssf.UnsupportedRaw
import org.camssf.frozen
import org.camssf.photo.Alike
import org.camssf.photo.LensShading
import org.camssf.photo.PhotoSource
import org.camssf.photo.Shading
import org.camssf.spectra.Lamp
import java.io.IOException
import java.io.OutputStream

/** Receives a picture strip by strip, from its top. */
public fun interface PictureStrips {
    /**
     * Takes the next rows.
     *
     * @param top the first row in the picture.
     * @param rows how many there are.
     * @param pixels (rows, width, 3) unsigned 16-bit numbers of the picture's space, row-major.
     * @param uncertainty (rows / 2, width / 2, 3) unsigned 16-bit standard deviations of L*, a* and b* of a pixel in
     *   hundredths, for blocks of 2 × 2 pixels; all three [StandardPicture.CLIPPED] where a sample was clipped,
     *   [StandardPicture.OUT_OF_REACH] where no surface has the colour under this light.
     */
    public fun take(top: Int, rows: Int, pixels: ShortArray, uncertainty: ShortArray)
}

/**
 * What a picture that was written holds.
 *
 * @property clipped share of the picture that is clipped, 0 to 1; it is white in the picture.
 * @property outOfReach share of colours that no surface has under this light, 0 to 1.
 */
public class PictureShares internal constructor(public val clipped: Double, public val outOfReach: Double) {
    override fun toString(): String = "PictureShares(clipped=$clipped, outOfReach=$outOfReach)"
}

/**
 * A RAW photo as a picture in standard colour, with its uncertainty; the numbers equal those of Python's
 * `camssf_colour.standard_picture`. Pixels are demosaiced, divided by the signal of a perfect white diffuser, and turned
 * into colour by the posterior over reflectance under the light of the photo.
 *
 * ```kotlin
 * fun develop(result: Recovered, photo: Mosaic, whiteArea: Region, out: OutputStream) {
 *     val (white) = RawRegion.measure(photo, listOf(whiteArea))
 *     val standardiser = Standardiser.of(result, Lamp.read("daylight"), Reference(white, reflectance = 0.9))
 *     standardiser.picture(photo).writePng(out)
 * }
 * ```
 *
 * Pixels are computed when they are asked for, some 2^16 at a time, and take some ten MB of heap, besides a mosaic that
 * the caller holds; a [PhotoSource] is read in bands of 8 MB. They run a model with ONNX Runtime. It may be passed
 * between threads, but one thread at a time may read it, and not the main one.
 */
public class StandardPicture internal constructor(
    private val parts: PictureParts,
    private val dark: PictureParts?,
    private val whiteSignal: WhiteSignal,

    /** The colour space of its numbers. */
    public val space: PictureSpace,

    /** Whether the photo's gain maps are applied. */
    public val lensShading: LensShading,
    private val lights: PictureLights,
) {
    init {
        if (lensShading == LensShading.APPLY) Shading.check(parts.facts)
        dark?.let { Alike.check(parts.facts, it.facts, "dark") }
    }

    /** Columns of the upright picture. */
    public val width: Int get() = parts.across

    /** Rows of the upright picture. */
    public val height: Int get() = parts.length

    /** The compared lamps with their weights; a named lamp is the only one. */
    public val lamps: List<WeighedLamp> get() = lights.lamps

    /** χ² of the reference's raw ratios under the most probable lamp; null if they were not used. */
    public val chiSquared: Double? get() = lights.chiSquared

    /** (3) raw signal of a perfect white diffuser, DN above black. */
    public val white: Rows get() = Rows(whiteSignal.raw, 3)

    /**
     * Whether a white or grey surface was measured. Else the white balance is the calibration's, and white is the level
     * where the photo saturates.
     */
    public val fromReference: Boolean get() = whiteSignal.fromReference

    override fun toString(): String = "StandardPicture(${parts.facts.name}, $width × $height, ${space.word}, $lamps)"

    /**
     * Computes the upright picture from its top, and its uncertainty.
     *
     * @throws CalibrationException the photo cannot be read, or its source gave another part than it was asked for.
     * @throws InterruptedException the thread is interrupted; the flag is cleared.
     */
    @Throws(InterruptedException::class)
    public fun strips(receiver: PictureStrips) {
        val starts = (0 until height step parts.step).toList()
        var top = 0
        try {
            for (start in if (parts.backwards) starts.reversed() else starts) {
                if (Thread.interrupted()) throw InterruptedException("The picture was interrupted.")
                val strip = PictureStrip(parts, dark, start, lensShading == LensShading.APPLY)
                val (pixels, uncertainty) = strip.run(whiteSignal, space, lights.table)
                receiver.take(top, strip.rows, pixels, uncertainty)
                top += strip.rows
            }
        } finally {
            parts.release()
            dark?.release()
        }
    }

    /**
     * Writes the picture as PNG, with the ICC profile of its space, and beside it its uncertainty as a PNG of 16 bits of
     * half the size. The streams stay open.
     *
     * @param picture receives the picture.
     * @param uncertainty receives its uncertainty, as of [PictureStrips.take]; null for none.
     * @param bits 16, or 8 for sRGB and Display P3.
     * @param description what both files say of themselves; "" for nothing.
     * @throws InvalidArgument another number of bits.
     * @throws CalibrationException the photo cannot be read, or its source gave another part than it was asked for.
     * @throws IOException by a stream.
     * @throws InterruptedException the thread is interrupted; the flag is cleared.
     */
    @JvmOverloads
    @Throws(IOException::class, InterruptedException::class)
    public fun writePng(
        picture: OutputStream,
        uncertainty: OutputStream? = null,
        bits: Int = 16,
        description: String = "",
    ): PictureShares {
        if (bits != 16 && !(bits == 8 && space.curved)) {
            throw InvalidArgument(
                "A picture of $bits bits in ${space.word} cannot be written as .png.",
                "Take 16 bits; 8 are for PNG in srgb or display-p3.",
            )
        }
        val marks = Marks()
        val about = listOf(LAYER, description).filter { it.isNotEmpty() }.joinToString(" ")
        PngWriter(picture, width, height, bits).use { pixels ->
            pixels.head(space.profile, description)
            val layer = uncertainty?.let { PngWriter(it, width / 2, height / 2, 16) }
            layer.use {
                layer?.head(null, about)
                strips { _, _, numbers, deviations ->
                    pixels.rows(numbers)
                    layer?.rows(deviations)
                    marks.count(deviations)
                }
                layer?.end()
            }
            pixels.end()
        }
        return marks.shares()
    }

    /** Counts the marks in the layer of uncertainty. */
    private class Marks {
        private var cells = 0L
        private var clipped = 0L
        private var far = 0L

        fun count(layer: ShortArray) {
            for (at in layer.indices step 3) {
                val least = (at..at + 2).minOf { layer[it].toInt() and 0xffff }
                if (least == CLIPPED) clipped++
                if (least == OUT_OF_REACH) far++
            }
            cells += layer.size / 3
        }

        fun shares() = PictureShares(clipped.toDouble() / cells, far.toDouble() / cells)
    }

    public companion object {
        /** Uncertainty of what a clipped sample has reached; it is white in the picture. */
        public const val CLIPPED: Int = 65535

        /** Uncertainty of a colour that no surface has under this light. */
        public const val OUT_OF_REACH: Int = 65534

        private const val LAYER =
            "Standard deviation of L*, a*, b* of a pixel, in 1/100, for blocks of 2 x 2 pixels; " +
                "$CLIPPED: clipped; $OUT_OF_REACH: no surface has this colour under this light."

        /**
         * Creates the picture of a photo without a white or grey reference: the white balance is the calibration's for
         * the lamp, whose errors count, and white is the level where the photo saturates. With a reference:
         * [Standardiser.picture].
         *
         * @param result from a calibration or [org.camssf.SavedResult.read].
         * @param lamp of the photo, by name, by kind or measured.
         * @param photo by the same camera, the whole of it; [PhotoSource.of] takes a mosaic in memory, too.
         * @param space of the picture's numbers.
         * @param lensShading APPLY multiplies the samples by the file's gain maps.
         * @throws InvalidArgument a light that is not named; a result without the light of its first photo; curves from
         *   which no colour can be computed; a photo of which only a part is there.
         * @throws FramesDiffer a photo of another camera than the result's.
         * @throws UnitDiffers the same, of two cameras of one model.
         * @throws UnsupportedRaw gain maps that cannot be applied.
         * @throws CalibrationException the photo cannot be read.
         * @throws RuntimeUnfit ONNX Runtime is missing, or of a version that reports its use.
         */
        @JvmStatic
        @JvmOverloads
        public fun of(
            result: Recovered,
            lamp: Lamp,
            photo: PhotoSource,
            space: PictureSpace = PictureSpace.SRGB,
            lensShading: LensShading = LensShading.AS_STORED,
        ): StandardPicture = of(ColourCamera.of(result), lamp, photo, space, lensShading)

        /**
         * As [of], for the camera of a passport, or of a result's text.
         *
         * @param result the excerpt that a passport holds, or the text of a result, from [CalibrationResult.toJson].
         * @throws InvalidArgument a refused or invalid result, and as [of].
         * @throws CalibrationException as [of].
         */
        @JvmStatic
        @JvmOverloads
        public fun read(
            result: String,
            lamp: Lamp,
            photo: PhotoSource,
            space: PictureSpace = PictureSpace.SRGB,
            lensShading: LensShading = LensShading.AS_STORED,
        ): StandardPicture = of(ColourCamera.parse(result), lamp, photo, space, lensShading)

        internal fun of(
            camera: ColourCamera,
            lamp: Lamp,
            photo: PhotoSource,
            space: PictureSpace,
            lensShading: LensShading,
        ): StandardPicture {
            val parts = PictureParts.of(photo)
            camera.camera.check(SignalSource(parts.facts, lensShading))
            val (white, light) = WhiteSignal.of(camera, lamp, parts.facts)
            val response = SurfaceResponse.of(camera, listOf(light), View(white = space.white))
            val lights = PictureLights(listOf(response), doubleArrayOf(1.0))
            return StandardPicture(parts, null, white, space, lensShading, lights)
        }
    }
}

/** The compared lights of a picture with their weights, and their table. */
internal class PictureLights(responses: List<SurfaceResponse>, weights: DoubleArray) {
    val lamps: List<WeighedLamp> =
        responses.mapIndexed { i, response -> WeighedLamp(response.names.single(), weights[i]) }.frozen()

    /** As of the most probable lamp. */
    val chiSquared: Double? = responses[weights.indices.maxByOrNull { weights[it] }!!].chiSquared
    val table: PictureTable = PictureTable(responses.map { LampContext(it) }, weights)
}
