package org.camssf.photo

import org.camssf.CalibrationException
import org.camssf.UnreadableRaw
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import java.io.File
import java.io.IOException
import java.util.concurrent.CancellationException

/**
 * Where a photo comes from: it is read when its turn comes, part by part where it is large, and let go before the next
 * one. Of each frame only the samples of a few patches are kept.
 *
 * It is called on the thread that measures: once where the part around the chart has 12 megapixels or less, else several
 * times, each time for a band of it, and it gives the same photo each time. The mosaic belongs to the caller. Frames of
 * the chart, the white and the dark come alike.
 */
public fun interface PhotoSource {
    /**
     * Reads the photo, at least the `region` of its active area if there is one.
     *
     * @throws CalibrationException if it cannot be read.
     */
    public fun read(region: Region?): Mosaic

    public companion object {
        /** A photo that is in memory already. */
        @JvmStatic
        public fun of(mosaic: Mosaic): PhotoSource = Held(mosaic)

        /** A DNG file; only the strips and tiles around the chart are decoded. */
        @JvmStatic
        public fun of(file: File): PhotoSource = dng { DngSource.of(file) }

        /**
         * A DNG that `open` opens anew at each call, a `Uri` for example; it is closed here. What `open` throws becomes
         * [UnreadableRaw].
         */
        @JvmStatic
        public fun dng(open: () -> DngSource): PhotoSource = DngPhoto(open)
    }
}

/** A DNG that is opened anew for each reading, so that nothing stays open between two of them. */
private class DngPhoto(private val open: () -> DngSource) : ByRows {
    override fun read(region: Region?): Mosaic = using { DngReader.read(it, region) }

    override fun rows(region: Region): Reading = object : Reading {
        override val facts: Facts by lazy { using { DngReader.facts(it, region) } }
        override val sha256: String get() = facts.origin.sha256

        override fun scan(region: Region, rows: Rows) = using { DngReader.scan(it, region, rows) }

        override fun release() = Unit
    }

    private fun <T> using(work: (DngSource) -> T): T {
        val source = opened(open)
        try {
            return source.use(work)
        } catch (error: IOException) {
            throw UnreadableRaw("${source.name} cannot be closed: ${error.message}.", AGAIN, cause = error)
        }
    }

    private companion object {
        private const val AGAIN = "Check that the photo is still there and that the app may read it, and try again."

        /** What a provider throws is its own: no file, no permission, no network. */
        private fun opened(open: () -> DngSource): DngSource = try {
            open()
        } catch (error: Exception) {
            if (error is CalibrationException || error is CancellationException || error is InterruptedException) {
                throw error
            }
            throw UnreadableRaw("The photo cannot be opened: ${error.message ?: error}.", AGAIN, cause = error)
        }
    }
}
