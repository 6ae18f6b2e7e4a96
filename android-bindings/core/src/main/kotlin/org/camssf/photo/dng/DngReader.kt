package org.camssf.photo.dng

import org.camssf.InvalidArgument
import org.camssf.NotSensorRaw
import org.camssf.OutOfMemory
import org.camssf.RawError
import org.camssf.Refusal
import org.camssf.UnreadableRaw
import org.camssf.UnsupportedRaw
import org.camssf.checkInterrupt
import org.camssf.model.Sha256
import org.camssf.photo.Facts
import org.camssf.photo.Mosaic
import org.camssf.photo.PhysicalCamera
import org.camssf.photo.Region
import org.camssf.photo.Rows
import org.camssf.photo.outside

/**
 * Reads a DNG as a mosaic: the sensor's samples as stored, and the file's metadata.
 *
 * It supports classic TIFF of either byte order; colour filter mosaics in strips or tiles; 8 to 16 bits;
 * uncompressed, lossless JPEG and deflate. Every number in the file is checked: a damaged or hostile file raises a
 * [RawError], and time and memory are bounded by its length. Stateless; callable from any thread.
 */
public object DngReader {
    /**
     * Reads the raw frame of a DNG file.
     *
     * The samples are those of the active area (tag 50829), after the file's LinearizationTable; black and white
     * level are on that scale. A black level with a repeat pattern larger than 2 × 2, or with row and column deltas
     * (tags 50713 to 50716), is averaged for each cell position.
     *
     * Threads: any but the main one.
     *
     * @param source stays open; the caller closes it. It is read by one thread.
     * @param region null for all; else decode only this part of the active area, clipped to it, that is, only the
     *   strips and tiles that it touches. Damage in others is then not detected.
     * @throws UnreadableRaw truncated, damaged, or not a raw file at all.
     * @throws UnsupportedRaw an intact raw file that is no DNG, or a DNG in a form that camssf does not read.
     * @throws NotSensorRaw LinearRaw, that is, already demosaiced.
     * @throws OutOfMemory the samples do not fit into the free memory.
     * @throws InvalidArgument `region` is empty or lies outside the active area.
     * @throws InterruptedException the thread is interrupted; the flag is cleared.
     */
    @JvmStatic
    @Throws(InterruptedException::class)
    public fun read(source: DngSource, region: Region?): Mosaic = bounded(source, region) {
        val head = Head(Tiff(source), region)
        val window = Window(head.wanted, head.table)
        head.decode(window)
        head.facts().mosaic(head.part, window.samples)
    }

    /** As the other `read`: the whole active area. */
    @JvmStatic
    @Throws(InterruptedException::class)
    public fun read(source: DngSource): Mosaic = read(source, null)

    /**
     * The metadata that [read] returns, without the samples.
     *
     * @param region as in [read]: at least a part of it must be inside the photo.
     */
    internal fun facts(source: DngSource, region: Region?): Facts =
        bounded(source, region) { Head(Tiff(source), region).facts() }

    /** Passes the samples of a part to `rows`, each once, in the file's order; none is kept. */
    internal fun scan(source: DngSource, region: Region, rows: Rows) = bounded(source, region) {
        val head = Head(Tiff(source), region)
        val area = head.picture.area
        head.decode(
            Window(head.wanted, head.table) { y, x, count, samples, at ->
                rows.take(y - area.top, x - area.left, count, samples, at)
            },
        )
    }

    private inline fun <T> bounded(source: DngSource, region: Region?, work: () -> T): T = try {
        work()
    } catch (error: OutOfMemoryError) {
        throw Refusal.of(
            if (region == null) "out_of_memory.whole_photo" else "out_of_memory.part", "file" to source.name,
            cause = error,
        )
    }

    /** The parsed file and its requested part. */
    private class Head(val tiff: Tiff, region: Region?) {
        private val raw = rawDirectory(tiff)
        val picture = storedPicture(tiff, raw)
        private val area = picture.area
        private val cfa = cfa(tiff, raw)
        private val black = black(tiff, raw, area)
        private val white = white(tiff, raw, picture.bits)
        private val opcodes = Opcodes(tiff, raw)
        val part = part(tiff, region, area)
        val table = linearization(tiff, raw)

