package org.camssf.photo

import org.camssf.InvalidArgument

/**
 * A rectangle of samples; `right` and `bottom` are exclusive.
 *
 * @property left first column.
 * @property top first row.
 * @property right one behind the last column.
 * @property bottom one behind the last row.
 */
public data class Region(
    public val left: Int,
    public val top: Int,
    public val right: Int,
    public val bottom: Int,
) {
    /** Columns. */
    public val width: Int get() = right - left

    /** Rows. */
    public val height: Int get() = bottom - top

    /** Whether the sample lies inside. */
    public fun contains(x: Int, y: Int): Boolean = x in left until right && y in top until bottom
}

/**
 * One RAW photo, neither demosaiced nor white-balanced. Immutable by convention: do not write into its arrays.
 *
 * @property name of the file, for messages and results; no path.
 * @property width columns of the active area; pose and pixel positions refer to the active area.
 * @property height rows of the active area.
 * @property region the part of the active area whose samples are here: all of it unless a part was asked for.
 * @property samples (region.height, region.width) unsigned 16-bit DN, row-major, after the file's LinearizationTable,
 *   before black subtraction; see [get].
 * @property cfa colours of the 2 × 2 cell at the active area's corner: RGGB, GRBG, GBRG or BGGR.
 * @property black (2, 2) row-major black level of each position of that cell, DN.
 * @property white the white level (saturation), DN.
 * @property make of the camera, "" where unknown.
 * @property model of the camera, "" where unknown.
 * @property exposure seconds, null where unknown.
 * @property iso sensitivity, null where unknown.
 * @property orientation the TIFF orientation of the display, 1 to 8 (pose and samples ignore it).
 * @property gainMaps lens-shading maps of the file, not applied to the samples.
 * @property badPixels lists of bad samples, not repaired.
 * @property unknownOpcodes numbers of the file's other operations that it does not call optional; none is applied.
 * @property colorMatrix1 (3, 3) row-major XYZ to camera, or null.
 * @property colorMatrix2 (3, 3) row-major XYZ to camera, or null.
 * @property asShotNeutral (3) the camera's white, or null.
 * @property asShotWhiteXY (2) the same as chromaticity x, y, or null.
 * @property noiseProfile pairs (S, O), one pair or one a plane: variance = S v + O for v from 0 to 1; or null.
 * @property maskedAreas shielded parts of the sensor, in samples of the stored picture (not the active area).
 * @property sha256 of the file, lower-case hex; "" where there was no file.
 * @property neutrals the camera's white under the light that each colour matrix was made for.
 */
