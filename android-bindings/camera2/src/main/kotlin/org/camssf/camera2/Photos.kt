package org.camssf.camera2

import android.content.ContentResolver
import android.net.Uri
import android.os.ParcelFileDescriptor
import android.provider.OpenableColumns
import org.camssf.CalibrationException
import org.camssf.Refusal
import org.camssf.UnreadableRaw
import org.camssf.UnsupportedRaw
import org.camssf.photo.dng.DngSource
import java.io.IOException

/** Opens photos that the user chose with the storage access framework. */
public object Photos {
    /**
     * Opens a photo for the DNG reader; the caller closes it.
     *
     * A provider may use the network and block, so do not call this on the main thread.
     *
     * A file is not copied: the reader reads it once for its SHA-256 and decodes only what it needs. If a provider
     * can only stream, the photo is read into memory, 256 MB at most.
     *
     * @throws UnreadableRaw the photo does not exist, the app may not read it, or its provider fails.
     * @throws UnsupportedRaw a stream is longer than that.
     */
    @JvmStatic
    public fun open(resolver: ContentResolver, uri: Uri): DngSource {
        val name = name(resolver, uri)
        try {
            val file = resolver.openFileDescriptor(uri, "r") ?: throw IOException("no file")
            return source(file, name)
        } catch (error: CalibrationException) {
            throw error
        } catch (error: IOException) {
            throw Refusal.of(
                "unreadable_raw.content", "file" to name, "detail" to error.message.orEmpty(), cause = error,
            )
        } catch (error: SecurityException) {
            throw Refusal.of("unreadable_raw.no_permission", "file" to name, cause = error)
        } catch (error: RuntimeException) { // the provider's exceptions reach the app
            throw Refusal.of(
                "unreadable_raw.provider", "file" to name, "detail" to error.message.orEmpty(), cause = error,
            )
        }
    }

    /** The source of a file; closes the descriptor unless the source will close it. */
    private fun source(file: ParcelFileDescriptor, name: String): DngSource {
        val stream = ParcelFileDescriptor.AutoCloseInputStream(file)
        var kept = false
        try {
            if (file.statSize < 0) return DngSource.of(stream, name)
            return DngSource.of(stream.channel, name).also { kept = true }
        } finally {
            if (!kept) stream.close()
        }
    }

    /**
     * The name that the file picker shows, or the last part of the address if there is none or the provider throws;
     * no path.
     */
    @JvmStatic
    public fun name(resolver: ContentResolver, uri: Uri): String {
        val shown = try {
            resolver.query(uri, arrayOf(OpenableColumns.DISPLAY_NAME), null, null, null)?.use { row ->
                if (row.moveToFirst() && row.columnCount > 0) row.getString(0) else null
            }
        } catch (_: RuntimeException) {
            null
        }
        return shown ?: uri.lastPathSegment?.substringAfterLast('/') ?: "photo"
    }
}
