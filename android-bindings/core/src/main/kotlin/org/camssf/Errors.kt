package org.camssf

/**
 * All errors of camssf: a tree of classes with one code for each leaf, the same in Python, Kotlin and JSON. Its three
 * branches are misuse, which the app's code causes and no result contains; refusals, which a [Refused] result states;
 * and passports. RuntimeUnfit is Kotlin's alone: [SsfCalibrator.open] throws it.
 *
 * ```
 * CalibrationException
 * ├── Misuse                                         the app's code, or its packaging
 * │   ├── InvalidArgument        invalid_argument    the call itself
 * │   └── RuntimeUnfit           runtime_unfit       ONNX Runtime, missing or of a version that reports its use
 * ├── Refusal                                        the photos, from which no result can be computed
 * │   ├── RawError                                   the file or frame
 * │   │   ├── UnreadableRaw      unreadable_raw
 * │   │   ├── UnsupportedRaw     unsupported_raw
 * │   │   └── NotSensorRaw       not_sensor_raw
 * │   ├── ChartError                                 the chart in the photo
 * │   │   ├── ChartNotFound      chart_not_found
 * │   │   └── ChartUnfit         chart_unfit
 * │   ├── CaptureError                               how the photo was taken
 * │   │   ├── Overexposed        overexposed
 * │   │   ├── Underexposed       underexposed
 * │   │   ├── BandsTooWide       bands_too_wide
 * │   │   ├── UnevenLight        uneven_light
 * │   │   ├── FramesDiffer       frames_differ
 * │   │   ├── UnitDiffers        unit_differs
 * │   │   ├── Blurred            blurred
 * │   │   └── Glare              glare
 * │   ├── LampUnfit              lamp_unfit          the light
 * │   ├── NotConverged           not_converged       the solver's duality gap
 * │   ├── CameraUnusual          camera_unusual      the camera, unlike those of every basis
 * │   ├── ColourOutOfReach       colour_out_of_reach a colour that no surface can have
 * │   └── OutOfMemory            out_of_memory       the photo, too large for the free memory
 * └── PassportInvalid            passport_invalid    a signed document
 * ```
 *
 * @property reason what is wrong, with its key and arguments, by which an app says it in its user's language.
 */
public sealed class CalibrationException(
    public val reason: Reason,
    cause: Throwable?,
) : RuntimeException(reason.message, cause) {
    /** The error code, the same in every language. */
    public val code: String get() = reason.code

    /** What is wrong, with the file or patch concerned. */
    override val message: String get() = reason.message

    /** What to do next. */
    public val advice: String get() = reason.advice

    /** The number that decided, if there is one. */
    public val value: Double? get() = reason.value

    /** The bound that it broke, if there is one. */
    public val threshold: Double? get() = reason.threshold

    /** Code, message and advice. */
    override fun toString(): String = reason.toString()
}

/** The app's code, or its packaging, is wrong: an error to be corrected, not to be shown to a user. */
public sealed class Misuse(reason: Reason, cause: Throwable?) : CalibrationException(reason, cause)

