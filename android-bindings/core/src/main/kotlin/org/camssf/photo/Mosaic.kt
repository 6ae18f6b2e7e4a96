package org.camssf.photo

import org.camssf.InvalidArgument
import org.camssf.Rows
import org.camssf.frozen

/**
 * One RAW photo, neither demosaiced nor white-balanced. Pose and pixel positions refer to the active area.
 *
 * Its small arrays are copied in and out, so it cannot be changed through them. The samples are not copied, because
 * they are large (24 MB for 12 megapixels): the caller hands over the array and must not write to it afterwards. Safe
 * to pass between threads.
 *
 * @property origin of the photo: file, camera, exposure.
 * @property width columns of the active area.
 * @property height rows of the active area.
 * @property region the part of the active area that `samples` covers; the whole area unless a part was requested.
 * @property samples (region.height, region.width) unsigned 16-bit DN, row-major, after the file's LinearizationTable,
 *   before black subtraction; see [get]. The mosaic's own array, not a copy: do not write to it.
 * @property sensor colour filters, levels and noise.
 * @property corrections that the file describes; none is applied to the samples.
 * @property colours the file's colour metadata.
 * @throws InvalidArgument inconsistent sizes, a colour filter pattern that is not Bayer's, an invalid level or
 *   orientation.
 */