        /** [part] in the stored picture. */
        val wanted =
            Region(area.left + part.left, area.top + part.top, area.left + part.right, area.top + part.bottom)

        fun decode(window: Window) = decode(tiff, picture, window, before11(tiff))

        /** The metadata; reads the whole file once for its hash. */
        fun facts(): Facts {
            val first = tiff.main[0]
            val exif = tiff.exif()
            val orientation = tiff.one(first, Tag.ORIENTATION, 1)
            val origin = Mosaic.Origin(
                name = tiff.name,
                make = tiff.text(first, Tag.MAKE),
                model = tiff.text(first, Tag.MODEL).ifEmpty { tiff.text(first, Tag.UNIQUE_MODEL) },
                exposure = positive(tiff, listOf(first, raw, exif), Tag.EXPOSURE),
                iso = positive(tiff, listOf(first, raw, exif), Tag.ISO),
                orientation = if (orientation in 1..8) orientation.toInt() else 1,
                sha256 = sha256(tiff),
                camera = PhysicalCamera(
                    serial = tiff.text(exif, Tag.BODY_SERIAL).ifEmpty { tiff.text(first, Tag.CAMERA_SERIAL) },
                    lens = tiff.text(exif, Tag.LENS_MODEL),
                    focalLength = positive(tiff, listOf(exif, first), Tag.FOCAL_LENGTH),
                    aperture = positive(tiff, listOf(exif, first), Tag.F_NUMBER),
                    activeArea = area,
                ),
                captured = captured(tiff, exif),
                uniqueModel = tiff.text(first, Tag.UNIQUE_MODEL),
            )
            val neutral = finite(tiff, first, Tag.NEUTRAL, 3)?.takeIf { it.all { value -> value > 0 } }
            val (matrices, leftOut) = colourMatrices(tiff, first)
            val colours = Mosaic.Colours(
                colorMatrix1 = finite(tiff, first, Tag.COLOR_MATRIX_1, 9),
                colorMatrix2 = finite(tiff, first, Tag.COLOR_MATRIX_2, 9),
                asShotNeutral = neutral,
                asShotWhiteXY = finite(tiff, first, Tag.WHITE_XY, 2)?.takeIf { it.all { value -> value > 0 } },
                colourMatrices = matrices,
                matricesLeftOut = leftOut,
            )
            return Facts(
                origin,
                area.width,
                area.height,
                Mosaic.Sensor(cfa, black, white, noiseProfile(tiff, raw), maskedAreas(tiff, raw, picture)),
                Mosaic.Corrections(opcodes.gainMaps, opcodes.badPixels),
                colours,
            )
        }
    }

    private fun part(tiff: Tiff, region: Region?, area: Region): Region {
        if (region == null) return Region(0, 0, area.width, area.height)
        if (region.left >= region.right || region.top >= region.bottom) {
            throw InvalidArgument("The part asked of ${tiff.name} is empty.", "Ask for one sample at least.")
        }
        val part = Region(
            maxOf(region.left, 0), maxOf(region.top, 0),
            minOf(region.right, area.width), minOf(region.bottom, area.height),
        )
        if (part.width < 1 || part.height < 1) throw outside(tiff.name, area.width, area.height)
        return part
    }

    /** True for DNG 1.0, which writes 16 more bits after category 16 of lossless JPEG. */
    private fun before11(tiff: Tiff): Boolean = tiff.raw(tiff.main[0], Tag.DNG_VERSION, 2).getOrElse(1) { 0 } < 1

    private fun sha256(tiff: Tiff): String {
        val hash = Sha256()
        val chunk = ByteArray(1 shl 16)
        var at = 0L
        while (at < tiff.size) {
            checkInterrupt()
            val count = minOf(tiff.size - at, chunk.size.toLong()).toInt()
            tiff.read(at, chunk, 0, count)
            hash.add(chunk, 0, count)
            at += count
        }
        return hash.hex()
    }
}
