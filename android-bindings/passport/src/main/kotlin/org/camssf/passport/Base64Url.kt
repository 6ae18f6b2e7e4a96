package org.camssf.passport

/** Base64url without padding (RFC 7515, section 2). Java's own class is missing in Android before API 26. */
internal object Base64Url {
    fun encode(data: ByteArray): String {
        val out = StringBuilder((data.size * 4L / 3 + 2).toInt())
        var at = 0
        while (at < data.size) {
            val count = minOf(3, data.size - at)
            var bits = 0
            for (i in 0..2) bits = bits shl 8 or if (i < count) data[at + i].toInt() and 0xff else 0
            for (i in 0..count) out.append(LETTERS[bits shr 18 - 6 * i and 0x3f])
            at += 3
        }
        return out.toString()
    }

    /**
     * Decodes the characters at [from] until [until]. Null if there are none, or if they are not the only valid
     * spelling: unused bits must be 0.
     */
    fun decode(text: ByteArray, from: Int = 0, until: Int = text.size): ByteArray? {
        val length = until - from
        if (length == 0 || length % 4 == 1) return null
        val out = ByteArray((length * 3L / 4).toInt())
        var bits = 0
        var at = 0
        for (i in 0 until length) {
            val value = VALUES.getOrElse(text[from + i].toInt()) { -1 }
            if (value < 0) return null
            bits = bits shl 6 or value
            if (i % 4 > 0) out[at++] = (bits shr 6 - 2 * (i % 4)).toByte()
        }
        val unread = intArrayOf(0, 0, 0xf, 0x3)[length % 4]
        return out.takeIf { bits and unread == 0 }
    }

    private const val LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"
    private val VALUES = IntArray(128) { LETTERS.indexOf(it.toChar()) }
}
