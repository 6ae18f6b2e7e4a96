package org.camssf.photo

import org.camssf.FramesDiffer
import org.camssf.Refusal
import org.camssf.Rules
import org.camssf.short
import kotlin.math.abs
import kotlin.math.max

/** Checks that all frames of a shot were taken with the same camera and settings. */
internal object Alike {
    /** True if two exposure times or sensitivities differ by no more than files round them. */
    fun equal(one: Double, two: Double): Boolean =
        abs(one - two) <= Rules.shipped.number("patches.alike") * max(one, two)

    /**
     * Throws [FramesDiffer] or `UnitDiffers` unless the frame was taken with the chart photo's camera and settings.
     */
    fun check(chart: Facts, frame: Facts, word: String) {
        val differ = ArrayList<String>()
        if (frame.width != chart.width || frame.height != chart.height) {
            differ += "size ${frame.width} × ${frame.height} against ${chart.width} × ${chart.height}"
        }
        val (its, own) = frame.sensor.cfa to chart.sensor.cfa
        if (its != own) differ += "CFA pattern $its against $own"
        for ((name, its, own) in listOf(
            Triple("make", frame.origin.make, chart.origin.make),
            Triple("model", frame.origin.model, chart.origin.model),
        )) {
            if (its.isNotEmpty() && own.isNotEmpty() && its != own) {
                differ += "camera $name '$its' against '$own'"
            }
        }
        val theirs = frame.sensor.sharedBlack
        val ours = chart.sensor.sharedBlack
        val alike = Rules.shipped.number("patches.black_alike")
        if (frame.sensor.white != chart.sensor.white) {
            differ += "white level ${short(frame.sensor.white)} against ${short(chart.sensor.white)} DN"
        } else if ((0..3).any { abs(theirs[it] - ours[it]) > alike * chart.sensor.white }) {
            differ += "black level ${short(theirs.average())} against ${short(ours.average())} DN"
        }
        compare("exposure", frame.origin.exposure, chart.origin.exposure, " s")?.let { differ += it }
        compare("iso", frame.origin.iso, chart.origin.iso, "")?.let { differ += it }
        if (differ.isNotEmpty()) {
            throw Refusal.of(
                "frames_differ.settings", "frame" to word, "file" to frame.name, "chart" to chart.name,
                "differences" to differ.joinToString("; "),
            )
        }
        val camera = frame.origin.camera
        val name = "The $word frame ${frame.name}"
        PhysicalCamera.check("the chart photo ${chart.name}", chart.origin.camera, name, camera)
    }

    private fun compare(name: String, theirs: Double?, ours: Double?, unit: String): String? {
        if (theirs == null || ours == null || equal(theirs, ours)) return null
        return "$name ${short(theirs)}$unit against ${short(ours)}$unit"
    }
}
