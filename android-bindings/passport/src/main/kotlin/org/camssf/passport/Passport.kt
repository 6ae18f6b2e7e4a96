package org.camssf.passport

import org.camssf.Camssf
import org.camssf.InvalidArgument
import org.camssf.PassportInvalid
import org.camssf.Refusal
import org.camssf.UnitDiffers
import org.camssf.json.JsonText
import org.camssf.json.NotJson
import org.camssf.photo.DocumentForm
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
 * A signed excerpt of a result with the camera unit, capture time and validity period.
 *
 * Python's `camssf passport` signs and verifies the same documents (docs/passport.md). A signed passport is a compact
 * JWS with ES256; the received bytes are verified without being decoded and written again. Instances are immutable
 * and may be passed between threads; creating, signing and verifying block, so any thread but the main one.
 *
 * ```kotlin
 * fun sign(result: ByteArray, serial: String, keys: KeyPair): ByteArray =
 *     Passport.create(result, PassportRequest(CameraUnit(serial = serial), days = 90.0)).sign(keys)
 *
 * fun curves(received: ByteArray, signer: PublicKey): String = Passport.verify(received, listOf(signer)).result
 * ```
 *
 * @property id 32 random hexadecimal digits.
 * @property issued time of issue, in whole seconds like [begins] and [ends].
 * @property begins start of validity.
 * @property ends end of validity; at this time it is no longer valid.
 * @property unit the camera unit that the curves belong to.
 * @property captured when the photo was taken, ISO 8601; "" if unknown.
 * @property chartSerial serial number of the chart; "" if unknown.
 * @property lampSerials serial number of each shot's lamp; "" if unknown.
 * @property software version of camssf that wrote it.
 * @property resultSha256 SHA-256 of the whole result's file.
 * @property result the excerpt of the result, JSON, for `Standardiser.read`. It holds curves, bands and verdict, but
 *   neither the covariance nor the patches, so colours look about twice as uncertain as with the whole result.
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

    /** The payload as JSON; docs/passport.md has the table of its claims. */
    public fun toJson(): String = claims().joinToString(",", "{", "}") { (name, value) -> "\"$name\":$value" }

    /**
     * Refuses a photo of another unit, before its colours are computed with the curves of this passport. What the
     * passport or the photo does not state is not compared; zoom and aperture may differ.
     *
     * @throws UnitDiffers maker, model, camera, serial number or lens differ.
     */
    public fun checkPhoto(photo: Photo) {
        val differ = CameraUnit.of(photo).differing(unit)
        if (differ.isEmpty()) return
        throw Refusal.of("unit_differs.passport", "file" to photo.name, "differences" to differ.joinToString("; "))
    }

    /** Names of the claims, and their values as JSON. */
    internal fun claims(): List<Pair<String, String>> {
        val lamps = lampSerials.joinToString(",", "[", "]") { PassportJson.write(it) }
        return listOf(
            "format" to PassportJson.write(Claims.FORMAT),
            "jti" to PassportJson.write(id),
            "iat" to issued.epochSeconds.toString(),
            "nbf" to begins.epochSeconds.toString(),
            "exp" to ends.epochSeconds.toString(),
            "unit" to unit.toJson(),
            "captured" to PassportJson.write(captured),
            "serials" to """{"chart":${PassportJson.write(chartSerial)},"lamps":$lamps}""",
            "software" to """{"name":"camssf","version":${PassportJson.write(software)}}""",
            "result_sha256" to PassportJson.write(resultSha256),
            "result" to result,
        )
    }

    /**
     * Signs the passport; keep and send these bytes unchanged.
     *
     * @param keys a pair on P-256, from the Android Keystore or any other provider. The private key is used and not
     *   kept, and no message contains its provider's text.
     * @throws InvalidArgument the key is of another kind or cannot sign, the two keys are not a pair, or the result
     *   has too many shots.
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
     * Signs the passport with the app's own signer.
     *
     * @param public public key of the key that [signer] signs with.
     * @throws InvalidArgument the key is of another kind, the signature does not match it, or the result has too many
     *   shots.
     */
    public fun sign(public: PublicKey, signer: PassportSigner): ByteArray {
        val point = P256.point(public)
        val payload = toJson()
        try {
            Claims.read(payload.toByteArray())
        } catch (error: PassportInvalid) { // do not sign what every verifier rejects
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

    /** One line, without the result. */
    override fun toString(): String = "passport $id of $unit, valid from ${iso(begins)} to ${iso(ends)}"

    public companion object {
        private const val LONGEST_DAYS = 36500

        /** Number of characters of a signature and the dot before it. */
        private const val SIGNATURE = 87

        /** Names only the exception's class, because a provider's message may contain details of a private key. */
        private fun unfit(error: Exception) = InvalidArgument(
            "The private key does not sign (${error.javaClass.simpleName}).",
            "Give a private key on P-256; one that asks for its user first needs a PassportSigner.",
        )

        /**
         * Creates an unsigned passport of a result.
         *
         * @param result the bytes of the file that was written from `Recovered.toJson`.
         * @param said what the signer states in addition to the result; it must not contradict the photos.
         * @param now time of issue.
         * @param photos photos that the result was made from, of `Recovered.capture.shots` or from `Photo.read`;
         *   their metadata give the unit and the time.
         * @throws InvalidArgument the result is invalid or was refused, a statement is impossible, a photo does not
         *   belong to the result, or a photo is from another unit.
         */
        @JvmStatic
        @JvmOverloads
        public fun create(
            result: ByteArray,
            said: PassportRequest = PassportRequest(),
            now: Instant = Clock.System.now(),
            photos: List<Photo> = emptyList(),
        ): Passport {
            val document = document(result)
            val capture = document.capture
            if (document.answer == null || capture == null) {
                throw InvalidArgument("The result was refused: it has no curves to sign.", "Calibrate again.")
            }
            val shots = capture.shots
            val excerpt = Excerpt.of(document)
            var unit = said.unit
            for (photo in photos) {
                if (shots.none { photo.sha256.isNotEmpty() && it.photo.sha256 == photo.sha256 }) {
                    throw InvalidArgument(
                        "The result was not made from ${photo.name}.",
                        "Give the original file, or leave it out.",
                    )
                }
                unit = unit.agreed(CameraUnit.of(photo), photo.name)
            }
            val ofPhoto = shots[0].photo.let { CameraUnit(it.make, it.model) }
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
                unit = unit.agreed(ofPhoto, "the result"),
                captured = captured(times.firstOrNull { it.isNotEmpty() }.orEmpty()),
                chartSerial = said.chartSerial,
                lampSerials = lamps,
                software = Camssf.VERSION,
                resultSha256 = hex(PassportKeys.sha256(result)),
                result = PassportJson.write(excerpt),
            ).also { it.unit.toJson() }
        }

        private fun document(result: ByteArray): DocumentForm {
            val text = try {
                PassportJson.text(result)
            } catch (error: NotJson) {
                throw InvalidArgument("The result is not valid JSON (${error.message}).", DocumentForm.ADVICE)
            }
            return DocumentForm.read(text, "The result")
        }

        private fun hex(data: ByteArray): String =
            data.joinToString("") { (it.toInt() and 0xff).toString(16).padStart(2, '0') }

        /**
         * Verifies a passport: unchanged, signed by a trusted key, valid in form and time, not revoked.
         *
         * @param data as received.
         * @param trusted public keys, from [PassportKeys.readPublic] or any provider.
         * @param revoked names from [PassportKeys.readRevoked].
         * @param now time of the check.
         * @param result bytes of the whole result's file that the passport must belong to; null to skip this check.
         * @throws PassportInvalid one of these checks fails.
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
            val received = data.copyOf() // the caller may change its array during the check
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

        /** Throws unless the passport belongs to that result: the SHA-256 of its bytes and the excerpt must match. */
        private fun checkBelongs(passport: Passport, result: ByteArray) {
            if (hex(PassportKeys.sha256(result)) != passport.resultSha256) {
                throw PassportInvalid("The passport belongs to another result.", "Give the file that was signed.")
            }
            val whole = try {
                document(result)
            } catch (error: InvalidArgument) {
                val words = "The result that was signed is not in the form of one."
                throw PassportInvalid(words, Parts.advice(Parts.WHAT), cause = error)
            }
            if (whole.answer == null || !PassportJson.isSame(Excerpt.of(whole), JsonText.parse(passport.result))) {
                throw PassportInvalid(
                    "The passport's excerpt differs from the signed result.",
                    Parts.advice(Parts.WHAT),
                )
            }
        }

        private fun check(passport: Passport, kid: String, revoked: Set<String>, now: Instant) {
            for ((name, what) in listOf(passport.id to "The passport", kid to "The key that signed it")) {
                if (name in revoked) throw PassportInvalid("$what was revoked ($name).", "Calibrate again.")
            }
            if (now < passport.begins) {
                throw PassportInvalid(
                    "The passport is not valid before ${iso(passport.begins)}.",
                    "Wait, or check this computer's clock.",
                )
            }
            if (now >= passport.ends) {
                throw PassportInvalid("The passport ended at ${iso(passport.ends)}.", "Calibrate again.")
            }
        }

        /**
         * Reads a passport and the name of its key, without verifying anything.
         *
         * @throws PassportInvalid the form is wrong.
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
