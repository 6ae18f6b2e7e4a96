package org.camssf.model

import java.security.MessageDigest

/** SHA-256 of bytes, or of 16-bit samples with the low byte first. Not thread-safe. */
public class Sha256 {
    private val digest = MessageDigest.getInstance("SHA-256")
    private var bytes = ByteArray(0)

    /** Adds `count` bytes of `data` from index `from`. */
    @JvmOverloads
    public fun add(data: ByteArray, from: Int = 0, count: Int = data.size): Sha256 {
        digest.update(data, from, count)
        return this
    }

    /** Adds `count` samples from index `from`. */
    public fun add(samples: ShortArray, from: Int, count: Int): Sha256 {
        if (bytes.size != 2 * count) bytes = ByteArray(2 * count)
        for (x in 0 until count) {
            val sample = samples[from + x].toInt()
            bytes[2 * x] = sample.toByte()
            bytes[2 * x + 1] = (sample shr 8).toByte()
        }
        digest.update(bytes)
        return this
    }

    /** The 32 bytes of the hash of all that was added; adding then begins anew. */
    public fun toBytes(): ByteArray = digest.digest()

    /** The same in lower-case hex. */
    public fun hex(): String = toBytes().joinToString("") { (it.toInt() and 0xff).toString(16).padStart(2, '0') }
}
