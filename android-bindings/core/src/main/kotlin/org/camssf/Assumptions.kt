package org.camssf

import org.camssf.photo.Assumption
import org.camssf.photo.LensShading
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.MeasuredShot

/** What an answer takes for granted, in words. */
internal object Assumptions {
    /** What the answer takes for granted beyond the fallbacks of Eq. (5). */
    fun of(capture: MeasuredCapture, paper: Boolean): List<Assumption> {
        val found = ArrayList<Assumption>()
        val table = capture.chart
        val k = capture.shots.size
        found += Assumption(
            "chart_table",
            "the chart's reflectances are ${table.source} (${table.table}), not this very chart's.",
        )
        for ((j, shot) in capture.shots.withIndex()) {
            val where = if (k > 1) "shot ${j + 1}: " else ""
            val lamp = shot.lamp
            found += Assumption(
                "lamp",
                "${where}the light was ${lamp.name} (${lamp.source}), smooth relative tolerance " +
                    "${percent(lamp.tolerance, 1)}, ${lamp.sharedModes.size} mode(s).",
            )
            if (shot.photo.gainMap) found += Assumption("lens_shading", where + shading(shot))
        }
        if (capture.shots[0].means.white != null && capture.whiteReflectance == null) {
            found += Assumption("white_reference", "the white frame shows a perfect diffuser (reflectance 1).")
        }
        if (paper) {
            found += Assumption(
                "no_band",
                "the paper's basis has no prior, so this answer carries no error band.",
            )
        }
        return found
    }

    private fun shading(shot: MeasuredShot): String {
        val map = "${shot.photo.name} holds a lens-shading map;"
        val framed = shot.white != null
        if (shot.lensShading == LensShading.APPLY) {
            val frames = if (framed) " of every frame, so that it cancels against the white frame." else "."
            return "$map it was applied to the patches' signals$frames"
        }
        val rest =
            if (framed) ", the white frame corrects the shading." else " and no white frame corrects it."
        return "$map it was not applied$rest"
    }
}
