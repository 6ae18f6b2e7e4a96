package org.camssf.photo

import org.camssf.CalibrationException
import org.camssf.UnreadableRaw
import org.camssf.photo.dng.DngReader
import org.camssf.photo.dng.DngSource
import java.io.File
import java.io.IOException
import java.util.concurrent.CancellationException

/**
 * Where a photo comes from: it is opened when its turn comes and let go before the next one, so that one capture never
 * holds more than the frames of one shot in memory.
 *
 * It is called on the thread that measures, once a calibration; the mosaic belongs to the caller. Frames of the chart, the
 * white and the dark come alike.
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
        public fun of(mosaic: Mosaic): PhotoSource = PhotoSource { mosaic }

        /** A DNG file; only the strips and tiles around the chart are decoded. */
        @JvmStatic
        public fun of(file: File): PhotoSource = dng { DngSource.of(file) }

        /**
         * A DNG that `open` opens anew at each call, a `Uri` for example; it is closed here. What `open` throws becomes
         * [UnreadableRaw].
         */
        @JvmStatic
        public fun dng(open: () -> DngSource): PhotoSource = PhotoSource { region ->
            val source = opened(open)
            try {
                source.use { DngReader.read(it, region) }
            } catch (error: IOException) {
                throw UnreadableRaw("${source.name} cannot be closed: ${error.message}.", AGAIN, cause = error)
            }
        }

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