/** An argument has a wrong shape, value or name. */
public class InvalidArgument(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : Misuse(Reason("invalid_argument", message, advice, value, threshold), cause)

/** ONNX Runtime is missing, cannot load its native library, or is of a version that camssf does not run with. */
public class RuntimeUnfit(message: String, advice: String, cause: Throwable? = null) :
    Misuse(Reason("runtime_unfit", message, advice, null, null), cause)

/** A passport was changed, has expired, was revoked, or is not signed by a trusted key: do not trust its content. */
public class PassportInvalid(message: String, advice: String, cause: Throwable? = null) :
    CalibrationException(Reason("passport_invalid", message, advice, null, null), cause)

/** Files, photos or light from which no result can be computed; [reason] says why, and what to do. */
public sealed class Refusal(reason: Reason, cause: Throwable?) : CalibrationException(reason, cause) {
    public companion object {
        /** The classes by their codes. */
        private val KINDS: Map<String, (Reason, Throwable?) -> Refusal> = mapOf(
            "unreadable_raw" to ::UnreadableRaw,
            "unsupported_raw" to ::UnsupportedRaw,
            "not_sensor_raw" to ::NotSensorRaw,
            "chart_not_found" to ::ChartNotFound,
            "chart_unfit" to ::ChartUnfit,
            "overexposed" to ::Overexposed,
            "underexposed" to ::Underexposed,
            "bands_too_wide" to ::BandsTooWide,
            "uneven_light" to ::UnevenLight,
            "frames_differ" to ::FramesDiffer,
            "unit_differs" to ::UnitDiffers,
            "blurred" to ::Blurred,
            "glare" to ::Glare,
            "lamp_unfit" to ::LampUnfit,
            "not_converged" to ::NotConverged,
            "camera_unusual" to ::CameraUnusual,
            "colour_out_of_reach" to ::ColourOutOfReach,
            "out_of_memory" to ::OutOfMemory,
        )

        /**
         * The error with a message of messages.json, for a [org.camssf.photo.PhotoSource] of the app, and for its tests.
         *
         * @param key of the message, for example "unreadable_raw.missing".
         * @param arguments values of its placeholders, texts and numbers.
         * @throws InvalidArgument there is no such message, or a placeholder has no value.
         */
        @JvmStatic
        @JvmOverloads
        public fun of(
            key: String,
            arguments: Map<String, Any>,
            value: Double? = null,
            threshold: Double? = null,
            cause: Throwable? = null,
        ): Refusal = try {
            of(Messages.reason(key, arguments, value, threshold, fatal = true), cause)
        } catch (error: NoSuchElementException) {
            val advice = "Take a key of messages.json, and give each of its placeholders."
            throw InvalidArgument("The message $key cannot be said: ${error.message}", advice, cause = error)
        }

        /** The same for Kotlin: `Refusal.of("unreadable_raw.missing", "file" to name)`. */
        @JvmSynthetic
        public fun of(
            key: String,
            vararg arguments: Pair<String, Any>,
            value: Double? = null,
            threshold: Double? = null,
            cause: Throwable? = null,
        ): Refusal = of(key, mapOf(*arguments), value, threshold, cause)

        /**
         * The error that gives this reason.
         *
         * @throws InvalidArgument this version of camssf has no refusal of this code.
         */
        internal fun of(reason: Reason, cause: Throwable? = null): Refusal {
            val make = KINDS[reason.code] ?: throw InvalidArgument(
                "There is no refusal with the code ${reason.code}.", "Read the result with the camssf that wrote it.",
            )
            return make(reason, cause)
        }
    }
}

/** The file cannot serve as a photo of the sensor. */
public sealed class RawError(reason: Reason, cause: Throwable?) : Refusal(reason, cause)

/** The file is missing, truncated, damaged, or not an image. */
public class UnreadableRaw internal constructor(reason: Reason, cause: Throwable?) : RawError(reason, cause)

/** The file is valid, but camssf does not support its format. */
public class UnsupportedRaw internal constructor(reason: Reason, cause: Throwable?) : RawError(reason, cause)

/** The samples are not the sensor's: demosaiced, merged or tone-mapped. */
public class NotSensorRaw internal constructor(reason: Reason, cause: Throwable?) : RawError(reason, cause)

/** The chart in the photo, or its table, cannot be used. */
public sealed class ChartError(reason: Reason, cause: Throwable?) : Refusal(reason, cause)

/** The photo shows no chart of the requested kind, or shows it mirrored. */
public class ChartNotFound internal constructor(reason: Reason, cause: Throwable?) : ChartError(reason, cause)

/** The chart does not agree with its table, or too few patches are left. */
public class ChartUnfit internal constructor(reason: Reason, cause: Throwable?) : ChartError(reason, cause)

/** The photo was taken in a way from which no curves can be recovered. */
public sealed class CaptureError(reason: Reason, cause: Throwable?) : Refusal(reason, cause)

/** Too many samples are clipped. */
public class Overexposed internal constructor(reason: Reason, cause: Throwable?) : CaptureError(reason, cause)

/** The signals are too close to the black level. */
public class Underexposed internal constructor(reason: Reason, cause: Throwable?) : CaptureError(reason, cause)

/** The photos leave the curves too uncertain. */
public class BandsTooWide internal constructor(reason: Reason, cause: Throwable?) : CaptureError(reason, cause)

/** The light varies across the chart and no white frame corrects it. */
public class UnevenLight internal constructor(reason: Reason, cause: Throwable?) : CaptureError(reason, cause)

/** Chart, white and dark frame were taken with different settings. */
public class FramesDiffer internal constructor(reason: Reason, cause: Throwable?) : CaptureError(reason, cause)

/** The photos are from different physical cameras or lenses. */
public class UnitDiffers internal constructor(reason: Reason, cause: Throwable?) : CaptureError(reason, cause)

/** Neighbouring patches are blurred into each other. */
public class Blurred internal constructor(reason: Reason, cause: Throwable?) : CaptureError(reason, cause)

/** Stray light lies over the chart. */
public class Glare internal constructor(reason: Reason, cause: Throwable?) : CaptureError(reason, cause)

/** The lamp's spectrum has no power on the grid, or contradicts the photo. */
public class LampUnfit internal constructor(reason: Reason, cause: Throwable?) : Refusal(reason, cause)

/** The duality gap of the answer is too large: the curves cannot be trusted. */
public class NotConverged internal constructor(reason: Reason, cause: Throwable?) : Refusal(reason, cause)

/**
 * The camera is unlike all cameras that the bases were learned from, or of another family than its maker's name
 * suggests. In this version it makes a result doubtful, as a reason with this code, and never refuses it.
 */
public class CameraUnusual internal constructor(reason: Reason, cause: Throwable?) : Refusal(reason, cause)

/** No surface can have this colour under this lamp. */
public class ColourOutOfReach internal constructor(reason: Reason, cause: Throwable?) : Refusal(reason, cause)

/** The photo does not fit into the memory available to the program. */
public class OutOfMemory internal constructor(reason: Reason, cause: Throwable?) : Refusal(reason, cause)
