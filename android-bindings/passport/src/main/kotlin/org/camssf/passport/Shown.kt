package org.camssf.passport

import org.camssf.json.JsonText

/**
 * The content of a document that has the form of a passport. Nothing is verified: anybody may have written it.
 *
 * @property passport the content.
 * @property key name of the key in the header.
 */
public class Shown internal constructor(public val passport: Passport, public val key: String) {
    override fun toString(): String = "unverified $passport, key $key"

    /** The content as `camssf passport show` prints it, without the result. */
    public fun toJson(): String {
        val verdict = (JsonText.parse(passport.result) as Map<*, *>)["verdict"] as? Map<*, *>
        val status = (verdict?.get("status") as? String)?.let { PassportJson.write(it) }
        val head = listOf(
            "key" to PassportJson.write(key),
            "verified" to "false",
            "id" to PassportJson.write(passport.id),
            "issued" to PassportJson.write(iso(passport.issued)),
            "begins" to PassportJson.write(iso(passport.begins)),
            "ends" to PassportJson.write(iso(passport.ends)),
        )
        val claims = passport.claims().filter { it.first !in setOf("jti", "iat", "nbf", "exp", "result") }
        return (head + claims + ("verdict" to status)).joinToString(",", "{", "}") { (name, value) ->
            "\"$name\":$value"
        }
    }
}
