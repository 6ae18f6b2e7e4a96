package org.camssf.selftest

import org.camssf.guide.Advice
import org.camssf.guide.FrameMeasures
import org.camssf.guide.Guidance
import org.json.JSONObject

/** Statistics of a live session: time per frame, advice given, and the last frame's measures. It holds no picture. */
internal class GuideLog {
    private val milliseconds = ArrayList<Double>()
    private val said = LinkedHashMap<Advice, Int>()
    private var changes = 0
    private var before: Advice? = null
    private var last: FrameMeasures? = null

    /** Adds a frame's guidance, and the time that search and guide took, ns. */
    @Synchronized
    fun add(guidance: Guidance, nanoseconds: Long) {
        milliseconds += nanoseconds / 1e6
        said[guidance.advice] = (said[guidance.advice] ?: 0) + 1
        if (before != null && before != guidance.advice) changes++
        before = guidance.advice
        if (guidance is Guidance.Measured) last = guidance.measures
    }

    /** The statistics for the report: times in ms, number of frames for each advice. */
    @Synchronized
    fun toJson(): JSONObject {
        val sorted = milliseconds.sorted()
        fun part(share: Double): Any = sorted.getOrNull((share * (sorted.size - 1)).toInt()) ?: JSONObject.NULL
        val counts = JSONObject()
        for ((advice, count) in said) counts.put(advice.name, count)
        return JSONObject()
            .put("frames", sorted.size)
            .put("median_ms", part(0.5))
            .put("slowest_twentieth_ms", part(0.95))
            .put("said", counts)
            .put("changes", changes)
            .put("last", last?.let(::measures) ?: JSONObject.NULL)
    }

    private fun measures(m: FrameMeasures): JSONObject {
        fun known(value: Double?): Any = value ?: JSONObject.NULL
        return JSONObject()
            .put("confidence", m.candidate.confidence)
            .put("size", m.size)
            .put("tilt", m.tilt)
            .put("white", m.white)
            .put("blur", known(m.blur))
            .put("shadow", known(m.shadow))
            .put("gradient", m.gradient)
            .put("glare", m.glare.size)
            .put("tint", known(m.tint))
    }
}
