package org.camssf.photo

import org.camssf.CalibrationException
import org.camssf.Refusal
import org.camssf.UnreadableRaw
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import java.io.File
import java.io.IOException
import java.util.concurrent.CancellationException

/**
 * A source of a photo. camssf reads it only when needed, in parts if it is large, and releases it before the next
 * one. Of each frame only the samples of a few patches stay in memory.
 *
 * [read] is called on the measuring thread: once if the part around the chart has at most 12 megapixels, otherwise
 * several times, each time for a horizontal band of it. It must give the same photo each time. The mosaic belongs to
 * the caller. Chart, white and dark frames are read in the same way.
 */
public fun interface PhotoSource {
    /**
     * Reads the photo: at least `region` of its active area, or all of it if `region` is null.
     *
     * @throws CalibrationException the photo cannot be read. Any other exception becomes an [UnreadableRaw] with that
     *   cause, so a calibration ends as an [org.camssf.Refused].
     */
    public fun read(region: Region?): Mosaic

    public companion object {
        /** A photo that is already in memory. */
        @JvmStatic
        public fun of(mosaic: Mosaic): PhotoSource = Held(mosaic)

        /** A DNG file; only the strips and tiles around the chart are decoded. */
        @JvmStatic
        public fun of(file: File): PhotoSource = dng { DngSource.of(file) }

        /**
         * A DNG that `open` opens again for each reading, for example from a `Uri`; camssf closes it after each one.
         * Exceptions of `open` become [UnreadableRaw].
         */
        @JvmStatic
        public fun dng(open: () -> DngSource): PhotoSource = DngPhoto(open)
    }
}

/** A DNG that is opened again for each reading, so no file stays open in between. */
private class DngPhoto(private val open: () -> DngSource) : ByRows {
    override fun read(region: Region?): Mosaic = using { DngReader.read(it, region) }

    override fun rows(region: Region): Reading = object : Reading {
        override val facts: Facts by lazy { using { DngReader.facts(it, region) } }
        override val sha256: String get() = facts.origin.sha256

        override fun scan(region: Region, rows: Rows) = using { DngReader.scan(it, region, rows) }

        override fun release() = Unit
    }

    private fun <T> using(work: (DngSource) -> T): T {
        val source = fromApp(null, open)
        try {
            return source.use(work)
        } catch (error: IOException) {
            throw unreadable(source.name, error)
        }
    }
}

/**
 * Runs code of the app, such as its [PhotoSource] or a content provider: whatever exception it throws (no file, no
 * permission, no network, a fault of its own) becomes an [UnreadableRaw] with this cause. Errors of camssf,
 * cancelling and interrupting pass unchanged. `file` is the photo's name, null if it is not known.
 */
internal inline fun <T> fromApp(file: String?, work: () -> T): T = try {
    work()
} catch (error: Exception) {
    if (error is CalibrationException || error is CancellationException || error is InterruptedException) throw error
    throw unreadable(file, error)
}

internal fun unreadable(file: String?, error: Exception): Refusal {
    val detail = "detail" to (error.message ?: error)
    return if (file == null) {
        Refusal.of("unreadable_raw.photo_from_app", detail, cause = error)
    } else {
        Refusal.of("unreadable_raw.file_from_app", "file" to file, detail, cause = error)
    }
}
