package org.camssf.camera2

import android.content.ContentResolver
import android.net.Uri
import android.os.ParcelFileDescriptor
import android.provider.OpenableColumns
import org.camssf.CalibrationException
import org.camssf.UnreadableRaw
import org.camssf.UnsupportedRaw
import org.camssf.photo.dng.DngSource
import java.io.IOException

/** Photos that the user chose, as the storage access framework names them. */
public object Photos {
    /**
     * Opens a photo for the DNG reader; the caller closes it. May block on a provider in the network: not on the main
     * thread.
     *
     * A file stays where it is: the reader goes through it once for its SHA-256 and decodes what it needs. What a
     * provider can only stream is taken into memory, 256 MB at most.
     *
     * @throws UnreadableRaw where the photo is gone, the app may not read it, or its provider fails.
     * @throws UnsupportedRaw where a stream is longer.
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
            throw UnreadableRaw("$name cannot be opened.", "Copy it to the phone and choose it again.", cause = error)
        } catch (error: SecurityException) {
            throw UnreadableRaw("The app may not read $name.", "Choose it again in the file picker.", cause = error)
        } catch (error: RuntimeException) { // whatever a provider throws comes through
            val advice = "Copy it to the phone's own storage and choose it there."
            throw UnreadableRaw("The app that keeps $name failed.", advice, cause = error)
        }
    }

    /** Closes the descriptor, but where the source does it. */
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

    /** The name that the file picker shows, or the address' last part where the provider throws; no path. */
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
