package org.camssf.colour

import org.camssf.InvalidArgument
import org.camssf.photo.Facts
import org.camssf.photo.Held
import org.camssf.photo.Mosaic
import org.camssf.photo.PhotoSource
import org.camssf.photo.Region
import org.camssf.photo.fromApp

/**
 * A photo that is read in bands, along the order of its picture's rows; one band is in memory at a time.
 *
 * @property facts its metadata.
 */
internal class PictureParts private constructor(private val source: PhotoSource, val facts: Facts) {
    private var held: Mosaic? = null

    /** Whether the picture's rows are the sensor's columns. */
    val turned: Boolean get() = facts.origin.orientation > 4

    /** Whether the picture's first row is the sensor's last. */
    val backwards: Boolean get() = facts.origin.orientation in listOf(3, 4, 7, 8)

    /** Rows of the upright picture, and its columns. */
    val length: Int get() = if (turned) facts.width else facts.height
    val across: Int get() = if (turned) facts.height else facts.width

    /** Rows of a strip; even. */
    val step: Int get() = maxOf(2, STRIP / across / 2 * 2)

    /** Strips of a band. */
    private val strips get() = maxOf(1, BAND / (step.toLong() * across)).toInt()

    /**
     * The samples around a strip.
     *
     * @param start its first row, a multiple of [step].
     * @throws InvalidArgument the source gave another part than it was asked for.
     */
    fun around(start: Int): Mosaic {
        val first = start / step / strips * step * strips
        val last = minOf(first.toLong() + step * strips.toLong() + MARGIN, length.toLong()).toInt()
        val (from, to) = maxOf(first - MARGIN, 0) to last
        val part = if (turned) Region(from, 0, to, facts.height) else Region(0, from, facts.width, to)
        held?.let { if (holds(it, part)) return it }
        held = null // release it before the next one is read
        val mosaic = fromApp(facts.name) { source.read(part).also { it.facts } }
        if (!holds(mosaic, part)) throw unfit(mosaic)
        return mosaic.also { held = it }
    }

    /** Releases samples that can be read again. */
    fun release() {
        held = null
    }

    private fun holds(mosaic: Mosaic, part: Region) = mosaic.region.let {
        it.left <= part.left && it.top <= part.top && it.right >= part.right && it.bottom >= part.bottom
    }

    private fun unfit(mosaic: Mosaic) =
        InvalidArgument("${mosaic.name}: $mosaic is only a part of the photo.", "Read the whole photo.")

    companion object {
        /** Pixels that are computed at a time. */
        private const val STRIP = 1 shl 16

        /** Largest number of samples read at once: 8 MB. */
        private const val BAND = 4L shl 20

        /** Rows that a strip needs beyond its own: two of neighbours, and two more where the edge mirrors them. */
        private const val MARGIN = 4

        /**
         * @throws InvalidArgument a mosaic of a part of a photo, or of a single row or column.
         * @throws org.camssf.CalibrationException the photo cannot be read.
         */
        fun of(source: PhotoSource): PictureParts {
            val first = fromApp(null) { source.read(Region(0, 0, 2, 2)).also { it.facts } }
            val parts = PictureParts(source, first.facts)
            if (source is Held && !parts.holds(first, parts.facts.area)) throw parts.unfit(first)
            if (minOf(first.width, first.height) < 2) {
                throw InvalidArgument(
                    "${first.name} has ${first.width} × ${first.height} samples.",
                    "Give a photo of 2 × 2 or more.",
                )
            }
            return parts
        }
    }
}
