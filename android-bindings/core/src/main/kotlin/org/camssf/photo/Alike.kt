package org.camssf.photo

import org.camssf.FramesDiffer
import org.camssf.Rules
import org.camssf.short
import kotlin.math.abs
import kotlin.math.max

/** Whether frames of one shot were taken alike. */
internal object Alike {
    /** Relative difference up to which two exposures are the same: files round them. */
    private val SAME get() = Rules.shipped.number("patches.alike")

    /** Refuses a frame that was not taken with the chart photo's camera and settings. */
    fun check(chart: Mosaic, frame: Mosaic, word: String) {
        val differ = ArrayList<String>()
        if (frame.width != chart.width || frame.height != chart.height) {
            differ += "size ${frame.width} × ${frame.height} against ${chart.width} × ${chart.height}"
        }
        if (frame.cfa != chart.cfa) differ += "CFA pattern ${frame.cfa} against ${chart.cfa}"
        for ((name, its, own) in listOf(
            Triple("make", frame.make, chart.make),
            Triple("model", frame.model, chart.model),
        )) {
            if (its.isNotEmpty() && own.isNotEmpty() && its != own) {
                differ += "camera $name '$its' against '$own'"
            }
        }
        val theirs = frame.black
        val ours = chart.black
        if (frame.white != chart.white) {
            differ += "white level ${short(frame.white)} against ${short(chart.white)} DN"
        } else if ((0..3).any { abs(theirs[it] - ours[it]) > 0.005 * chart.white }) {
            differ += "black level ${short(theirs.average())} against ${short(ours.average())} DN"
        }
        compare("exposure", frame.exposure, chart.exposure, " s")?.let { differ += it }
        compare("iso", frame.iso, chart.iso, "")?.let { differ += it }
        if (differ.isNotEmpty()) {
            throw FramesDiffer(
                "The $word frame ${frame.name} differs from the chart photo ${chart.name}: " +
                    "${differ.joinToString("; ")}.",
                "Take chart, white and dark frame with one camera in manual mode: same exposure time, ISO, aperture.",
            )
        }
    }

    private fun compare(name: String, theirs: Double?, ours: Double?, unit: String): String? {
        if (theirs == null || ours == null || abs(theirs - ours) <= SAME * max(theirs, ours)) return null
        return "$name ${short(theirs)}$unit against ${short(ours)}$unit"
    }
}
