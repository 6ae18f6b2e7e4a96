package org.camssf.passport

import org.camssf.InvalidArgument
import org.camssf.PassportInvalid
import org.camssf.photo.Photo
import java.security.GeneralSecurityException
import java.security.KeyPair
import java.security.ProviderException
import java.security.PublicKey
import java.security.SecureRandom
import java.security.Signature
import java.util.Collections
import kotlin.time.Clock
import kotlin.time.Instant

/**
 * A result with whose camera it is, since when and until when it holds, and made from what: what Python's `camssf passport`
 * signs and verifies, document for document (docs/passport.md). Signed it is a compact JWS with ES256; what was received is
 * what is verified. It cannot be changed, and may be passed between threads.
 *
 * @property id 32 hexadecimal digits, by chance.
 * @property issued whole seconds, as [begins] and [ends].
 * @property begins it is valid from then on.
 * @property ends it is no more valid then.
 * @property unit whose curves these are.
 * @property captured when the photo was taken, ISO 8601; "" where nobody said.
 * @property chartSerial of the chart; "" where nobody said.
 * @property lampSerials of each shot's lamp, likewise.
 * @property software the version of camssf that wrote it.
 * @property resultSha256 of the whole result's file, byte for byte.
 * @property result the excerpt of the result, JSON: what `Standardiser.read` takes. It holds curves, bands and verdict, not the
 *   covariance and the patches, so colours look about twice as uncertain as with the whole result.
 */
