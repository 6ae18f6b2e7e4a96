package org.camssf.verdict

import org.camssf.CalibrationException
import org.camssf.CameraUnusual
import org.camssf.ChartUnfit
import org.camssf.FramesDiffer
import org.camssf.Glare
import org.camssf.LampUnfit
import org.camssf.NotSensorRaw
import org.camssf.Rules
import org.camssf.UnevenLight

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
    fun refusal(verdict: Verdict): CalibrationException {
        val reason = verdict.reasons.first { it.fatal }
        val (message, advice) = reason.message to reason.advice
        return when (reason.code) {
            "glare" -> Glare(message, advice, reason.value, reason.threshold)
            "chart_unfit" -> ChartUnfit(message, advice, reason.value, reason.threshold)
            "frames_differ" -> FramesDiffer(message, advice, reason.value, reason.threshold)
            "uneven_light" -> UnevenLight(message, advice, reason.value, reason.threshold)
            "not_sensor_raw" -> NotSensorRaw(message, advice, reason.value, reason.threshold)
            "lamp_unfit" -> LampUnfit(message, advice, reason.value, reason.threshold)
            "camera_unusual" -> CameraUnusual(message, advice, reason.value, reason.threshold)
            else -> error("no verdict refuses for ${reason.code}")
        }
    }
}
