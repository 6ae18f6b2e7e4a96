package org.camssf.passport

import org.camssf.PassportInvalid

internal const val ASK = "Ask the one who signed it for the passport as it was written; trust nothing in this one."

/** In bytes, as Python's. */
internal const val LARGEST_PASSPORT = 128 * 1024 * 1024

/**
 * A compact JWS (RFC 7515) in the one form that passports have.
 *
 * @property kid the name of the key that it says it is signed by.
 * @property length how many of its first bytes are signed.
 */
internal class Parts private constructor(
    val kid: String,
    val payload: ByteArray,
    val signature: ByteArray,
    val length: Int,
) {
    companion object {
        const val ALGORITHM = "ES256"
        const val TYPE = "camssf-passport+jwt"

        /** Characters that a header may have. */
        private const val HEADER = 1024

        fun header(kid: String): String = """{"alg":"$ALGORITHM","kid":"$kid","typ":"$TYPE"}"""

        fun read(data: ByteArray): Parts {
            if (data.size > LARGEST_PASSPORT) {
                throw PassportInvalid("The passport is larger than $LARGEST_PASSPORT bytes.", ASK)
            }
            val first = data.indexOf('.'.code.toByte())
            val last = data.lastIndexOf('.'.code.toByte())
            val dots = data.count { it == '.'.code.toByte() }
            if (dots != 2 || first > HEADER) {
                throw PassportInvalid("It has not the form of a passport, three parts with a dot between them.", ASK)
            }
            val header = decoded(data, 0, first)
            val payload = decoded(data, first + 1, last)
            val signature = decoded(data, last + 1, data.size)
            val values = members(header, "header").values
            val kid = values["kid"] as? String
            if (kid == null || !PassportKeys.KEY.matches(kid)) {
                throw PassportInvalid("The passport names no key.", ASK)
            }
            if (values != mapOf("alg" to ALGORITHM, "kid" to kid, "typ" to TYPE)) { // `none`, HS256, crit, jwk
                throw PassportInvalid("The passport's header asks for something else than $ALGORITHM.", ASK)
            }
            if (signature.size != 64) {
                throw PassportInvalid("The passport's signature has ${signature.size} bytes, not 64.", ASK)
            }
            return Parts(kid, payload, signature, last)
        }

        private fun decoded(data: ByteArray, from: Int, until: Int): ByteArray =
            Base64Url.decode(data, from, until)
                ?: throw PassportInvalid("A part of the passport is not base64url.", ASK)

        fun members(data: ByteArray, name: String): Members = members(text(data, name), name)

        fun members(text: String, name: String): Members = sound(name) { Sound.parse(text) } as? Members
            ?: throw PassportInvalid("The passport's $name is no object.", ASK)

        fun text(data: ByteArray, name: String): String = sound(name) { Sound.text(data) }

        private fun <T> sound(name: String, read: () -> T): T = try {
            read()
        } catch (error: UnsoundException) {
            throw PassportInvalid("The passport's $name is not sound JSON.", ASK, cause = error)
        }
    }
}
