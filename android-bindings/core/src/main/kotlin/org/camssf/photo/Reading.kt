package org.camssf.photo

import org.camssf.InvalidArgument
import java.security.MessageDigest

/** Takes samples of a photo as they come: `count` of row y of the active area, from column x on, `samples` from `at`. */
internal fun interface Rows {
    fun take(y: Int, x: Int, count: Int, samples: ShortArray, at: Int)
}

/** One photo while it is measured: its facts, and its samples as often as they are wanted, never all at once. */
internal interface Reading {
    /** What the photo says; the first call may read it. */
    val facts: Facts

    /** Of the file or, where there was none (Camera2), of the samples; lower-case hex. */
    val sha256: String

    /**
     * Gives every sample of `region`, each once, in any order.
     *
     * @throws InvalidArgument the photo has no such part.
     */
    fun scan(region: Region, rows: Rows)

    /** Lets go of samples that could be read again. */
    fun release()

    companion object {
        /**
         * Samples that are read in one piece at most: 24 MB, a photo of 12 megapixels. What is larger is read band by
         * band, or row by row where the source can.
         */
        const val PIECE = 12L shl 20

        /**
         * A photo as its source allows.
         *
         * @param region that will be looked at, and no other; it may reach beyond the photo.
         * @param watch called with every row: ends a scan that nobody waits for any more.
         * @param twice it is scanned for the pose and for the patches: what is small is kept in between.
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

/** A photo that is in memory. */
internal class Held(val mosaic: Mosaic) : PhotoSource {
    override fun read(region: Region?): Mosaic = mosaic
}

/** A source that can give a photo's rows as they are decoded. */
internal interface ByRows : PhotoSource {
    /** @param region that will be looked at; it may reach beyond the photo. */
    fun rows(region: Region): Reading
}

/** A mosaic as [Reading]; nobody lets go of it here. */
internal class Whole(private val mosaic: Mosaic) : Reading {
    override val facts: Facts get() = mosaic.facts
    override val sha256: String by lazy {
        mosaic.sha256.ifEmpty { Hash().also { it.add(mosaic, mosaic.region) }.hex() }
    }

    override fun scan(region: Region, rows: Rows) = mosaic.give(region, rows)

    override fun release() = Unit
}

/**
 * Any source: read in bands of whole rows, one at a time.
 *
 * @param eager its first band is wanted anyway: the facts are taken from it, and not from two rows.
 * @param piece samples of a band at most, but two rows at least.
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
        get() = known ?: (if (eager) band(0) else source.read(strip())).facts.also { known = it }

    private fun strip() = Region(region.left, region.top, region.right, minOf(region.top + 2, region.bottom))

    override val sha256: String by lazy {
        facts.origin.sha256.ifEmpty {
            val all = facts.clipped(region)
            val one = band(0)
            // A source that gave more than was asked for is known by all that it gave.
            if (one.region.height >= all.height) {
                Hash().also { it.add(one, one.region) }.hex()
            } else {
                Hash().also { hash -> each(all) { mosaic, part -> hash.add(mosaic, part) } }.hex()
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
        band = null // before the next one is made
        val top = region.top + at * height
        val bottom = top + minOf(height, region.bottom - top)
        val found = source.read(Region(region.left, top, region.right, bottom))
        known = found.facts
        number = at
        band = found
        return found
    }

    override fun release() {
        band = null
    }
}

/** SHA-256 of samples, row by row, low byte first. */
internal class Hash {
    private val digest = MessageDigest.getInstance("SHA-256")
    private var bytes = ByteArray(0)

    fun add(samples: ShortArray, from: Int, count: Int) {
        if (bytes.size != 2 * count) bytes = ByteArray(2 * count)
        for (x in 0 until count) {
            val sample = samples[from + x].toInt()
            bytes[2 * x] = sample.toByte()
            bytes[2 * x + 1] = (sample shr 8).toByte()
        }
        digest.update(bytes)
    }

    fun add(mosaic: Mosaic, part: Region) = mosaic.give(part) { _, _, count, samples, at -> add(samples, at, count) }

    fun hex(): String = digest.digest().joinToString("") { "%02x".format(it) }
}

/** Gives the rows of a part. */
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