public class Passport internal constructor(
    public val id: String,
    public val issued: Instant,
    public val begins: Instant,
    public val ends: Instant,
    public val unit: CameraUnit,
    public val captured: String,
    public val chartSerial: String,
    lampSerials: List<String>,
    public val software: String,
    public val resultSha256: String,
    public val result: String,
) {
    public val lampSerials: List<String> = Collections.unmodifiableList(ArrayList(lampSerials))

    /** What is signed, as JSON: docs/passport.md has the table of its claims. */
    public fun toJson(): String = claims().joinToString(",", "{", "}") { (name, value) -> "\"$name\":$value" }

    /** Names, and values as JSON. */
    internal fun claims(): List<Pair<String, String>> {
        val lamps = lampSerials.joinToString(",", "[", "]") { Sound.quote(it) }
        return listOf(
            "format" to Sound.quote(Claims.FORMAT),
            "jti" to Sound.quote(id),
            "iat" to issued.epochSeconds.toString(),
            "nbf" to begins.epochSeconds.toString(),
            "exp" to ends.epochSeconds.toString(),
            "unit" to unit.toJson(),
            "captured" to Sound.quote(captured),
            "serials" to """{"chart":${Sound.quote(chartSerial)},"lamps":$lamps}""",
            "software" to """{"name":"camssf","version":${Sound.quote(software)}}""",
            "result_sha256" to Sound.quote(resultSha256),
            "result" to result,
        )
    }

    /**
     * The signed passport, to be kept and sent as these very bytes.
     *
     * @param keys on P-256, of the Android Keystore or of any provider; the private one is used and not kept, and its
     *   provider's words go into no message.
     * @throws InvalidArgument the key is another one or does not sign, the two are no pair, or the result has too many shots.
     */
    public fun sign(keys: KeyPair): ByteArray = sign(keys.public) { data ->
        try {
            Signature.getInstance("SHA256withECDSA").run {
                initSign(keys.private)
                update(data)
                sign()
            }
        } catch (error: GeneralSecurityException) {
            throw unfit(error)
        } catch (error: ProviderException) {
            throw unfit(error)
        }
    }

    /**
     * The same where the app signs itself.
     *
     * @param public of the key that [signer] signs with.
     */
    public fun sign(public: PublicKey, signer: PassportSigner): ByteArray {
        val point = P256.point(public)
        val payload = toJson()
        try {
            Claims.read(payload.toByteArray())
        } catch (error: PassportInvalid) { // what no verifier takes is not signed
            throw InvalidArgument(error.message, error.advice, cause = error)
        }
        val text = listOf(Parts.header(PassportKeys.name(point)), payload).joinToString(".") {
            Base64Url.encode(it.toByteArray())
        }
        if (text.length + SIGNATURE > LARGEST_PASSPORT) {
            throw InvalidArgument(
                "The passport would be larger than $LARGEST_PASSPORT bytes.",
                "Sign a result of fewer shots.",
            )
        }
        val data = text.toByteArray()
        val signature = P256.raw(signer.sign(data.copyOf()))
        if (signature == null || !P256.verify(point, data, data.size, signature)) {
            throw InvalidArgument(
                "What was signed does not fit the public key.",
                "Give a pair of keys on P-256, and sign by SHA256withECDSA.",
            )
        }
        return data + ".${Base64Url.encode(signature)}".toByteArray()
    }

    /** Without the result. */
    override fun toString(): String = "passport $id of $unit, valid from ${iso(begins)} to ${iso(ends)}"

    public companion object {
        private const val VERSION = "0.1.0"
        private const val LARGEST_DOCUMENT = 64 * 1024 * 1024
        private const val LONGEST_DAYS = 36500

        /** Characters of a signature, and the dot before it. */
        private const val SIGNATURE = 87

        /** Only its class: what a provider says of a private key is nobody's business. */
        private fun unfit(error: Exception) = InvalidArgument(
            "The private key does not sign (${error.javaClass.simpleName}).",
            "Give a private key on P-256; one that asks for its user first needs a PassportSigner.",
        )

        /**
         * A passport of a result, not yet signed.
         *
         * @param result the bytes of the file that `Calibrated.toJson` became.
         * @param said what the result does not hold; it must not contradict the photos.
         * @param now the time of issue.
         * @param photos that the result was made from, for what they say of the unit and of the time: of
         *   `Calibrated.capture.shots`, or of `Photo.read`.
         * @throws InvalidArgument the result is none, was refused, or what is said cannot be; or a photo is not the
         *   result's, or was taken by another unit.
         */
        @JvmStatic
        @JvmOverloads
        public fun create(
            result: ByteArray,
            said: PassportRequest = PassportRequest(),
            now: Instant = Clock.System.now(),
            photos: List<Photo> = emptyList(),
        ): Passport {
            val whole = document(result)
            val document = whole.values
            val camera = (document["camera"] as? Members)?.values ?: throw noResult("has no camera")
            val shots = document["shots"] as? List<*> ?: throw noResult("has no shots")
            if (document["format"] != "camssf-result/1") throw noResult("has another format")
            if ("ssf" !in document || ResultForm.isRefused(whole)) {
                throw InvalidArgument("The result was refused: it has no curves to sign.", "Calibrate again.")
            }
            if ("excerpt" in document) throw noResult("is the excerpt that a passport holds")
            val excerpt = Excerpt.of(whole)
            if (!ResultForm.holds(excerpt)) throw noResult("breaks its form")
            var unit = said.unit
            for (photo in photos) {
                if (shots.none { photo.sha256.isNotEmpty() && sha256(it) == photo.sha256 }) {
                    throw InvalidArgument(
                        "The result was not made from ${photo.name}.",
                        "Give the very file, or leave it out.",
                    )
                }
                unit = unit.agreed(CameraUnit.of(photo), photo.name)
            }
            val told = CameraUnit(camera["make"] as? String ?: "", camera["model"] as? String ?: "")
            val times = listOf(said.captured) + photos.map { it.captured }
            val lamps = said.lampSerials.ifEmpty { List(shots.size) { "" } }
            if (lamps.size != shots.size) {
                throw InvalidArgument(
                    "${lamps.size} serials of lamps for ${shots.size} shots.",
                    "Give one a shot, in their order.",
                )
            }
            if (!(said.days > 0 && said.days <= LONGEST_DAYS)) {
                throw InvalidArgument("Valid for ${said.days} days.", "Give more than 0 and at most $LONGEST_DAYS.")
            }
            val begins = (said.begins ?: now).epochSeconds
            val ends = end(begins, said.days)
            if (now.epochSeconds !in
                0 until AFTER_ALL
            ) {
                throw InvalidArgument("It is issued at $now.", "Set the clock.")
            }
            return Passport(
                id = hex(ByteArray(16).also { SecureRandom().nextBytes(it) }),
                issued = second(now.epochSeconds),
                begins = second(begins),
                ends = second(ends),
                unit = unit.agreed(told, "the result"),
                captured = captured(times.firstOrNull { it.isNotEmpty() }.orEmpty()),
                chartSerial = said.chartSerial,
                lampSerials = lamps,
                software = VERSION,
                resultSha256 = hex(PassportKeys.sha256(result)),
                result = Sound.write(excerpt),
            ).also { it.unit.toJson() }
        }

        /** Of a shot's photo. */
        private fun sha256(shot: Any?): Any? {
            val photo = (shot as? Members)?.values?.get("photo") as? Members
            return photo?.values?.get("sha256")
        }

        private fun document(result: ByteArray): Members {
            if (result.size > LARGEST_DOCUMENT) throw noResult("is larger than $LARGEST_DOCUMENT bytes")
            return try {
                Sound.parse(Sound.text(result)) as? Members ?: throw noResult("is no object")
            } catch (error: UnsoundException) {
                throw noResult("is not sound JSON (${error.message})")
            }
        }

        private fun noResult(why: String) = InvalidArgument(
            "The result $why.",
            "Give the bytes of a \"camssf-result/1\", as Calibration.toJson has it.",
        )

        private fun hex(data: ByteArray): String =
            data.joinToString("") { (it.toInt() and 0xff).toString(16).padStart(2, '0') }

        /**
         * The passport, if it is one: whole, signed by a trusted key, in its form and time, not called back.
         *
         * @param data as received.
         * @param trusted public keys, of [PassportKeys.readPublic] or any provider.
         * @param revoked of [PassportKeys.readRevoked].
         * @param now at what time.
         * @param result the bytes of the whole result's file, which it shall belong to.
         * @throws PassportInvalid anything of it is not as it must be.
         * @throws InvalidArgument a trusted key is not on P-256.
         */
        @JvmStatic
        @JvmOverloads
        public fun verify(
            data: ByteArray,
            trusted: Collection<PublicKey>,
            revoked: Set<String> = emptySet(),
            now: Instant = Clock.System.now(),
            result: ByteArray? = null,
        ): Passport {
            val received = data.copyOf() // what is verified is what is read, whatever the caller does meanwhile
            val points = PassportKeys.points(trusted)
            checkSize(received)
            val parts = Parts.verified(received, Parts.PASSPORT, points, Parts.WHAT)
            val passport = Claims.read(parts.payload)
            check(passport, parts.kid, revoked, now)
            if (result != null) checkBelongs(passport, result)
            return passport
        }

        private fun checkSize(data: ByteArray) {
            if (data.size > LARGEST_PASSPORT) {
                throw PassportInvalid(
                    "The passport is larger than $LARGEST_PASSPORT bytes.",
                    Parts.advice(Parts.WHAT),
                )
            }
        }

        /** The very bytes that were signed, and the excerpt is what they hold. */
        private fun checkBelongs(passport: Passport, result: ByteArray) {
            if (hex(PassportKeys.sha256(result)) != passport.resultSha256) {
                throw PassportInvalid("The passport is of another result.", "Give the very file that was signed.")
            }
            val whole = try {
                document(result)
            } catch (error: InvalidArgument) {
                val words = "The result that was signed is not in the form of one."
                throw PassportInvalid(words, Parts.advice(Parts.WHAT), cause = error)
            }
            if (!Sound.isSame(Excerpt.of(whole), Sound.parse(passport.result))) {
                throw PassportInvalid(
                    "The passport's excerpt is not what the signed result holds.",
                    Parts.advice(Parts.WHAT),
                )
            }
        }

        private fun check(passport: Passport, kid: String, revoked: Set<String>, now: Instant) {
            for ((name, what) in listOf(passport.id to "The passport", kid to "The key that signed it")) {
                if (name in revoked) throw PassportInvalid("$what was called back ($name).", "Calibrate again.")
            }
            if (now < passport.begins) {
                throw PassportInvalid(
                    "The passport is not valid before ${iso(passport.begins)}.",
                    "Wait, or look at the clock.",
                )
            }
            if (now >= passport.ends) {
                throw PassportInvalid("The passport ended at ${iso(passport.ends)}.", "Calibrate again.")
            }
        }

        /**
         * What a passport says, and by what key it says it is signed. Nothing of it is verified.
         *
         * @throws PassportInvalid it has not the form of one.
         */
        @JvmStatic
        public fun show(data: ByteArray): Shown {
            val received = data.copyOf()
            checkSize(received)
            val parts = Parts.read(received, Parts.PASSPORT, Parts.WHAT)
            return Shown(Claims.read(parts.payload), parts.kid)
        }
    }
}
