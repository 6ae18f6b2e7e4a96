package org.camssf.photo

import org.camssf.InvalidArgument
import org.camssf.model.Sha256

/**
 * Receives samples of a photo in the order of reading: `count` samples of row y of the active area, from column x on,
 * in `samples` from index `at`.
 */
internal fun interface Rows {
    fun take(y: Int, x: Int, count: Int, samples: ShortArray, at: Int)
}

/** Access to a photo during measurement: its metadata, and its samples, which can be read repeatedly and in parts. */
internal interface Reading {
    /** Metadata; the first call may read the photo. */
    val facts: Facts

    /** SHA-256 of the file or, if there is none (Camera2), of the samples; lower-case hex. */
    val sha256: String

    /**
     * Passes every sample of `region` to `rows` exactly once, in any order.
     *
     * @throws InvalidArgument the region is not inside the photo.
     */
    fun scan(region: Region, rows: Rows)

    /** Releases samples that can be read again. */
    fun release()

    companion object {
        /**
         * Largest number of samples read at once: 24 MB, a photo of 12 megapixels. A larger part is read in bands, or
         * row by row if the source supports it.
         */
        const val PIECE = 12L shl 20

        /**
         * Opens a photo in the way that suits its source.
         *
         * @param region the only part that will be read; it may extend beyond the photo.
         * @param watch called for every row; it throws to end a cancelled scan.
         * @param twice true if it is scanned twice, for the pose and for the patches; a small photo then stays in
         *   memory in between.
         */
        fun of(source: PhotoSource, region: Region, twice: Boolean, watch: () -> Unit): Reading {
            val reading = when {
                source is Held -> Whole(source.mosaic)
                source is ByRows && !(twice && size(region) <= PIECE) -> source.rows(region)
                else -> Banded(source, region, twice)
            }
            return Watched(reading, watch)
        }

        private fun size(region: Region): Long = region.width.toLong() * region.height
    }
}

private class Watched(private val reading: Reading, private val watch: () -> Unit) : Reading by reading {
    override fun scan(region: Region, rows: Rows) = reading.scan(region) { y, x, count, samples, at ->
        watch()
        rows.take(y, x, count, samples, at)
    }
}

/** A photo in memory. */
internal class Held(val mosaic: Mosaic) : PhotoSource {
    override fun read(region: Region?): Mosaic = mosaic
}

/** A source that can pass on a photo's rows while they are decoded. */
internal interface ByRows : PhotoSource {
    /** @param region the part that will be read; it may extend beyond the photo. */
    fun rows(region: Region): Reading
}

/** A mosaic in memory as a [Reading]; it is not released here. */
internal class Whole(private val mosaic: Mosaic) : Reading {
    override val facts: Facts get() = mosaic.facts
    override val sha256: String by lazy {
        mosaic.origin.sha256.ifEmpty { Sha256().add(mosaic, mosaic.region).hex() }
    }

    override fun scan(region: Region, rows: Rows) = mosaic.give(region, rows)

    override fun release() = Unit
}

/**
 * Reads any source in bands of whole rows, one band in memory at a time.
 *
 * @param eager true if the first band is needed in any case: the metadata then come from it and not from a strip of
 *   two rows.
 * @param piece largest number of samples of a band, which has at least two rows.
 */
internal class Banded(
    private val source: PhotoSource,
    private val region: Region,
    private val eager: Boolean,
    piece: Long = Reading.PIECE,
) : Reading {
    private val height = (piece / maxOf(region.width, 1)).toInt().coerceAtLeast(2) / 2 * 2
    private var known: Facts? = null
    private var band: Mosaic? = null
    private var number = -1

    override val facts: Facts
        get() = known ?: (if (eager) band(0) else read(strip())).facts.also { known = it }

    private fun strip() = Region(region.left, region.top, region.right, minOf(region.top + 2, region.bottom))

    override val sha256: String by lazy {
        facts.origin.sha256.ifEmpty {
            val all = facts.clipped(region)
            val one = band(0)
            // If the source returned more than requested, the hash covers everything that it returned.
            if (one.region.height >= all.height) {
                Sha256().add(one, one.region).hex()
            } else {
                Sha256().also { hash -> each(all) { mosaic, part -> hash.add(mosaic, part) } }.hex()
            }
        }
    }

    override fun scan(region: Region, rows: Rows) = each(region) { mosaic, part -> mosaic.give(part, rows) }

    private fun each(region: Region, use: (Mosaic, Region) -> Unit) {
        var top = region.top
        while (top < region.bottom) {
            val at = (top - this.region.top) / height
            val bottom = minOf(this.region.top + (at + 1) * height, region.bottom)
            use(band(at), Region(region.left, top, region.right, bottom))
            top = bottom
        }
    }

    private fun band(at: Int): Mosaic {
        band?.let { if (at == number) return it }
        band = null // release it before the next one is read
        val top = region.top + at * height
        val bottom = top + minOf(height, region.bottom - top)
        val found = read(Region(region.left, top, region.right, bottom))
        known = found.facts
        number = at
        band = found
        return found
    }

    /** `facts` is read here, so that what a source in Java gives instead of a photo, null, fails here too. */
    private fun read(part: Region): Mosaic =
        fromApp(null) { source.read(part).also { it.facts } }

    override fun release() {
        band = null
    }
}

/** Adds the samples of a part, row by row. */
internal fun Sha256.add(mosaic: Mosaic, part: Region): Sha256 {
    mosaic.give(part) { _, _, count, samples, at -> add(samples, at, count) }
    return this
}

/** Passes the rows of a part to `rows`. */
internal fun Mosaic.give(part: Region, rows: Rows) {
    val last = part.right - 1 to part.bottom - 1
    for ((x, y) in listOf(part.left to part.top, last)) {
        if (!region.contains(x, y)) {
            throw InvalidArgument("$name: the sample ($x, $y) lies outside $region.", "Read that part too.")
        }
    }
    for (y in part.top until part.bottom) {
        rows.take(y, part.left, part.width, samples, (y - region.top) * region.width + part.left - region.left)
    }
}
