package org.camssf.verdict

import org.camssf.BandsTooWide
import org.camssf.Blurred
import org.camssf.CalibrationException
import org.camssf.CameraUnusual
import org.camssf.ChartNotFound
import org.camssf.ChartUnfit
import org.camssf.FramesDiffer
import org.camssf.Glare
import org.camssf.InvalidArgument
import org.camssf.LampUnfit
import org.camssf.NotConverged
import org.camssf.NotSensorRaw
import org.camssf.OutOfMemory
import org.camssf.Overexposed
import org.camssf.Rules
import org.camssf.Underexposed
import org.camssf.UnevenLight
import org.camssf.UnitDiffers
import org.camssf.UnreadableRaw
import org.camssf.UnsupportedRaw

/** Creates reasons with the texts and limits of rules.json. */
internal object Reasons {
    /**
     * Creates the reason of that name.
     *
     * @param name in rules.json.
     * @param value the number that decided.
     * @param words values of the placeholders of its message and advice.
     * @param fatal whether the number passed the limit that refuses.
     * @param threshold the bound that was broken, if it is not the rule's own limit.
     */
    fun because(
        name: String,
        value: Double,
        words: Map<String, Any>,
        fatal: Boolean = false,
        threshold: Double? = null,
    ): Reason {
        val wording = Rules.shipped.wording(name)
        val limit = if (fatal) wording.limits.last() else wording.limits.first()
        val bound = threshold ?: Rules.shipped.number("verdict.$limit")
        return Reason(wording.code, wording.message(words), wording.advice(words), value, bound, fatal)
    }

    /** The error that a refused verdict raises: that of its first fatal reason. */
    fun refusal(verdict: Verdict): CalibrationException = error(verdict.reasons.first { it.fatal })

    /**
     * The error of a reason.
     *
     * @throws InvalidArgument this version of camssf has no error of this code.
     */
    fun error(reason: Reason): CalibrationException {
        val make = ERRORS[reason.code] ?: throw InvalidArgument(
            "There is no error with the code ${reason.code}.", "Read the result with the camssf that wrote it.",
        )
        return make(reason.message, reason.advice, reason.value, reason.threshold, null)
    }

    /** The errors that can be the cause of a refusal, by their codes. */
    private val ERRORS: Map<String, (String, String, Double?, Double?, Throwable?) -> CalibrationException> = mapOf(
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
        "out_of_memory" to ::OutOfMemory,
        "invalid_argument" to ::InvalidArgument,
    )
}
