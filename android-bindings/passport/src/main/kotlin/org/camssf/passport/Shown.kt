package org.camssf.passport

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
        val verdict = (Sound.parse(passport.result) as Members).values["verdict"] as? Members
        val status = (verdict?.values?.get("status") as? String)?.let { Sound.quote(it) }
        val head = listOf(
            "key" to Sound.quote(key),
            "verified" to "false",
            "id" to Sound.quote(passport.id),
            "issued" to Sound.quote(iso(passport.issued)),
            "begins" to Sound.quote(iso(passport.begins)),
            "ends" to Sound.quote(iso(passport.ends)),
        )
        val claims = passport.claims().filter { it.first !in setOf("jti", "iat", "nbf", "exp", "result") }
        return (head + claims + ("verdict" to status)).joinToString(",", "{", "}") { (name, value) ->
            "\"$name\":$value"
        }
    }
}
