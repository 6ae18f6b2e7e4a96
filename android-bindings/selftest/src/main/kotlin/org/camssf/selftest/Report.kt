package org.camssf.selftest

import org.camssf.CalibrationResult
import org.camssf.colour.StandardColour
import org.camssf.golden.GoldenRunner
import org.camssf.golden.Outcome
import org.json.JSONArray
import org.json.JSONObject

/**
 * The report that the user sends back: device, golden vectors, calibration, guidance and tapped colours.
 *
 * It holds no photo, place or time. A result contains the names of its photos, and Android's names contain date and
 * time (IMG_20261121_130000.dng), so whoever calls [calibration] must rename the photo, as [Nameless] does. The
 * photo's SHA-256 stays, so that the sender can show which photo it was.
 */
internal class Report(private val device: Map<String, String>) {
    private var golden: JSONObject? = null
    private var calibration: JSONObject? = null
    private var guide: JSONObject? = null
    private val colours = JSONArray()

    /** Adds the outcomes of the golden vectors, and the time that they took, ms. */
    fun golden(outcomes: List<Outcome>, milliseconds: Long) {
        val faults = JSONArray()
        for (outcome in outcomes) outcome.faults.forEach { faults.put("${outcome.case}: $it") }
        golden = JSONObject()
            .put("summary", GoldenRunner.summary(outcomes))
            .put("cases", outcomes.size)
            .put("faults", faults)
            .put("milliseconds", milliseconds)
    }

    /** Adds a result, the time that it took, ms, and the memory use afterwards, bytes (see [Memory]). */
    fun calibration(found: CalibrationResult, milliseconds: Long, memory: Map<String, Long>) {
        calibration = JSONObject()
            .put("milliseconds", milliseconds)
            .put("memory", JSONObject(memory))
            .put("result", JSONObject(found.toJson()))
    }

    /** Adds the statistics of a live session, the text of a [GuideLog]. */
    fun guide(log: String) {
        guide = JSONObject(log)
    }

    /** Adds the standard colour of a tapped spot, without its position. */
    fun colour(found: StandardColour) {
        colours.put(JSONObject().put("lab", JSONArray(found.lab.toList())))
    }

    /** The report as JSON, "camssf-selftest/1". */
    fun toJson(): String = JSONObject()
        .put("format", "camssf-selftest/1")
        .put("device", JSONObject(device))
        .put("golden", golden ?: JSONObject.NULL)
        .put("calibration", calibration ?: JSONObject.NULL)
        .put("guide", guide ?: JSONObject.NULL)
        .put("colours", colours)
        .toString(1)
}
