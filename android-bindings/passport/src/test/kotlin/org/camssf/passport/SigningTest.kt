package org.camssf.passport

import kotlinx.serialization.json.jsonPrimitive
import org.camssf.CalibrationException
import org.camssf.InvalidArgument
import org.camssf.PassportInvalid
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertFalse
import org.junit.jupiter.api.Assertions.assertNotEquals
import org.junit.jupiter.api.Assertions.assertNull
import org.junit.jupiter.api.Assertions.assertTrue
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.assertThrows
import java.io.File
import java.math.BigInteger
import java.security.KeyPair
import java.security.KeyPairGenerator
import java.security.PrivateKey
import java.security.PublicKey
import java.security.interfaces.ECPrivateKey
import java.util.Base64
import kotlin.time.Clock
import kotlin.time.Duration.Companion.days
import kotlin.time.Duration.Companion.nanoseconds
import kotlin.time.Duration.Companion.seconds
import kotlin.time.Instant

/** Drawing up, signing, times, keys and lists. */
class SigningTest {
    private val now = Instant.parse("2026-11-22T03:00:00.75Z")
    private val result = Fixtures.SMALL.toByteArray()
    private val keys = Fixtures.pair()

    @Test
    fun `a result goes in and comes out`() {
        val unit = CameraUnit(serial = "A1", lens = "35 mm", focalLength = 35.0)
        val said = PassportRequest(unit, "2026-11-20", "chart 7", listOf("lamp 3"), days = 90.0)
        val drawn = Passport.create(result, said, now)
        val found = Passport.verify(drawn.sign(keys), listOf(keys.public), now = now + 1.days, result = result)
        assertEquals(drawn.toJson(), found.toJson())
        assertEquals(CameraUnit("Maker", "Model A", "", "A1", "35 mm", 35.0), found.unit)
        assertEquals(Fixtures.plain(Fixtures.excerpt(Fixtures.SMALL)), Fixtures.plain(found.result))
        assertEquals("2026-11-20T00:00:00", found.captured)
        assertEquals(90.days, found.ends - found.begins)
        assertEquals(Instant.parse("2026-11-22T03:00:00Z"), found.issued)
        assertEquals(found.issued, found.begins)
        for (list in listOf(found.lampSerials, said.lampSerials)) {
            assertThrows<UnsupportedOperationException> { (list as MutableList<String>).add("another") }
        }
        assertNotEquals(drawn.id, Passport.create(result, said, now).id)
        assertTrue(found.toString().startsWith("passport ${found.id} of CameraUnit(make=Maker"))
    }

    /** Half of a provider's signatures have the larger s; numbers of 31 bytes and of 33: all become 64 bytes. */
    @Test
    fun `a hundred signatures`() {
        val drawn = Passport.create(result, now = now)
        var high = 0
        repeat(100) {
            val data = drawn.sign(keys.public) { text ->
                val der = Fixtures.ecdsa(keys, text)
                val s = BigInteger(der.copyOfRange(der.size - der[4 + der[3] + 1], der.size))
                if (s > P256.order.shiftRight(1)) high++
                der
            }
            assertEquals(64, Fixtures.signature(data).size)
            assertEquals(drawn.toJson(), Passport.verify(data, listOf(keys.public), now = now).toJson())
        }
        assertTrue(high in 20..80, "$high")
    }

    private fun ofModel(name: String): ByteArray = Fixtures.changed { document ->
        val shot = (Fixtures.part(document, "capture").getValue("shots") as List<*>).single() as Map<*, *>
        for (role in listOf("photo", "white", "dark")) {
            @Suppress("UNCHECKED_CAST")
            (shot[role] as MutableMap<String, Any?>?)?.set("model", name)
        }
    }.toByteArray()

