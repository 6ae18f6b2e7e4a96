package org.camssf.passport

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.PassportInvalid
import org.junit.jupiter.api.Assertions.assertArrayEquals
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.DynamicTest
import org.junit.jupiter.api.DynamicTest.dynamicTest
import org.junit.jupiter.api.Tag
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.TestFactory
import org.junit.jupiter.api.assertThrows
import java.io.File
import java.util.Base64
import kotlin.time.Duration.Companion.days

/** Every document that Python signed or spoiled gets Python's answer, word for word; and Python reads Kotlin's. */
@Tag("R-PASSPORT")
class PythonsTest {
    @TestFactory
    fun `the answers are Python's`(): List<DynamicTest> = Fixtures.CASES.map { case ->
        dynamicTest(case.name) {
            val verified = answer { Passport.verify(case.data, listOf(Fixtures.SIGNER), case.revoked, case.at) }
            assertEquals(stated(case.verified), verified)
            assertEquals(stated(case.read), answer { Passport.show(case.data).passport })
        }
    }

    @Test
    fun `some are accepted, most are refused`() {
        val accepted = Fixtures.CASES.count { it.verified is JsonObject }
        assertTrue(accepted in 30..60 && Fixtures.CASES.size > 300, "$accepted of ${Fixtures.CASES.size}")
    }

    @Test
    fun `the result comes out, and is that of its file`() {
        val whole = Fixtures.case("whole")
        val found = Passport.verify(whole.data, listOf(Fixtures.SIGNER), now = whole.at, result = Fixtures.RESULT)
        assertEquals(Fixtures.plain(Fixtures.excerpt(String(Fixtures.RESULT))), Fixtures.plain(found.result))
        assertEquals("Ä \"1\" \\ \uD83D\uDE00", found.unit.serial)
        val error = assertThrows<PassportInvalid> {
            val other = Fixtures.RESULT + '\n'.code.toByte()
            Passport.verify(whole.data, listOf(Fixtures.SIGNER), now = whole.at, result = other)
        }
        assertTrue("another result" in error.message)
    }

    @TestFactory
    fun `lists are read as Python reads them`(): List<DynamicTest> = Fixtures.LISTS.map { of ->
        dynamicTest(of.getValue("name").jsonPrimitive.content) {
            val data = of.getValue("data").jsonPrimitive.content.toByteArray(Charsets.ISO_8859_1)
            val names: Any = try {
                PassportKeys.readRevoked(data, listOf(Fixtures.SIGNER), Fixtures.LATER).sorted().map { "s$it" }
            } catch (error: PassportInvalid) {
                error.message
            }
            val expected = of.getValue("told")
            assertEquals(if (expected is JsonArray) Fixtures.plain(expected) else stated(expected), names)
        }
    }

    @Test
    fun `keys have Python's names`() {
        for (who in listOf("signer", "other")) {
            val key = PassportKeys.readPublic(Fixtures.pem(who).toByteArray())
            assertEquals(Fixtures.keyName(who), PassportKeys.name(key))
            val body = Fixtures.pem(who).lines().filterNot { it.startsWith("-") }.joinToString("")
            assertArrayEquals(Base64.getDecoder().decode(body), key.encoded)
        }
    }

    /**
     * What Python's tests/fleet/test_passport_changed.py reads: `mvn -f android-bindings verify -Dpassports.write` writes it anew, of
     * the results that python.json.gz holds. The private key was made for it and is gone.
     */
    @Test
    fun `passports for Python`() {
        val file = File(Fixtures.FOLDER, "kotlin.json")
        if (System.getProperty("passports.write") != null) file.writeText(written().toString() + "\n")
        val known = Json.parseToJsonElement(file.readText()) as JsonObject
        val key = PassportKeys.readPublic(known.getValue("pem").jsonPrimitive.content.toByteArray())
        val passports = known.getValue("passports") as JsonArray
        assertEquals(3, passports.size)
        for (each in passports.map { it as JsonObject }) {
            val data = each.getValue("data").jsonPrimitive.content.toByteArray()
            val result = Fixtures.text(each.getValue("result").jsonPrimitive.content)
            val found = Passport.verify(data, listOf(key), now = Fixtures.LATER, result = result.toByteArray())
            assertEquals(Fixtures.plain(each.getValue("shown")), Fixtures.plain(Passport.show(data).toJson()))
            assertEquals(Fixtures.plain(Fixtures.excerpt(result)), Fixtures.plain(found.result))
        }
    }

    private fun written(): JsonObject {
        val keys = Fixtures.pair()
        val unit = CameraUnit("", "", "rear \uD800 wide", "Ä \"1\"\u0000\n\uD83D\uDE00", "24 mm", 5.4, 1.8)
        val requests = listOf(
            PassportRequest() to "result",
            PassportRequest(unit, "2026-11-20 10:00Z", "7\u2028", listOf("lamp\\3"), 90.5) to "small",
            PassportRequest(
                captured = "2026-11-20T10:00:00.25+01:00", days = 36500.0, begins = Fixtures.LATER - 1.days,
            ) to "small",
        )
        val body = Base64.getMimeEncoder(64, "\n".toByteArray()).encodeToString(keys.public.encoded)
        val pem = "-----BEGIN PUBLIC KEY-----\n$body\n-----END PUBLIC KEY-----\n"
        val passports = requests.map { (request, result) ->
            val text = Fixtures.text(result).toByteArray()
            val data = Passport.create(text, request, Fixtures.LATER - 2.days).sign(keys)
            val shown = Json.parseToJsonElement(Passport.show(data).toJson())
            val texts = mapOf("data" to String(data), "result" to result).mapValues { JsonPrimitive(it.value) }
            JsonObject(texts + ("shown" to shown))
        }
        return JsonObject(mapOf("pem" to JsonPrimitive(pem), "passports" to JsonArray(passports)))
    }

    private fun answer(ask: () -> Passport): Any? = try {
        val claims = ask().claims().filter { it.first != "result" }
        Fixtures.plain(claims.joinToString(",", "{", "}") { (name, value) -> "\"$name\":$value" })
    } catch (error: PassportInvalid) {
        error.message
    }

    private fun stated(of: JsonElement): Any? =
        if (of is JsonObject) Fixtures.plain(of) else of.jsonPrimitive.content
}
