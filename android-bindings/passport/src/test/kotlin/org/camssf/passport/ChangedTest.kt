package org.camssf.passport

import org.camssf.PassportInvalid
import org.camssf.passport.Fixtures.refused
import org.junit.jupiter.api.Assertions.assertEquals
import org.junit.jupiter.api.Assertions.assertNotNull
import org.junit.jupiter.api.Tag
import org.junit.jupiter.api.Test
import org.junit.jupiter.api.assertThrows
import java.math.BigInteger
import java.util.Random
import javax.crypto.Mac
import javax.crypto.spec.SecretKeySpec

/** No byte can be changed without the key. Seeded: the same changes at every run, of the passports that are stored. */
@Tag("R-PASSPORT")
class ChangedTest {
    private val small = Fixtures.case("small").data
    private val whole = Fixtures.case("whole").data
    private val dot = '.'.code.toByte()

    private fun verified(data: ByteArray): Passport =
        Passport.verify(data, listOf(Fixtures.SIGNER), now = Fixtures.LATER)

    @Test
    fun `any bit matters`() {
        val keys = Fixtures.pair()
        val points = PassportKeys.points(listOf(keys.public))
        fun read(data: ByteArray) = Parts.verified(data, Parts.PASSPORT, points, "it")
        val head = Base64Url.encode(Parts.header(PassportKeys.name(keys.public)).toByteArray())
        val text = "$head.${Base64Url.encode("{\"a\":1}".toByteArray())}".toByteArray()
        val short = text + ".${Base64Url.encode(P256.raw(Fixtures.ecdsa(keys, text))!!)}".toByteArray()
        assertEquals("{\"a\":1}", String(read(short).payload))
        var count = 0
        for (i in short.indices) {
            val before = short.copyOf(i)
            val behind = short.copyOfRange(i + 1, short.size)
            val changed = (0..7).map { before + (short[i].toInt() xor (1 shl it)).toByte() + behind } +
                listOf(before + behind, before + short[i] + short[i] + behind, before)
            for (each in changed.filterNot { it.contentEquals(short) }) {
                assertThrows<PassportInvalid> { read(each) }
                count++
            }
        }
        assertEquals(11 * short.size, count)
    }

    @Test
    fun `a thousand changed passports of a whole result`() {
        assertNotNull(verified(whole))
        val dice = Random(19)
        var count = 0
        while (count < 1_000) {
            val other = mutated(whole, dice)
            if (other.contentEquals(whole)) continue
            refused(other, Fixtures.SIGNER)
            count++
        }
    }

    /** What a disk, a mail program or an attacker without a key may do. */
    private fun mutated(data: ByteArray, dice: Random): ByteArray {
        val (i, j) = listOf(dice.nextInt(data.size), dice.nextInt(data.size)).sorted()
        val some = ByteArray(1 + dice.nextInt(8)) { LETTERS[dice.nextInt(64)].code.toByte() }
        val head = data.copyOf(i)
        val rest = data.copyOfRange(i, data.size)
        val both = Fixtures.signature(data)
        val r = Fixtures.number(both, 0)
        val s = Fixtures.number(both, 32)
        return when (dice.nextInt(9)) {
            0 -> head + data.copyOfRange(j, data.size)
            1 -> head + some + rest
            2 -> head + some + rest.drop(some.size)
            3 -> head + dice.nextInt(256).toByte() + rest.drop(1)
            4 -> head + data.copyOfRange(i, j).reversedArray() + data.copyOfRange(j, data.size)
            5 -> Fixtures.withSignature(data, Fixtures.signature(small))
            6 -> Fixtures.withSignature(data, Fixtures.numbers(r, s.add(below(dice)).mod(P256.order)))
            7 -> Fixtures.withSignature(data, Fixtures.numbers(below(dice), s))
            else -> withClaim(data, dice)
        }
    }

    private fun below(dice: Random): BigInteger =
        BigInteger(256, dice).mod(P256.order - BigInteger.ONE) + BigInteger.ONE

    /** One digit of the payload's text is another, written well; the signature stays. */
    private fun withClaim(data: ByteArray, dice: Random): ByteArray {
        val (first, last) = data.indexOf(dot) to data.lastIndexOf(dot)
        val text = Base64Url.decode(data, first + 1, last)!!
        val digits = text.indices.filter { text[it] in '0'.code..'9'.code }
        val at = digits[dice.nextInt(digits.size)]
        text[at] = ('0'.code + (text[at] - '0'.code + 1 + dice.nextInt(9)) % 10).toByte()
        return data.copyOf(first + 1) + Base64Url.encode(text).toByteArray() + data.copyOfRange(last, data.size)
    }

    @Test
    fun `swapped algorithms`() {
        val (_, payload, signature) = String(small).split(".")
        val pem = Fixtures.pem("signer").toByteArray()
        for (alg in listOf("none", "HS256", "ES256")) {
            val head = """{"alg":"$alg","kid":"${Fixtures.keyName("signer")}","typ":"camssf-passport+jwt"}"""
            val text = Base64Url.encode(head.toByteArray()) + "." + payload
            val mac = Mac.getInstance("HmacSHA256").run {
                init(SecretKeySpec(pem, "HmacSHA256"))
                doFinal(text.toByteArray())
            }
            for (last in listOf("", Base64Url.encode(mac), Base64Url.encode(mac + mac), signature)) {
                if (alg != "ES256" || last != signature) refused("$text.$last".toByteArray(), Fixtures.SIGNER)
            }
        }
    }

    @Test
    fun `a foreign signature`() {
        val keys = Fixtures.pair()
        val foreign = Passport.create(Fixtures.SMALL.toByteArray(), now = Fixtures.LATER).sign(keys)
        refused(foreign, Fixtures.SIGNER, "not trusted")
        refused(small, keys.public, "not trusted")
        val both = listOf(Fixtures.SIGNER, keys.public)
        for (data in listOf(foreign, small)) assertNotNull(Passport.verify(data, both, now = Fixtures.LATER))
        val named = small.copyOf(small.lastIndexOf(dot))
        val raw = P256.raw(Fixtures.ecdsa(keys, named))!!
        refused(named + ".${Base64Url.encode(raw)}".toByteArray(), Fixtures.SIGNER, "does not match")
        assertThrows<PassportInvalid> { Passport.verify(small, emptyList()) }
    }

    /** (r, s) and (r, n - s) are both valid ES256: a signature's bytes identify nothing. */
    @Test
    fun `both signatures that fit are accepted`() {
        val both = Fixtures.signature(small)
        val (r, s) = Fixtures.number(both, 0) to Fixtures.number(both, 32)
        for (each in listOf(s, P256.order - s)) {
            assertNotNull(verified(Fixtures.withSignature(small, Fixtures.numbers(r, each))))
        }
        for (pair in listOf(Fixtures.numbers(r, P256.order), Fixtures.numbers(r, BigInteger.ZERO))) {
            refused(Fixtures.withSignature(small, pair), Fixtures.SIGNER, "not a valid pair")
        }
    }

    @Test
    fun `not a passport`() {
        val noise = ByteArray(4096).also { Random(3).nextBytes(it) }
        val texts = listOf("", ".", "..", "...", "a.b.c", "A".repeat(1_000_000), ".".repeat(100_000), "{}")
        for (data in texts.map { it.toByteArray() } + noise + Fixtures.RESULT) {
            refused(data, Fixtures.SIGNER)
            assertThrows<PassportInvalid> { Passport.show(data) }
        }
    }

    private companion object {
        const val LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"
    }
}
