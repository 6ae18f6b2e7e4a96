package org.camssf.photo.dng

import org.camssf.Refusal
import org.camssf.UnreadableRaw
import org.camssf.UnsupportedRaw
import java.io.ByteArrayOutputStream
import java.io.Closeable
import java.io.EOFException
import java.io.File
import java.io.FileInputStream
import java.io.IOException
import java.io.InputStream
import java.nio.ByteBuffer
import java.nio.channels.FileChannel

/**
 * The bytes of a DNG: random access, any number of reads, one thread at a time.
 *
 * The caller that opens a source closes it. On Android, open a `Uri` as a descriptor and pass
 * `FileInputStream(descriptor).channel` to [of]; if the provider only streams, pass the stream.
 */
public interface DngSource : Closeable {
    /** Name of the file without its path, for messages and results. */
    public val name: String

    /** Size, bytes. */
    public val size: Long

    /**
     * Reads `length` bytes from byte `at` into `into`, beginning at `offset`.
     *
     * @throws IOException not all of these bytes can be read.
     */
    @Throws(IOException::class)
    public fun read(at: Long, into: ByteArray, offset: Int, length: Int)

    public companion object {
        /** Default for the largest stream that [of] accepts, bytes. */
        public const val STREAM_LIMIT: Long = 256L shl 20

        /** A source of bytes in memory, which are not copied. */
        @JvmStatic
        public fun of(bytes: ByteArray, name: String): DngSource = BytesSource(bytes, bytes.size, name)

        /**
         * A source of a file, which is opened here.
         *
         * @throws UnreadableRaw the file is missing, a folder, or cannot be opened.
         */
        @JvmStatic
        public fun of(file: File): DngSource {
            if (file.isDirectory) throw Refusal.of("unreadable_raw.folder", "file" to file.name)
            if (!file.exists()) throw Refusal.of("unreadable_raw.missing", "file" to file.name)
            val stream = try {
                FileInputStream(file)
            } catch (error: IOException) {
                throw Refusal.of(
                    "unreadable_raw.no_access", "file" to file.name, "detail" to error.message.orEmpty(),
                    cause = error,
                )
            }
            try {
                return of(stream.channel, file.name)
            } catch (error: UnreadableRaw) {
                stream.close()
                throw error
            }
        }

        /**
         * A source of an open channel. Closing the source closes the channel; its position is neither used nor
         * changed.
         *
         * @throws UnreadableRaw the channel has no size, for example a pipe.
         */
        @JvmStatic
        public fun of(channel: FileChannel, name: String): DngSource {
            val size = try {
                channel.size()
            } catch (error: IOException) {
                throw Refusal.of("unreadable_raw.no_channel", "file" to name, cause = error)
            }
            return ChannelSource(channel, size, name)
        }

        /** As the other `of`, of at most [STREAM_LIMIT] bytes. */
        @JvmStatic
        public fun of(stream: InputStream, name: String): DngSource = of(stream, name, STREAM_LIMIT)

        /**
         * A source of a stream, which is read to its end here and left open.
         *
         * @param limit largest number of bytes accepted.
         * @throws UnreadableRaw reading the stream fails.
         * @throws UnsupportedRaw the stream is longer than `limit`.
         */
        internal fun of(stream: InputStream, name: String, limit: Long): DngSource {
            val found = Grown()
            val chunk = ByteArray(1 shl 16)
            try {
                while (true) {
                    val count = stream.read(chunk)
                    if (count < 0) break
                    if (found.size() + count > limit) {
                        throw Refusal.of("unsupported_raw.too_long", "file" to name, "most" to limit)
                    }
                    found.write(chunk, 0, count)
                }
            } catch (error: IOException) {
                throw Refusal.of(
                    "unreadable_raw.stream", "file" to name, "detail" to error.message.orEmpty(), cause = error,
                )
            }
            return BytesSource(found.bytes(), found.size(), name)
        }
    }
}

/** Gives access to its buffer without a copy. */
private class Grown : ByteArrayOutputStream(1 shl 20) {
    fun bytes(): ByteArray = buf
}

private class BytesSource(private val bytes: ByteArray, length: Int, override val name: String) : DngSource {
    override val size = length.toLong()

    override fun read(at: Long, into: ByteArray, offset: Int, length: Int) {
        if (at < 0 || at + length > size) throw EOFException("byte ${at + length} of $size")
        System.arraycopy(bytes, at.toInt(), into, offset, length)
    }

    override fun close() = Unit
}

private class ChannelSource(
    private val channel: FileChannel,
    override val size: Long,
    override val name: String,
) : DngSource {
    override fun read(at: Long, into: ByteArray, offset: Int, length: Int) {
        if (at < 0) throw EOFException("byte $at")
        var done = 0
        while (done < length) {
            // in steps, because the runtime copies through a buffer as large as the request
            val count = channel.read(ByteBuffer.wrap(into, offset + done, minOf(length - done, STEP)), at + done)
            if (count < 0) throw EOFException("byte ${at + done} of $size")
            done += count
        }
    }

    override fun close() = channel.close()

    private companion object {
        const val STEP = 1 shl 18
    }
}
