package org.camssf

/**
 * All errors of camssf: a tree of classes with one code for each leaf, the same in Python, Kotlin and JSON. Kotlin
 * alone has RuntimeUnfit, which no result contains: [SsfCalibrator.open] throws it.
 *
 * ```
 * CalibrationException
 * ├── InvalidArgument        invalid_argument    the call itself
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
 * │   ├── BandsTooWide       bands_too_wide
 * │   ├── UnevenLight        uneven_light
 * │   ├── FramesDiffer       frames_differ
 * │   ├── UnitDiffers        unit_differs
 * │   ├── Blurred            blurred
 * │   └── Glare              glare
 * ├── LampUnfit              lamp_unfit          the light
 * ├── NotConverged           not_converged       the solver's duality gap
 * ├── CameraUnusual          camera_unusual      the camera, unlike those of every basis
 * ├── ColourOutOfReach       colour_out_of_reach a colour that no surface can have
 * ├── PassportInvalid        passport_invalid    a signed document
 * ├── RuntimeUnfit           runtime_unfit       ONNX Runtime, missing or of a version that reports its use
 * └── OutOfMemory            out_of_memory       the photo, too large for the free memory
 * ```
 *
 * @property code the error code, the same in every language.
 * @property message what is wrong, with the file or patch concerned.
 * @property advice what to do next.
 * @property value the number that decided, if there is one.
 * @property threshold the bound that it broke, if there is one.
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
public class InvalidArgument(
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

/** The file is missing, truncated, damaged, or not an image. */
public class UnreadableRaw(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : RawError("unreadable_raw", message, advice, value, threshold, cause)

/** The file is valid, but camssf does not support its format. */
public class UnsupportedRaw(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : RawError("unsupported_raw", message, advice, value, threshold, cause)

/** The samples are not the sensor's: demosaiced, merged or tone-mapped. */
public class NotSensorRaw(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : RawError("not_sensor_raw", message, advice, value, threshold, cause)

/** The chart in the photo, or its table, cannot be used. */
public sealed class ChartError(
    code: String,
    message: String,
    advice: String,
    value: Double?,
    threshold: Double?,
    cause: Throwable?,
) : CalibrationException(code, message, advice, value, threshold, cause)

/** The photo shows no chart of the requested kind, or shows it mirrored. */
public class ChartNotFound(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : ChartError("chart_not_found", message, advice, value, threshold, cause)

/** The chart does not agree with its table, or too few patches are left. */
public class ChartUnfit(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : ChartError("chart_unfit", message, advice, value, threshold, cause)

/** The photo was taken in a way from which no curves can be recovered. */
public sealed class CaptureError(
    code: String,
    message: String,
    advice: String,
    value: Double?,
    threshold: Double?,
    cause: Throwable?,
) : CalibrationException(code, message, advice, value, threshold, cause)

/** Too many samples are clipped. */
public class Overexposed(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CaptureError("overexposed", message, advice, value, threshold, cause)

/** The signals are too close to the black level. */
public class Underexposed(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CaptureError("underexposed", message, advice, value, threshold, cause)

/** The photos leave the curves too uncertain. */
public class BandsTooWide(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CaptureError("bands_too_wide", message, advice, value, threshold, cause)

/** The light varies across the chart and no white frame corrects it. */
public class UnevenLight(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CaptureError("uneven_light", message, advice, value, threshold, cause)

/** Chart, white and dark frame were taken with different settings. */
public class FramesDiffer(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CaptureError("frames_differ", message, advice, value, threshold, cause)

/** The photos are from different physical cameras or lenses. */
public class UnitDiffers(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CaptureError("unit_differs", message, advice, value, threshold, cause)

/** Neighbouring patches are blurred into each other. */
public class Blurred(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CaptureError("blurred", message, advice, value, threshold, cause)

/** Stray light lies over the chart. */
public class Glare(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CaptureError("glare", message, advice, value, threshold, cause)

/** The lamp's spectrum has no power on the grid, or contradicts the photo. */
public class LampUnfit(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CalibrationException("lamp_unfit", message, advice, value, threshold, cause)

/** The duality gap of the answer is too large: the curves cannot be trusted. */
public class NotConverged(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CalibrationException("not_converged", message, advice, value, threshold, cause)

/**
 * The camera is unlike all cameras that the bases were learned from, or of another family than its maker's name
 * suggests. In this version it makes a result doubtful, as a reason with this code, and never refuses it.
 */
public class CameraUnusual(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CalibrationException("camera_unusual", message, advice, value, threshold, cause)

/** No surface can have this colour under this lamp. */
public class ColourOutOfReach(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CalibrationException("colour_out_of_reach", message, advice, value, threshold, cause)

/** The photo does not fit into the memory available to the program. */
public class OutOfMemory(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CalibrationException("out_of_memory", message, advice, value, threshold, cause) {
    internal companion object {
        /** Advice if only a part of the photo was requested already. */
        const val ADVICE =
            "Photograph at the sensor's ordinary resolution (12 megapixels are enough), let go of other " +
                "photos and bitmaps, hand over files instead of mosaics in memory, or give the app a large heap " +
                "(android:largeHeap in its manifest)."
    }
}

/** ONNX Runtime is missing, cannot load its native library, or is of a version that camssf does not run with. */
public class RuntimeUnfit(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CalibrationException("runtime_unfit", message, advice, value, threshold, cause)

/** A passport was changed, has expired, was revoked, or is not signed by a trusted key: do not trust its content. */
public class PassportInvalid(
    message: String,
    advice: String,
    value: Double? = null,
    threshold: Double? = null,
    cause: Throwable? = null,
) : CalibrationException("passport_invalid", message, advice, value, threshold, cause)
