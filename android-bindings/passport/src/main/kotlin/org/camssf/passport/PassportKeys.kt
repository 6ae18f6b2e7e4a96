package org.camssf.passport

import org.camssf.InvalidArgument
import java.security.MessageDigest
import java.security.PublicKey

/** Public keys by name and by file, and the list of what was called back. Private keys stay where they are. */
public object PassportKeys {
    /** A public key's name in passports, its thumbprint (RFC 7638, SHA-256): 43 characters, the same in every language. */
    @JvmStatic
    public fun name(key: PublicKey): String = name(P256.point(key))

    internal fun name(point: ByteArray): String {
        val x = Base64Url.encode(point.copyOf(32))
        val y = Base64Url.encode(point.copyOfRange(32, 64))
        val form = """{"crv":"P-256","kty":"EC","x":"$x","y":"$y"}"""
        return Base64Url.encode(sha256(form.toByteArray()))
    }

    /**
     * The key in a PEM file, as `camssf passport key` and OpenSSL write it.
     *
     * @throws InvalidArgument it is no public key on P-256.
     */
    @JvmStatic
    public fun readPublic(pem: ByteArray): PublicKey {
        val text = if (pem.size > LARGEST_KEY) "" else String(pem, Charsets.ISO_8859_1)
        val body = PEM.find(text)?.groupValues?.get(1)?.filterNot { it.isWhitespace() }?.trimEnd('=')
        val info = body?.replace('+', '-')?.replace('/', '_')?.toByteArray()?.let { Base64Url.decode(it) }
            ?: throw InvalidArgument(
                "This is not a public key in PEM.",
                "Give the signer's public key, not the private one.",
            )
        return P256.key(P256.point(info))
    }

    /**
     * Ids of passports and names of keys that were called back: text, a name a line, # begins a comment.
     *
     * @throws InvalidArgument a line is no name. A list that is half understood protects nobody.
     */
    @JvmStatic
    public fun readRevoked(list: ByteArray): Set<String> {
        if (list.size > LARGEST_LIST) throw InvalidArgument("The list is larger than $LARGEST_LIST bytes.", MEANT)
        val text = try {
            Sound.text(list).removePrefix("\ufeff")
        } catch (_: UnsoundException) {
            throw InvalidArgument("The list is not text in UTF-8.", "Write one passport or key a line.")
        }
        val names = HashSet<String>()
        for ((number, line) in text.split(LINES).withIndex()) {
            val name = line.substringBefore('#').trim()
            if (name.isEmpty()) continue
            if (!PASSPORT.matches(name) && !KEY.matches(name)) {
                throw InvalidArgument(
                    "The list's line ${number + 1} is neither a passport's id nor a key's name.",
                    "Write what `camssf passport show` says as id (32 hexadecimal digits) or key (43 characters).",
                )
            }
            names += name
        }
        return names
    }

    internal fun sha256(data: ByteArray): ByteArray = MessageDigest.getInstance("SHA-256").digest(data)

    internal val PASSPORT = Regex("[0-9a-f]{32}")
    internal val KEY = Regex("[A-Za-z0-9_-]{43}")
    private val PEM = Regex("-----BEGIN PUBLIC KEY-----\\s([A-Za-z0-9+/=\\s]+)-----END PUBLIC KEY-----")
    private val LINES = Regex("\r\n|[\n\r\u000b\u000c\u001c-\u001e\u0085\u2028\u2029]")
    private const val LARGEST_KEY = 64 * 1024
    private const val LARGEST_LIST = 16 * 1024 * 1024
    private const val MEANT = "Give the file that was meant."
}
