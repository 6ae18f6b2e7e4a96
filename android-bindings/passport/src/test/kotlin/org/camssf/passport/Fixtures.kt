package org.camssf.passport

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.doubleOrNull
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import kotlinx.serialization.json.long
import org.camssf.PassportInvalid
import org.camssf.json.JsonText
import org.camssf.photo.DocumentForm
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.assertThrows
import java.io.File
import java.math.BigInteger
import java.security.KeyPair
import java.security.KeyPairGenerator
import java.security.PublicKey
import java.security.Signature
import java.security.spec.ECGenParameterSpec
import java.util.zip.GZIPInputStream
import kotlin.time.Instant

/** What `python -m tests.support.signed_passports` wrote, and keys of this run. */
internal object Fixtures {
    /** A passport, or what is none, and what Python says of it. */
    class Case(of: JsonObject) {
        val name = of.getValue("name").jsonPrimitive.content
        val data = of.getValue("data").jsonPrimitive.content.toByteArray(Charsets.ISO_8859_1)
        val at = Instant.fromEpochSeconds(of.getValue("at").jsonPrimitive.long)
        val revoked = of.getValue("revoked").jsonArray.map { it.jsonPrimitive.content }.toSet()

        /** The claims but for the result, or the words of the refusal. */
        val verified = of.getValue("verified")
        val read = of.getValue("read")
    }

    val FOLDER = File(System.getProperty("camssf.root"), "tests/support/passports")
    private val content = GZIPInputStream(File(FOLDER, "python.json.gz").inputStream()).reader().use {
        Json.parseToJsonElement(it.readText()).jsonObject
    }
    val CASES = content.getValue("cases").jsonArray.map { Case(it.jsonObject) }
    val RESULT = text("result").toByteArray()

    /** A whole result, about as short as one can be. */
    val SMALL = text("small")

    /** Revocation lists, and what Python says of them. */
    val LISTS = content.getValue("lists").jsonArray.map { it.jsonObject }
    val LATER: Instant = case("small").at
    val SIGNER: PublicKey = PassportKeys.readPublic(pem("signer").toByteArray())

    /** A result's text by its name: "result" or "small". */
    fun text(name: String): String = content.getValue(name).jsonPrimitive.content

    fun case(name: String): Case = CASES.single { it.name == name }

    fun pem(who: String): String = key(who, "pem")

    fun keyName(who: String): String = key(who, "name")

    private fun key(who: String, what: String): String =
        content.getValue("keys").jsonObject.getValue(who).jsonObject.getValue(what).jsonPrimitive.content

    fun pair(curve: String = "secp256r1"): KeyPair =
        KeyPairGenerator.getInstance("EC").apply { initialize(ECGenParameterSpec(curve)) }.generateKeyPair()

    fun ecdsa(keys: KeyPair, data: ByteArray): ByteArray = Signature.getInstance("SHA256withECDSA").run {
        initSign(keys.private)
        update(data)
        sign()
    }

    /** What a passport holds of a result. */
    fun excerpt(result: String): String = PassportJson.write(Excerpt.of(DocumentForm.read(result, "it")))

    /** [SMALL] without the hash of its content, changed: a document in plain values. */
    @Suppress("UNCHECKED_CAST")
    fun changed(change: (MutableMap<String, Any?>) -> Unit): String {
        val document = JsonText.parse(SMALL) as MutableMap<String, Any?>
        document.remove("sha256")
        change(document)
        return JsonText.write(document)
    }

    /** A part of a document in plain values. */
    @Suppress("UNCHECKED_CAST")
    fun part(document: Map<String, Any?>, name: String): MutableMap<String, Any?> =
        document.getValue(name) as MutableMap<String, Any?>

    fun refused(data: ByteArray, key: PublicKey, words: String = ""): PassportInvalid {
        val error = assertThrows<PassportInvalid> { Passport.verify(data, listOf(key), now = LATER) }
        assertTrue(words in error.message, error.message)
        return error
    }

    fun withSignature(data: ByteArray, signature: ByteArray): ByteArray =
        data.copyOf(data.lastIndexOf('.'.code.toByte()) + 1) + Base64Url.encode(signature).toByteArray()

    fun signature(data: ByteArray): ByteArray = Base64Url.decode(data, data.lastIndexOf('.'.code.toByte()) + 1)!!

    fun number(data: ByteArray, from: Int): BigInteger = BigInteger(1, data.copyOfRange(from, from + 32))

    fun numbers(r: BigInteger, s: BigInteger): ByteArray = listOf(r, s).joinToString("") {
        it.toString(16).padStart(64, '0')
    }.chunked(2).map { it.toInt(16).toByte() }.toByteArray()

    /** Numbers by their values: 35.0 is 35. */
    fun plain(of: JsonElement): Any? = when (of) {
        is JsonObject -> of.mapValues { plain(it.value) }
        is JsonArray -> of.map { plain(it) }
        is JsonPrimitive -> if (of.isString) "s" + of.content else of.doubleOrNull ?: of.content
    }

    fun plain(text: String): Any? = plain(Json.parseToJsonElement(text))
}
