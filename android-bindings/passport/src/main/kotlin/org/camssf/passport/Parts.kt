package org.camssf.passport

import org.camssf.PassportInvalid
import org.camssf.json.JsonText
import org.camssf.json.NotJson

/** In bytes, as in Python. */
internal const val LARGEST_PASSPORT = 100_000

/**
 * A compact JWS (RFC 7515) in the only form that passports and lists of revoked names have.
 *
 * The parameter `what` of its functions is its name in messages, for example "the passport".
 *
 * @property kid name of the key in the header.
 * @property payload decoded bytes.
 * @property signature r and s, 64 bytes.
 * @property length number of bytes, from the first, that are signed.
 */
internal class Parts private constructor(
    val kid: String,
    val payload: ByteArray,
    val signature: ByteArray,
    val length: Int,
) {
    companion object {
        const val ALGORITHM = "ES256"
        const val PASSPORT = "camssf-passport+jwt"
        const val WHAT = "the passport"

        /** Largest number of characters of a header. */
        private const val HEADER = 1024

        fun header(kid: String): String = """{"alg":"$ALGORITHM","kid":"$kid","typ":"$PASSPORT"}"""

        fun advice(what: String): String =
            "Ask the one who signed it for $what as it was written; trust nothing in this one."

        /**
         * Reads a signed document and verifies that one of the trusted keys signed these bytes.
         *
         * @param points x and y of the trusted keys, by the keys' names.
         * @throws PassportInvalid the form is wrong, or no trusted key signed these bytes.
         */
        fun verified(data: ByteArray, type: String, points: Map<String, ByteArray>, what: String): Parts {
            val parts = read(data, type, what)
            val point = points[parts.kid] ?: throw PassportInvalid(
                "${begin(what)} is signed by the key ${parts.kid}, which is not trusted.",
                "Give the signer's public key if you trust the signer.",
            )
            if (!P256.isInBounds(parts.signature)) throw invalid(what, "'s signature is not a valid pair of numbers")
            if (!P256.verify(point, data, parts.length, parts.signature)) {
                throw invalid(what, "'s signature does not match: the content was changed")
            }
            return parts
        }

        fun read(data: ByteArray, type: String, what: String): Parts {
            val first = data.indexOf('.'.code.toByte())
            val last = data.lastIndexOf('.'.code.toByte())
            val dots = data.count { it == '.'.code.toByte() }
            if (dots != 2 || first > HEADER) {
                val form = what.replaceFirst("the ", "a ")
                throw PassportInvalid(
                    "It does not have the form of $form, three parts with a dot between them.",
                    advice(what),
                )
            }
            val header = decoded(data, 0, first, what)
            val payload = decoded(data, first + 1, last, what)
            val signature = decoded(data, last + 1, data.size, what)
            val values = members(text(header, "header", what), "header", what)
            val kid = values["kid"] as? String
            if (kid == null || !PassportKeys.KEY.matches(kid)) throw invalid(what, " names no key")
            if (values != mapOf("alg" to ALGORITHM, "kid" to kid, "typ" to type)) { // `none`, HS256, crit, jwk
                throw invalid(what, "'s header does not name $ALGORITHM and $type")
            }
            if (signature.size != 64) throw invalid(what, "'s signature has ${signature.size} bytes, not 64")
            return Parts(kid, payload, signature, last)
        }

        private fun begin(what: String) = what.replaceFirstChar { it.uppercaseChar() }

        private fun invalid(what: String, why: String, cause: Throwable? = null) =
            PassportInvalid("${begin(what)}$why.", advice(what), cause = cause)

        private fun decoded(data: ByteArray, from: Int, until: Int, what: String): ByteArray =
            Base64Url.decode(data, from, until)
                ?: throw PassportInvalid("A part of $what is not base64url.", advice(what))

        /** The members of an object; `place` as in [JsonText.parse]. */
        fun members(
            text: String,
            name: String,
            what: String,
            place: (String, IntRange) -> Unit = { _, _ -> },
        ): Map<*, *> = strictly(name, what) { JsonText.parse(text, place) } as? Map<*, *>
            ?: throw invalid(what, "'s $name is not an object")

        fun text(data: ByteArray, name: String, what: String): String =
            strictly(name, what) { PassportJson.text(data) }

        private fun <T> strictly(name: String, what: String, read: () -> T): T = try {
            read()
        } catch (error: NotJson) {
            throw invalid(what, "'s $name is not valid JSON", error)
        }
    }
}
