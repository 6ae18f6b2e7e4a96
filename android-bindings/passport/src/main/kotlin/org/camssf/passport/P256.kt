package org.camssf.passport

import org.camssf.InvalidArgument
import java.math.BigInteger
import java.security.GeneralSecurityException
import java.security.KeyFactory
import java.security.PublicKey
import java.security.Signature
import java.security.interfaces.ECPublicKey
import java.security.spec.ECFieldFp
import java.security.spec.X509EncodedKeySpec

/**
 * The curve of all passports, P-256 (FIPS 186-5), and the two forms of its ECDSA signatures: DER, as in
 * `java.security`, and r and s in 32 bytes each, as in a JWS.
 */
internal object P256 {
    private val prime = number("FFFFFFFF00000001000000000000000000000000FFFFFFFFFFFFFFFFFFFFFFFF")
    private val a = prime - BigInteger.valueOf(3)
    private val b = number("5AC635D8AA3A93E7B3EBBD55769886BC651D06B0CC53B0F63BCE3C3E27D2604B")
    private val generatorX = number("6B17D1F2E12C4247F8BCE6E563A440F277037D812DEB33A0F4A13945D898C296")
    private val generatorY = number("4FE342E2FE1A7F9B8EE7EB4A7C0F9E162BCE33576B315ECECBB6406837BF51F5")

    /** n: the order of the generator. */
    val order = number("FFFFFFFF00000000FFFFFFFFFFFFFFFFBCE6FAADA7179E84F3B9CAC2FC632551")

    /** First bytes of every SubjectPublicKeyInfo of this curve; x and y follow. */
    private val head = number("3059301306072A8648CE3D020106082A8648CE3D03010703420004").toByteArray()

    /**
     * x and y of a key, 64 bytes.
     *
     * @throws InvalidArgument the key is not on P-256.
     */
    fun point(key: PublicKey): ByteArray {
        if (key !is ECPublicKey) throw foreign()
        val form = key.params
        val same = (form.curve.field as? ECFieldFp)?.p == prime && form.curve.a.mod(prime) == a &&
            form.curve.b == b && form.order == order && form.cofactor == 1 &&
            form.generator.affineX == generatorX && form.generator.affineY == generatorY
        if (!same || !isOn(key.w.affineX, key.w.affineY)) throw foreign()
        return fixed(key.w.affineX) + fixed(key.w.affineY)
    }

    /**
     * x and y, 64 bytes, of a SubjectPublicKeyInfo in DER, which has only one form.
     *
     * @throws InvalidArgument the key is not on P-256.
     */
    fun point(info: ByteArray): ByteArray {
        val fits = info.size == head.size + 64 && info.copyOf(head.size).contentEquals(head)
        if (!fits) throw foreign()
        val point = info.copyOfRange(head.size, info.size)
        if (!isOn(unsigned(point, 0), unsigned(point, 32))) throw foreign()
        return point
    }

    /** A key of the platform's default provider, because a Keystore's own public key may be unable to verify. */
    fun key(point: ByteArray): PublicKey =
        KeyFactory.getInstance("EC").generatePublic(X509EncodedKeySpec(head + point))

    private fun isOn(x: BigInteger, y: BigInteger): Boolean =
        listOf(x, y).all { it.signum() >= 0 && it < prime } &&
            (y * y - x * x * x - a * x - b).mod(prime).signum() == 0

    private fun foreign() = InvalidArgument(
        "This is not a public key on the curve P-256.",
        "Make one with KeyPairGenerator, \"EC\" and the curve secp256r1, or with `camssf passport key`.",
    )

    /**
     * True if [signature] is a signature of the first [length] bytes; r and s must be in their bounds ([isInBounds]).
     */
    fun verify(point: ByteArray, data: ByteArray, length: Int, signature: ByteArray): Boolean = try {
        Signature.getInstance("SHA256withECDSA").run {
            initVerify(key(point))
            update(data, 0, length)
            verify(der(unsigned(signature, 0), unsigned(signature, 32)))
        }
    } catch (_: GeneralSecurityException) {
        false
    }

    /**
     * True if 0 < r < n and 0 < s < n. (r, s) and (r, n - s) are both valid, so a signature's bytes are not an
     * identifier.
     */
    fun isInBounds(signature: ByteArray): Boolean {
        val r = unsigned(signature, 0)
        val s = unsigned(signature, 32)
        return r.signum() > 0 && r < order && s.signum() > 0 && s < order
    }

    /** r and s of a signature in DER, 64 bytes; null if it is not a signature of this curve. */
    fun raw(der: ByteArray): ByteArray? {
        if (der.size !in 8..72 || der[0].toInt() != 0x30 || der[1].toInt() != der.size - 2) return null
        val numbers = ArrayList<BigInteger>()
        var at = 2
        while (at + 2 < der.size) {
            val end = at + 2 + der[at + 1]
            if (der[at].toInt() != 0x02 || end <= at + 2 || end > der.size) return null
            numbers += BigInteger(der.copyOfRange(at + 2, end))
            at = end
        }
        if (at != der.size || numbers.size != 2 || numbers.any { it.signum() <= 0 || it >= order }) return null
        return fixed(numbers[0]) + fixed(numbers[1])
    }

    private fun der(r: BigInteger, s: BigInteger): ByteArray {
        val body = listOf(r, s).map { it.toByteArray() }.fold(ByteArray(0)) { all, each ->
            all + byteArrayOf(0x02, each.size.toByte()) + each
        }
        return byteArrayOf(0x30, body.size.toByte()) + body
    }

    private fun number(hex: String) = BigInteger(hex, 16)

    private fun unsigned(data: ByteArray, from: Int) = BigInteger(1, data.copyOfRange(from, from + 32))

    private fun fixed(number: BigInteger): ByteArray {
        val bytes = number.toByteArray()
        val out = ByteArray(32)
        val count = minOf(32, bytes.size)
        bytes.copyInto(out, 32 - count, bytes.size - count)
        return out
    }
}
