package org.camssf.camera2

import android.content.ContentProvider
import android.content.ContentResolver
import android.content.ContentValues
import android.database.Cursor
import android.database.MatrixCursor
import android.net.Uri
import android.os.ParcelFileDescriptor
import android.provider.OpenableColumns
import org.camssf.UnreadableRaw
import org.camssf.photo.dng.DngSource
import org.junit.Assert.assertArrayEquals
import org.junit.Assert.assertEquals
import org.junit.Assert.assertThrows
import org.junit.Assert.assertTrue
import org.junit.Test
import org.junit.runner.RunWith
import org.mockito.ArgumentMatchers.any
import org.mockito.Mockito.mock
import org.mockito.Mockito.`when`
import org.robolectric.Robolectric
import org.robolectric.RobolectricTestRunner
import org.robolectric.RuntimeEnvironment
import org.robolectric.annotation.Config
import java.io.File
import java.io.FileNotFoundException

@RunWith(RobolectricTestRunner::class)
@Config(sdk = [35])
class PhotosTest {
    private val resolver = RuntimeEnvironment.getApplication().contentResolver
    private val bytes = ByteArray(5000) { (it * 7).toByte() }
    private val file = File.createTempFile("photo", ".dng").apply {
        writeBytes(bytes)
        deleteOnExit()
    }

    @Test
    fun `a file is read in place`() {
        Photos.open(resolver, Uri.fromFile(file)).use { source ->
            assertEquals(file.name, source.name)
            assertContent(source)
        }
    }

    @Test
    fun `a provider's file carries the shown name`() {
        Robolectric.setupContentProvider(Files::class.java, "files").file = file
        Photos.open(resolver, Uri.parse("content://files/document/17")).use { source ->
            assertEquals("IMG_1.dng", source.name)
            assertContent(source)
        }
    }

    @Test
    fun `what can only be streamed is read whole`() {
        val pipe = Pipe(file) { -1L } // as a pipe answers
        Photos.open(giving(pipe), Uri.parse("content://files/document/17")).use { source ->
            assertTrue(pipe.closed) // nothing is read from it any more
            assertContent(source)
        }
    }

    @Test
    fun `a descriptor that cannot be read is closed`() {
        for (failure in listOf(IllegalStateException("gone"), SecurityException("no"))) {
            val pipe = Pipe(file) { throw failure }
            val uri = Uri.parse("content://files/document/17")
            val error = assertThrows(UnreadableRaw::class.java) { Photos.open(giving(pipe), uri) }
            assertEquals(failure, error.cause)
            assertTrue(failure.message, pipe.closed)
        }
    }

    @Test
    fun `what is missing or forbidden is said`() {
        val gone = assertThrows(UnreadableRaw::class.java) { Photos.open(resolver, Uri.parse("file:///no/such.dng")) }
        assertTrue(gone.message, "such.dng" in gone.message)
        Robolectric.setupContentProvider(Files::class.java, "files").refuses = true
        val error = assertThrows(UnreadableRaw::class.java) { Photos.open(resolver, Uri.parse("content://files/2")) }
        assertTrue(error.message, "may not read" in error.message)
    }

    @Test
    fun `a provider that fails in its own way is said`() {
        val provider = Robolectric.setupContentProvider(Files::class.java, "files")
        provider.failure = IllegalStateException("no network")
        val error = assertThrows(UnreadableRaw::class.java) { Photos.open(resolver, Uri.parse("content://files/2")) }
        assertTrue(error.message, "IMG_1.dng failed" in error.message)
        assertTrue(error.advice, error.advice.startsWith("Copy it"))
        assertEquals("no network", error.cause?.message)
    }

    @Test
    fun `a provider without names or that throws is named by its address`() {
        Robolectric.setupContentProvider(Files::class.java, "files").file = file
        assertEquals("17", Photos.name(resolver, Uri.parse("content://files/document/17?nameless")))
        assertEquals("18", Photos.name(resolver, Uri.parse("content://files/document/18?broken")))
    }

    private fun giving(file: ParcelFileDescriptor): ContentResolver {
        val resolver = mock(ContentResolver::class.java)
        `when`(resolver.openFileDescriptor(any(), any())).thenReturn(file)
        return resolver
    }

    private fun assertContent(source: DngSource) {
        assertEquals(5000L, source.size)
        val part = ByteArray(100)
        source.read(4000, part, 10, 50)
        assertArrayEquals(bytes.copyOfRange(4000, 4050), part.copyOfRange(10, 60))
        source.read(0, part, 0, 100)
        assertArrayEquals(bytes.copyOf(100), part)
    }

    class Files : ContentProvider() {
        var file: File? = null
        var refuses = false
        var failure: RuntimeException? = null

        override fun onCreate() = true

        override fun openFile(uri: Uri, mode: String): ParcelFileDescriptor {
            if (refuses) throw SecurityException("no")
            failure?.let { throw it }
            val known = file ?: throw FileNotFoundException()
            return ParcelFileDescriptor.open(known, ParcelFileDescriptor.MODE_READ_ONLY)
        }

        override fun query(
            uri: Uri, columns: Array<String>?, where: String?, values: Array<String>?, order: String?,
        ): Cursor? {
            if (uri.query == "broken") throw UnsupportedOperationException()
            if (uri.query == "nameless") return null
            return MatrixCursor(arrayOf(OpenableColumns.DISPLAY_NAME)).apply { addRow(arrayOf("IMG_1.dng")) }
        }

        override fun getType(uri: Uri) = "image/x-adobe-dng"

        override fun insert(uri: Uri, values: ContentValues?) = null

        override fun delete(uri: Uri, where: String?, values: Array<String>?) = 0

        override fun update(uri: Uri, values: ContentValues?, where: String?, arguments: Array<String>?) = 0
    }

    private class Pipe(file: File, private val size: () -> Long) : ParcelFileDescriptor(open(file, MODE_READ_ONLY)) {
        var closed = false

        override fun getStatSize() = size()

        override fun close() {
            closed = true
            super.close()
        }
    }
}