    @Test
    fun `what cannot be signed`() {
        fun refused(
            words: String,
            data: String = Fixtures.SMALL,
            said: PassportRequest = PassportRequest(),
            at: Instant = now,
        ) {
            val error = assertThrows<InvalidArgument> { Passport.create(data.toByteArray(), said, at) }
            assertTrue(words in error.message, error.message)
        }
        refused("not valid JSON", "{")
        refused("not valid JSON", "{\"a\":1,\"a\":1}")
        refused("The result: the document must be an object", "[]")
        refused("it has no \"format\"", "{}")
        refused("is camssf/3, not camssf/2", Fixtures.changed { it["format"] = "camssf/3" })
        refused("is not the hash of the rest", Fixtures.SMALL.replace("\"Model A\"", "\"Model B\""))
        val none = Fixtures.changed {
            it.remove("answer")
            Fixtures.part(it, "verdict")["status"] = "refused"
        }
        refused("was refused", none)
        refused("answer lacks channel_gain", Fixtures.changed { Fixtures.part(it, "answer").remove("channel_gain") })
        val long = Passport.create(result, PassportRequest(chartSerial = "x".repeat(4097)), now)
        assertTrue("serials" in assertThrows<InvalidArgument> { long.sign(keys) }.message)
        refused("2 serials of lamps for 1 shots", said = PassportRequest(lampSerials = listOf("a", "b")))
        for (days in listOf(0.0, -1.0, Double.NaN, Double.POSITIVE_INFINITY, 36501.0)) {
            refused("days", said = PassportRequest(days = days))
        }
        refused("'Model A' there, not 'Other'", said = PassportRequest(CameraUnit(model = "Other")))
        refused("focal_length", said = PassportRequest(CameraUnit(focalLength = Double.POSITIVE_INFINITY)))
        refused("aperture", said = PassportRequest(CameraUnit(aperture = 0.0)))
        refused("the year 9999", said = PassportRequest(begins = Instant.parse("9999-12-01T00:00:00Z")))
        refused("the year 9999", said = PassportRequest(begins = Instant.parse("1969-12-01T00:00:00Z")))
        refused("issued at", said = PassportRequest(begins = now), at = Instant.parse("1969-12-01T00:00:00Z"))
        for (time in listOf("yesterday", "2026-02-29", "2026-13-01", "2026-01-01T24:00", "2026-01-01T10:00+25:00")) {
            refused("is not a time", said = PassportRequest(captured = time))
        }
    }

    @Test
    fun `its time`() {
        val drawn = Passport.create(result, PassportRequest(begins = now + 1.days, days = 1e-9), now)
        val data = drawn.sign(keys)
        assertEquals(1.seconds, drawn.ends - drawn.begins)
        fun at(time: Instant) = Passport.verify(data, listOf(keys.public), now = time)
        for (time in listOf(drawn.begins, drawn.ends - 1.nanoseconds)) assertEquals(drawn.id, at(time).id)
        for ((time, words) in listOf(
            drawn.begins - 1.nanoseconds to "is not valid before 2026-11-23T03:00:00+00:00.",
            drawn.ends to "ended at 2026-11-23T03:00:01+00:00.",
            drawn.ends + 9999.days to "ended",
        )) {
            assertTrue(words in assertThrows<PassportInvalid> { at(time) }.message)
        }
        val begins = Instant.parse("2000-01-01T00:00:00Z")
        val of2000 = Passport.create(result, PassportRequest(begins = begins), now).sign(keys)
        assertThrows<PassportInvalid> { Passport.verify(of2000, listOf(keys.public)) } // the clock's unless given
        val ofNow = Passport.create(result, PassportRequest(begins = Clock.System.now() - 1.days)).sign(keys)
        assertTrue(Passport.verify(ofNow, listOf(keys.public)).lampSerials == listOf(""))
    }

    @Test
    fun `a revoked passport is refused`() {
        val good = Fixtures.LISTS.single { it.getValue("name").jsonPrimitive.content == "good" }
        val list = good.getValue("data").jsonPrimitive.content.toByteArray()
        val names = PassportKeys.readRevoked(list, listOf(Fixtures.SIGNER), Fixtures.LATER)
        val small = Fixtures.case("small").data
        val error = assertThrows<PassportInvalid> {
            Passport.verify(small, listOf(Fixtures.SIGNER), names, Fixtures.LATER)
        }
        assertTrue("The passport was revoked" in error.message)
        val kid = setOf(Fixtures.keyName("signer"))
        assertThrows<PassportInvalid> { Passport.verify(small, listOf(Fixtures.SIGNER), kid, Fixtures.LATER) }
        Passport.verify(small, listOf(Fixtures.SIGNER), names - Passport.show(small).passport.id, Fixtures.LATER)
        assertThrows<PassportInvalid> { PassportKeys.readRevoked(list, listOf(Fixtures.SIGNER), now + 99.days) }
        assertThrows<PassportInvalid> { PassportKeys.readRevoked(list, listOf(keys.public), now) }
        assertThrows<PassportInvalid> { PassportKeys.readRevoked("f".repeat(32).toByteArray(), listOf(keys.public)) }
    }

    @Test
    fun `the excerpt is what the signed result holds`() {
        val drawn = Passport.create(result, now = now)
        assertTrue(drawn.sign(keys).size < 100_000)
        val other = Passport.create(ofModel("Model B"), now = now)
        val claims = other.toJson().replace(other.resultSha256, drawn.resultSha256)
        val text = Base64Url.encode(Parts.header(PassportKeys.name(keys.public)).toByteArray()) + "." +
            Base64Url.encode(claims.toByteArray())
        val data = text.toByteArray() +
            ".${Base64Url.encode(P256.raw(Fixtures.ecdsa(keys, text.toByteArray()))!!)}".toByteArray()
        Passport.verify(data, listOf(keys.public), now = now)
        val error = assertThrows<PassportInvalid> {
            Passport.verify(data, listOf(keys.public), now = now, result = result)
        }
        assertTrue("excerpt differs" in error.message)
    }

