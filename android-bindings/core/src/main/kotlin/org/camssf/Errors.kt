package org.camssf

/**
 * Every way camssf says no: one tree, one code a leaf, the same codes in Python, Kotlin and JSON.
 *
 * ```
 * CalibrationException
 * ├── InvalidArgument        invalid_argument    the call itself is wrong
 * ├── RawError                                   the file or frame
 * │   ├── UnreadableRaw      unreadable_raw
 * │   ├── UnsupportedRaw     unsupported_raw
 * │   └── NotSensorRaw       not_sensor_raw
 * ├── ChartError                                 the chart in the photo
 * │   ├── ChartNotFound      chart_not_found
 * │   └── ChartUnfit         chart_unfit
 * ├── CaptureError                               how the photo was taken
 * │   ├── Overexposed        overexposed
 * │   ├── Underexposed       underexposed
 * │   ├── UnevenLight        uneven_light
 * │   ├── FramesDiffer       frames_differ
 * │   ├── UnitDiffers        unit_differs
 * │   ├── Blurred            blurred
 * │   └── Glare              glare
 * ├── LampUnfit              lamp_unfit          the light
 * ├── NotConverged           not_converged       the solver's own proof failed
 * ├── CameraUnusual          camera_unusual      no basis knows such a camera
 * ├── ColourOutOfReach       colour_out_of_reach a colour that no surface has
 * ├── PassportInvalid        passport_invalid    changed, foreign, ended or called back
 * └── OutOfMemory            out_of_memory       the photo is too large for the memory that is left
 * ```
 *
 * @property code the word of the vocabulary, the same in every language.
 * @property message what is wrong, with the file or patch it is about.
 * @property advice what to do next.
 * @property value the number that decided, where there is one.
 * @property threshold the bound it broke, where there is one.
 */
public sealed class CalibrationException(
    public val code: String,
    override val message: String,
    public val advice: String,
    public val value: Double?,
    public val threshold: Double?,
    cause: Throwable?,
) : RuntimeException(message, cause) {
    /** Code, message and advice. */
    override fun toString(): String = "$code: $message $advice"
}

/** An argument has a wrong shape, value or name. */
public class InvalidArgument @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CalibrationException("invalid_argument", message, advice, value, threshold, cause)

/** The file cannot serve as a photo of the sensor. */
public sealed class RawError(
    code: String,
    message: String,
    advice: String,
    value: Double?,
    threshold: Double?,
    cause: Throwable?,
) : CalibrationException(code, message, advice, value, threshold, cause)

/** Missing, truncated, damaged, or not an image file. */
public class UnreadableRaw @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : RawError("unreadable_raw", message, advice, value, threshold, cause)

/** A sound file in a form that camssf does not read. */
public class UnsupportedRaw @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : RawError("unsupported_raw", message, advice, value, threshold, cause)

/** The samples are not the sensor's: demosaiced, merged or tone-mapped. */
public class NotSensorRaw @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : RawError("not_sensor_raw", message, advice, value, threshold, cause)

/** The chart in the photo, or its table, does not serve. */
public sealed class ChartError(
    code: String,
    message: String,
    advice: String,
    value: Double?,
    threshold: Double?,
    cause: Throwable?,
) : CalibrationException(code, message, advice, value, threshold, cause)

/** No chart of the asked kind lies in the photo, or it is mirrored. */
public class ChartNotFound @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : ChartError("chart_not_found", message, advice, value, threshold, cause)

/** The chart does not agree with its table, or too few patches are left. */
public class ChartUnfit @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : ChartError("chart_unfit", message, advice, value, threshold, cause)

/** The photo was taken in a way that carries no answer. */
public sealed class CaptureError(
    code: String,
    message: String,
    advice: String,
    value: Double?,
    threshold: Double?,
    cause: Throwable?,
) : CalibrationException(code, message, advice, value, threshold, cause)

/** Too many samples at the sensor's ceiling. */
public class Overexposed @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CaptureError("overexposed", message, advice, value, threshold, cause)

/** Signals too close to the black level. */
public class Underexposed @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CaptureError("underexposed", message, advice, value, threshold, cause)

/** The light falls off across the chart and no white frame corrects it. */
public class UnevenLight @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CaptureError("uneven_light", message, advice, value, threshold, cause)

/** Chart, white and dark frame were not taken alike. */
public class FramesDiffer @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CaptureError("frames_differ", message, advice, value, threshold, cause)

/** Photos of different physical cameras or lenses. */
public class UnitDiffers @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CaptureError("unit_differs", message, advice, value, threshold, cause)

/** Neighbouring patches run into each other. */
public class Blurred @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CaptureError("blurred", message, advice, value, threshold, cause)

/** Light that no patch reflects lies over the chart. */
public class Glare @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CaptureError("glare", message, advice, value, threshold, cause)

/** The lamp's spectrum has no power on the grid, or contradicts the photo. */
public class LampUnfit @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CalibrationException("lamp_unfit", message, advice, value, threshold, cause)

/** The duality gap of the answer is not small: there is no curve to trust. */
public class NotConverged @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CalibrationException("not_converged", message, advice, value, threshold, cause)

/**
 * A camera unlike all that the bases were learned from, or not of the kind that its maker makes. By the rules of this version
 * that makes a result doubtful, by a reason of this code, and refuses none.
 */
public class CameraUnusual @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CalibrationException("camera_unusual", message, advice, value, threshold, cause)

/** A colour that no surface has under this lamp, so that the curves cannot carry it. */
public class ColourOutOfReach @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CalibrationException("colour_out_of_reach", message, advice, value, threshold, cause)

/** The photo does not fit into the memory that the program may use. */
public class OutOfMemory @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CalibrationException("out_of_memory", message, advice, value, threshold, cause) {
    internal companion object {
        /** What helps, where a part of the photo was asked for already. */
        const val ADVICE =
            "Photograph at the sensor's ordinary resolution (12 megapixels are enough), let go of other " +
                "photos and bitmaps, hand over files instead of mosaics in memory, or give the app a large heap " +
                "(android:largeHeap in its manifest)."
    }
}

/** A passport that is not whole, not signed by a trusted key, not in its time, or called back: trust nothing in it. */
public class PassportInvalid @JvmOverloads constructor(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CalibrationException("passport_invalid", message, advice, value, threshold, cause)