public class Mosaic(
    public val name: String,
    public val width: Int,
    public val height: Int,
    public val region: Region,
    public val samples: ShortArray,
    public val cfa: String,
    public val black: DoubleArray,
    public val white: Double,
    public val make: String = "",
    public val model: String = "",
    public val exposure: Double? = null,
    public val iso: Double? = null,
    public val orientation: Int = 1,
    public val gainMaps: List<GainMap> = emptyList(),
    public val badPixels: List<BadPixels> = emptyList(),
    public val unknownOpcodes: List<Int> = emptyList(),
    public val colorMatrix1: DoubleArray? = null,
    public val colorMatrix2: DoubleArray? = null,
    public val asShotNeutral: DoubleArray? = null,
    public val asShotWhiteXY: DoubleArray? = null,
    public val noiseProfile: DoubleArray? = null,
    public val maskedAreas: List<Region> = emptyList(),
    public val sha256: String = "",
    public val neutrals: List<Neutral> = emptyList(),
) {
    init {
        val whole = region.left >= 0 && region.top >= 0 && region.right <= width && region.bottom <= height
        if (!whole || region.width < 1 || region.height < 1) {
            throw InvalidArgument("$region is no part of $width × $height samples.", "Ask for a part of the photo.")
        }
        if (samples.size.toLong() != region.width.toLong() * region.height) {
            throw InvalidArgument("$name: ${samples.size} samples for $region.", "Give one sample for each place.")
        }
        if (cfa !in CFA_ORDERS || black.size != 4) {
            throw InvalidArgument(
                "$name: colour filters $cfa and ${black.size} black levels.",
                "Give one of the orders ${CFA_ORDERS.joinToString()} and four black levels.",
            )
        }
        if (!(white > 0 && white.isFinite()) || !black.all { it.isFinite() }) {
            throw InvalidArgument(
                "$name: a white level of $white over black levels of ${black.joinToString()}.",
                "Give them in DN, as the sensor's characteristics or the file have them.",
            )
        }
        if (orientation !in 1..8) {
            throw InvalidArgument("$name: an orientation of $orientation.", "Give TIFF's, 1 to 8; 1 where unknown.")
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

    /** The colour filter over column x and row y of the active area: 'R', 'G' or 'B'. */
    public fun color(x: Int, y: Int): Char = cfa[(y and 1) * 2 + (x and 1)]

    public companion object {
        /** The Bayer orders that camssf reads. */
        @JvmField
        public val CFA_ORDERS: List<String> = listOf("RGGB", "GRBG", "GBRG", "BGGR")
    }
}

/**
 * The camera's white under a light, as the file's colour matrix tells it.
 *
 * @property illuminant the light, an Exif LightSource code: 17 A, 18 B, 19 C, 20 D55, 21 D65, 22 D75, 23 D50.
 * @property white (3) R, G, B, green 1.
 */
public class Neutral(public val illuminant: Int, public val white: DoubleArray) {
    public companion object {
        /** CIE 1931 x, y of Exif's LightSource codes: A, B, C, D55, D65, D75, D50 (CIE 15). */
        private val WHITE_POINTS = mapOf(
            17 to doubleArrayOf(0.44758, 0.40745),
            18 to doubleArrayOf(0.34842, 0.35161),
            19 to doubleArrayOf(0.31006, 0.31616),
            20 to doubleArrayOf(0.33243, 0.34744),
            21 to doubleArrayOf(0.31272, 0.32903),
            22 to doubleArrayOf(0.29903, 0.31488),
            23 to doubleArrayOf(0.34567, 0.35851),
        )

        /**
         * Camera white = gains · calibration · colour matrix · XYZ of the light (DNG 1.7, chapter 6); null for another
         * light than those above, or where a colour is lost.
         *
         * @param matrix (3, 3) row-major XYZ to camera.
         * @param calibration (3, 3) row-major of the single camera, null for the identity.
         * @param gains (3) analogue gains.
         */
        @JvmStatic
        @JvmOverloads
        public fun of(
            illuminant: Int,
            matrix: DoubleArray,
            calibration: DoubleArray? = null,
            gains: DoubleArray = doubleArrayOf(1.0, 1.0, 1.0),
        ): Neutral? {
            val (x, y) = WHITE_POINTS[illuminant] ?: return null
            val plain = times(matrix, doubleArrayOf(x / y, 1.0, (1.0 - x - y) / y))
            val seen = if (calibration == null) plain else times(calibration, plain)
            val white = DoubleArray(3) { gains[it] * seen[it] }
            val sound = white.all { !it.isNaN() && !it.isInfinite() } && white.min() > 1e-3 * white.max()
            return if (sound) Neutral(illuminant, DoubleArray(3) { white[it] / white[1] }) else null
        }

        private fun times(matrix: DoubleArray, vector: DoubleArray): DoubleArray =
            DoubleArray(3) { row -> (0..2).sumOf { matrix[3 * row + it] * vector[it] } }
    }
}

/**
 * A lens-shading map (DNG opcode 9): gains on a grid over one or more planes or CFA positions.
 *
 * It applies to the samples (y, x) with `y = top, top + rowPitch, ... < bottom` and
 * `x = left, left + columnPitch, ... < right`, after black subtraction, the gain interpolated between the points.
 *
 * @property list the opcode list that holds it: 1 acts before linearisation, on the stored picture; 2 on the mosaic's
 *   active area; 3 on the demosaiced picture.
 * @property area the samples it applies to.
 * @property plane first plane; a mosaic has plane 0, list 3 has R, G, B.
 * @property planes number of planes.
 * @property rowPitch step between rows.
 * @property columnPitch step between columns.
 * @property pointsV rows of the grid.
 * @property pointsH columns of the grid.
 * @property spacingV distance of the grid's rows, in parts of the picture's height.
 * @property spacingH distance of the grid's columns, in parts of the picture's width.
 * @property originV place of the first row, in parts of the picture's height.
 * @property originH place of the first column, in parts of the picture's width.
 * @property mapPlanes gains a point; plane i has the entry min(i, mapPlanes - 1).
 * @property gains (pointsV, pointsH, mapPlanes) row-major.
 */
public class GainMap(
    public val list: Int,
    public val area: Region,
    public val plane: Int,
    public val planes: Int,
    public val rowPitch: Int,
    public val columnPitch: Int,
    public val pointsV: Int,
    public val pointsH: Int,
    public val spacingV: Double,
    public val spacingH: Double,
    public val originV: Double,
    public val originH: Double,
    public val mapPlanes: Int,
    public val gains: FloatArray,
)

/**
 * Samples that the file calls bad (DNG opcodes 4 and 5).
 *
 * @property list the opcode list that holds it: 1 refers to the stored picture, 2 to the active area.
 * @property constant opcode 4: every sample of just this value is bad; null for a list of places.
 * @property points opcode 5: (n, 2) row and column of single samples, else empty.
 * @property areas opcode 5: rectangles.
 */
public class BadPixels(
    public val list: Int,
    public val constant: Int?,
    public val points: IntArray,
    public val areas: List<Region>,
)
