package org.camssf.passport

import org.camssf.PassportInvalid

/** Reads the signed list of revoked passports and keys, as Python's `documents/revocations.py` does. */
internal object Revocations {
    const val TYPE = "camssf-revocations+jwt"
    private const val FORMAT = "camssf-revocations/1"
    private const val WHAT = "the revocation list"
    private const val LARGEST_LIST = 16 * 1024 * 1024

    fun read(data: ByteArray, points: Map<String, ByteArray>, now: Long): Set<String> {
        if (data.size > LARGEST_LIST) throw invalid("is larger than $LARGEST_LIST bytes")
        if (data.count { it == '.'.code.toByte() } != 2) {
            throw PassportInvalid(
                "The revocation list is not signed.",
                "Get it from its signer; `camssf passport revoke` signs one.",
            )
        }
        val parts = Parts.verified(data, TYPE, points, WHAT)
        val payload = Parts.members(Parts.text(parts.payload, "payload", WHAT), "payload", WHAT)
        val names = payload["revoked"] as? List<*>
        val sound = payload["format"] == FORMAT && listOf("iat", "exp").all { Claims.isSecond(payload[it]) } &&
            names != null && names.all { it is String && isName(it) }
        if (!sound) throw invalid("is not in the form $FORMAT")
        val ends = payload["exp"] as Long
        if (now >= ends) {
            throw PassportInvalid(
                "The revocation list ended at ${iso(second(ends))}.",
                "Get the newest one from its signer, who renews it by `camssf passport revoke`.",
            )
        }
        return names.orEmpty().map { it as String }.toSet()
    }

    private fun isName(name: String) = PassportKeys.PASSPORT.matches(name) || PassportKeys.KEY.matches(name)

    private fun invalid(why: String) = PassportInvalid("The revocation list $why.", Parts.advice(WHAT))
}