public class Mosaic(
    public val origin: Origin,
    public val width: Int,
    public val height: Int,
    public val region: Region,
    public val samples: ShortArray,
    public val sensor: Sensor,
    public val corrections: Corrections = Corrections(),
    public val colours: Colours = Colours(),
) {
    /**
     * Origin of a photo: file, camera and exposure.
     *
     * @property name name of the file without its path, for messages and results.
     * @property make of the camera, "" if unknown.
     * @property model of the camera, "" if unknown.
     * @property exposure exposure time, s; null if unknown.
     * @property iso sensitivity; null if unknown.
     * @property orientation the TIFF orientation of the display, 1 to 8 (pose and samples ignore it).
     * @property sha256 SHA-256 of the file, lower-case hex; "" if there was no file.
     * @param camera the physical camera and its lens.
     * @property captured capture time, ISO 8601, with the offset from UTC if the file has one; "" if unknown.
     * @property uniqueModel the DNG's UniqueCameraModel, by which raw converters identify the camera; "" if unknown.
     */
    public class Origin @JvmOverloads constructor(
        public val name: String,
        public val make: String = "",
        public val model: String = "",
        public val exposure: Double? = null,
        public val iso: Double? = null,
        public val orientation: Int = 1,
        public val sha256: String = "",
        camera: PhysicalCamera = PhysicalCamera(),
        public val captured: String = "",
        public val uniqueModel: String = "",
    ) {
        /** The physical camera and its lens. */
        public val camera: PhysicalCamera = camera.checked(make, model)

        override fun toString(): String = "Origin($name, $make $model, exposure=$exposure, iso=$iso, $camera)"
    }

    /**
     * Meaning of the samples: colour filters, levels and noise.
     *
     * @property cfa colours of the 2 × 2 cell at the active area's corner: RGGB, GRBG, GBRG or BGGR.
     * @param black (2, 2) row-major black level of each position of that cell, DN; copied.
     * @property white the white level (saturation), DN.
     * @param noiseProfile pairs (S, O), one pair or one per plane: variance = S v + O for v from 0 to 1; or null;
     *   copied.
     * @param maskedAreas shielded parts of the sensor, in samples of the stored picture (not the active area);
     *   copied.
     */
    public class Sensor @JvmOverloads constructor(
        public val cfa: String,
        black: DoubleArray,
        public val white: Double,
        noiseProfile: DoubleArray? = null,
        maskedAreas: List<Region> = emptyList(),
    ) {
        internal val sharedBlack: DoubleArray = black.copyOf()

        override fun toString(): String = "Sensor($cfa, black=${sharedBlack.joinToString()}, white=$white)"

        /** (2, 2) row-major black level of each position of the cell, DN. */
        public val black: Rows get() = Rows(sharedBlack, 2, 2)

        /** Pairs (S, O), or null. */
        public val noiseProfile: Rows? = noiseProfile?.let { Rows(it.copyOf(), it.size / 2, 2) }

        /** Shielded parts of the sensor, in samples of the stored picture. */
        public val maskedAreas: List<Region> = maskedAreas.frozen()
    }

    /**
     * Corrections that the file describes. None is applied to the samples.
     *
     * @param gainMaps lens-shading maps; copied.
     * @param badPixels lists of bad samples, not repaired; copied.
     */
    public class Corrections @JvmOverloads constructor(
        gainMaps: List<GainMap> = emptyList(),
        badPixels: List<BadPixels> = emptyList(),
    ) {
        override fun toString(): String = "Corrections(gainMaps=$gainMaps, badPixels=$badPixels)"

        /** Lens-shading maps of the file. */
        public val gainMaps: List<GainMap> = gainMaps.frozen()

        /** Lists of bad samples. */
        public val badPixels: List<BadPixels> = badPixels.frozen()
    }

    /**
     * The file's colour metadata; arrays are copied.
     *
     * @param colorMatrix1 (3, 3) row-major XYZ to camera, or null.
     * @param colorMatrix2 (3, 3) row-major XYZ to camera, or null.
     * @param asShotNeutral (3) the camera's white, or null.
     * @param asShotWhiteXY (2) the same as chromaticity x, y, or null.
     * @param colourMatrices the matrices with the camera's own calibration and gains, each with its illuminant.
     * @param matricesLeftOut which matrices of the file are not among them, and why; "" if none.
     */
    public class Colours @JvmOverloads constructor(
        colorMatrix1: DoubleArray? = null,
        colorMatrix2: DoubleArray? = null,
        asShotNeutral: DoubleArray? = null,
        asShotWhiteXY: DoubleArray? = null,
        colourMatrices: List<ColourMatrix> = emptyList(),
        matricesLeftOut: String = "",
    ) {
        override fun toString(): String =
            "Colours(asShotNeutral=${this.asShotNeutral?.joinToString()}, colourMatrices=${this.colourMatrices})"

        /** (3, 3) row-major XYZ to camera, or null. */
        public val colorMatrix1: Rows? = colorMatrix1?.let { Rows(it.copyOf(), 3, 3) }

        /** (3, 3) row-major XYZ to camera, or null. */
        public val colorMatrix2: Rows? = colorMatrix2?.let { Rows(it.copyOf(), 3, 3) }

        /** (3) the camera's white, or null. */
        public val asShotNeutral: Rows? = asShotNeutral?.let { Rows(it.copyOf(), 3) }

        /** (2) the same as chromaticity x, y, or null. */
        public val asShotWhiteXY: Rows? = asShotWhiteXY?.let { Rows(it.copyOf(), 2) }

        private val contradicted =
            asShotNeutral != null && asShotNeutral.all { it > 0 } &&
                ColourMatrix.noLight(asShotNeutral, colourMatrices)

        /**
         * The matrices with the camera's own calibration and gains, each with its illuminant; none if they make
         * AsShotNeutral the white of no lamp.
         */
        public val colourMatrices: List<ColourMatrix> = if (contradicted) emptyList() else colourMatrices.frozen()

        /** Which matrices of the file are not among [colourMatrices], and why; "" if none. */
        public val matricesLeftOut: String = listOfNotNull(
            matricesLeftOut.ifEmpty { null },
            "the colour matrices were left out: with them AsShotNeutral is the white of no lamp".takeIf {
                contradicted
            },
        ).joinToString("; ")
    }

    /** The metadata, without the samples. */
    internal val facts: Facts get() = Facts(origin, width, height, sensor, corrections, colours)

    /** Name of the file, for messages; as in [origin]. */
    public val name: String get() = origin.name

    init {
        val whole = region.left >= 0 && region.top >= 0 && region.right <= width && region.bottom <= height
        if (!whole || region.width < 1 || region.height < 1) {
            throw InvalidArgument("$region is no part of $width × $height samples.", "Ask for a part of the photo.")
        }
        if (samples.size.toLong() != region.width.toLong() * region.height) {
            throw InvalidArgument("$name: ${samples.size} samples for $region.", "Give one sample for each place.")
        }
        if (sensor.cfa !in CFA_ORDERS || sensor.sharedBlack.size != 4) {
            throw InvalidArgument(
                "$name: colour filters ${sensor.cfa} and ${sensor.sharedBlack.size} black levels.",
                "Give one of the orders ${CFA_ORDERS.joinToString()} and four black levels.",
            )
        }
        if (!(sensor.white > 0 && sensor.white.isFinite()) || !sensor.sharedBlack.all { it.isFinite() }) {
            throw InvalidArgument(
                "$name: a white level of ${sensor.white} over black levels of ${sensor.sharedBlack.joinToString()}.",
                "Give them in DN, as the sensor's characteristics or the file have them.",
            )
        }
        if (origin.orientation !in 1..8) {
            val found = "$name: an orientation of ${origin.orientation}."
            throw InvalidArgument(found, "Give TIFF's, 1 to 8; 1 where unknown.")
        }
    }

    /**
     * The sample at column x and row y of the active area, 0 to 65535.
     *
     * @throws InvalidArgument outside [region].
     */
    public operator fun get(x: Int, y: Int): Int {
        if (!region.contains(x, y)) {
            throw InvalidArgument("$name: the sample ($x, $y) lies outside $region.", "Read that part too.")
        }
        return samples[(y - region.top) * region.width + x - region.left].toInt() and 0xffff
    }

    override fun toString(): String = "Mosaic($name, $width × $height, ${sensor.cfa}, $region)"

    /** The colour filter over column x and row y of the active area: 'R', 'G' or 'B'. */
    public fun color(x: Int, y: Int): Char = sensor.cfa[(y and 1) * 2 + (x and 1)]

    public companion object {
        /** The Bayer orders that camssf reads. */
        @JvmField
        public val CFA_ORDERS: List<String> = listOf("RGGB", "GRBG", "GBRG", "BGGR")
    }
}