    @Test
    fun `keys of another kind, and files that are none`() {
        val rsa = KeyPairGenerator.getInstance("RSA").apply { initialize(2048) }.generateKeyPair()
        for (other in listOf(rsa, Fixtures.pair("secp384r1"))) {
            assertTrue("P-256" in assertThrows<InvalidArgument> { PassportKeys.name(other.public) }.message)
            assertTrue(
                "P-256" in
                    assertThrows<InvalidArgument> { PassportKeys.readPublic(pem(other.public.encoded)) }.message,
            )
            assertThrows<InvalidArgument> { Passport.create(result).sign(other) }
            assertThrows<InvalidArgument> { Passport.verify(ByteArray(0), listOf(other.public)) }
        }
        val off = keys.public.encoded.also { it[it.size - 1] = (it.last() + 1).toByte() }
        assertTrue("P-256" in assertThrows<InvalidArgument> { PassportKeys.readPublic(pem(off)) }.message)
        val private = String(pem(keys.private.encoded)).replace("PUBLIC", "PRIVATE")
        for (text in listOf("", "-----BEGIN PUBLIC KEY-----\n-----END PUBLIC KEY-----\n", private)) {
            assertTrue(
                "in PEM" in assertThrows<InvalidArgument> {
                    PassportKeys.readPublic(text.toByteArray())
                }.message,
            )
        }
        assertEquals(keys.public, PassportKeys.readPublic(pem(keys.public.encoded)))
    }

    private fun pem(info: ByteArray): ByteArray {
        val body = Base64.getMimeEncoder(64, "\n".toByteArray()).encodeToString(info)
        return "-----BEGIN PUBLIC KEY-----\n$body\n-----END PUBLIC KEY-----\n".toByteArray()
    }

    @Test
    fun `two that are no pair, and signers that err`() {
        val drawn = Passport.create(result, now = now)
        assertThrows<InvalidArgument> { drawn.sign(KeyPair(keys.public, Fixtures.pair().private)) }
        val der = Fixtures.ecdsa(keys, ByteArray(1))
        for (wrong in listOf(ByteArray(0), ByteArray(64) { 1 }, der, der + 0, der.copyOf(der.size - 1))) {
            assertThrows<InvalidArgument> { drawn.sign(keys.public) { wrong } }
        }
        assertNull(P256.raw(byteArrayOf(0x30, 6, 2, 1, 0, 2, 1, 0)))
        class Asleep : RuntimeException("authenticate first")
        assertThrows<Asleep> { drawn.sign(keys.public) { throw Asleep() } } // the app's own words come back to it
    }

    /** No message, cause or trace holds any of it, whatever a provider says. */
    @Test
    fun `the private key is nowhere`() {
        val number = (keys.private as ECPrivateKey).s
        val drawn = Passport.create(result, now = now)
        val talking = object : PrivateKey {
            override fun getAlgorithm(): String = throw java.security.ProviderException("the key is $number")
            override fun getFormat(): String = "$number"
            override fun getEncoded(): ByteArray = throw java.security.ProviderException("the key is $number")
            override fun toString(): String = "$number"
        }
        var said = String(drawn.sign(keys)) + drawn
        for (private in listOf(talking, Fixtures.pair("secp384r1").private)) {
            val error = assertThrows<CalibrationException> { drawn.sign(KeyPair(keys.public, private)) }
            said += error.toString() + error.stackTraceToString() + error.cause
        }
        said += said.split(".", "\n").mapNotNull { Base64Url.decode(it.toByteArray())?.let(::String) }
        val twice = Base64Url.encode(Fixtures.numbers(number, number))
        val secrets = listOf(number.toString(), number.toString(16), twice.take(40))
        for (secret in secrets) assertFalse(secret in said)
    }

    @Test
    fun `a key of which only the interface is known verifies`() {
        val drawn = Passport.create(result, now = now)
        val own = keys.public as java.security.interfaces.ECPublicKey
        val foreign: PublicKey = object : java.security.interfaces.ECPublicKey by own {
            override fun getEncoded(): ByteArray? = null
        }
        assertEquals(drawn.id, Passport.verify(drawn.sign(keys), listOf(foreign), now = now).id)
    }

    @Test
    fun `the version is the project's`() {
        val text = File(System.getProperty("camssf.root"), "reference/camssf/version.py").readText()
        assertTrue("\"${Passport.create(result).software}\"" in text)
    }
}
