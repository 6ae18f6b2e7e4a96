package org.camssf.camera2

import android.content.ContentResolver
import android.net.Uri
import android.os.ParcelFileDescriptor
import android.provider.OpenableColumns
import org.camssf.DngSource
import org.camssf.UnreadableRaw
import java.io.IOException

/** Photos that the user chose, as the storage access framework names them. */
public object Photos {
    /**
     * Opens a photo for the DNG reader; the caller closes it. May block on a provider in the network: not on the main
     * thread.
     *
     * A file is read in place, only where it is needed. What a provider can only stream is read whole, 256 MB at most.
     *
     * @throws UnreadableRaw where the photo is gone, or the app may not read it.
     */
    @JvmStatic
    public fun open(resolver: ContentResolver, uri: Uri): DngSource {
        val name = name(resolver, uri)
        try {
            val file = resolver.openFileDescriptor(uri, "r") ?: throw IOException("no file")
            val stream = ParcelFileDescriptor.AutoCloseInputStream(file)
            if (file.statSize >= 0) return DngSource.of(stream.channel, name)
            return stream.use { DngSource.of(it, name) }
        } catch (error: IOException) {
            throw UnreadableRaw("$name cannot be opened.", "Copy it to the phone and choose it again.", cause = error)
        } catch (error: SecurityException) {
            throw UnreadableRaw("The app may not read $name.", "Choose it again in the file picker.", cause = error)
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
