package org.camssf.passport

import org.camssf.InvalidArgument
import org.camssf.PassportInvalid
import org.camssf.model.Sha256
import java.security.PublicKey
import kotlin.time.Clock
import kotlin.time.Instant

/** Names and files of public keys, and the signed list of revoked passports and keys. No private key is read here. */
public object PassportKeys {
    /**
     * Name of a public key in passports: its thumbprint (RFC 7638, SHA-256), 43 characters, the same in every
     * language.
     *
     * @throws InvalidArgument the key is not on P-256.
     */
    @JvmStatic
    public fun name(key: PublicKey): String = name(P256.point(key))

    internal fun name(point: ByteArray): String {
        val x = Base64Url.encode(point.copyOf(32))
        val y = Base64Url.encode(point.copyOfRange(32, 64))
        val form = """{"crv":"P-256","kty":"EC","x":"$x","y":"$y"}"""
        return Base64Url.encode(sha256(form.toByteArray()))
    }

    /**
     * Reads the public key in a PEM file, as `camssf passport key` and OpenSSL write it.
     *
     * @throws InvalidArgument the file is not a public key on P-256.
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
     * Reads the revoked names from a signed list: ids of passports and names of keys. `camssf passport revoke` writes
     * and renews such lists.
     *
     * @param list as received.
     * @param trusted public keys, from [readPublic] or any provider; one of them must have signed the list.
     * @param now time of the check.
     * @throws PassportInvalid the list is unsigned, signed by an untrusted key, changed, malformed or expired.
     * @throws InvalidArgument a trusted key is not on P-256.
     */
    @JvmStatic
    @JvmOverloads
    public fun readRevoked(
        list: ByteArray,
        trusted: Collection<PublicKey>,
        now: Instant = Clock.System.now(),
    ): Set<String> = Revocations.read(list.copyOf(), points(trusted), now.epochSeconds)

    internal fun points(trusted: Collection<PublicKey>): Map<String, ByteArray> =
        trusted.map { P256.point(it) }.associateBy { name(it) }

    internal fun sha256(data: ByteArray): ByteArray = Sha256().add(data).toBytes()

    internal val PASSPORT = Regex("[0-9a-f]{32}")
    internal val KEY = Regex("[A-Za-z0-9_-]{43}")
    private val PEM = Regex("-----BEGIN PUBLIC KEY-----\\s([A-Za-z0-9+/=\\s]+)-----END PUBLIC KEY-----")
    private const val LARGEST_KEY = 64 * 1024
}
