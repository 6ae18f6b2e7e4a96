package org.camssf

import org.camssf.photo.Assumption
import org.camssf.photo.LensShading
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.MeasuredShot
import org.camssf.recovery.EstimatedLamp
import org.camssf.recovery.Ssf
import org.camssf.spectra.Lamp
import org.camssf.verdict.Processed

/** Lists in words what an answer assumes about its capture. */
internal object Assumptions {
    /**
     * The answer's assumptions, apart from the fallbacks of Eq. (5).
     *
     * @param level (k, n) 1 - ĥ. @param leftOut 0-based, the patch that was left out of the fit.
     */
    fun of(capture: MeasuredCapture, ssf: Ssf, level: DoubleArray, leftOut: Int?): List<Assumption> {
        val found = ArrayList<Assumption>()
        val table = capture.chart
        val k = capture.shots.size
        val n = table.patches.size
        val public = "${table.source} (${table.table}), not measured on this chart."
        val own = "those of ${table.source}, taken for this chart's own."
        found += Assumption("chart_table", "the chart's reflectances are ${if (table.public) public else own}")
        leftOut?.let {
            found += Assumption(
                "patch_left_out",
                "patch ${table.patches[it]} was left out: it does not match the chart's table. " +
                    "Look for dirt, a reflection or a finger on it.",
            )
        }
        for ((j, shot) in capture.shots.withIndex()) {
            val where = if (k > 1) "shot ${j + 1}: " else ""
            val light = ssf.lights.getOrNull(j)
            found += Assumption("lamp", where + (light?.let { estimated(shot.lamp, it) } ?: named(shot.lamp)))
            uneven(where, shot, ssf, level.copyOfRange(j * n, (j + 1) * n))?.let { found += it }
            if (shot.photo.matricesLeftOut.isNotEmpty()) {
                found += Assumption("colour_matrix", "$where${shot.photo.name}: ${shot.photo.matricesLeftOut}.")
            }
            if (shot.photo.gainMap) found += Assumption("lens_shading", where + shading(shot))
            if (shot.means.noise != null && Processed.coloursMixed(shot.means) == null) {
                found += Assumption(
                    "mixing_unchecked",
                    where + "whether a program has mixed the colours of the samples was not checked: " +
                        "noise or samples do not suffice.",
                )
            }
        }
        if (capture.shots[0].means.white != null && capture.whiteReflectance == null) {
            found += Assumption("white_reference", "the white frame's target has reflectance 1.")
        }
        if (ssf.sharedStd == null) {
            found += Assumption(
                "no_band",
                "the paper's basis has no prior, so the result has no error bands.",
            )
        }
        return found
    }

    /**
     * Describes how even the light was, and how that was found; null if a white frame was taken and no gains were
     * solved for.
     */
    private fun uneven(where: String, shot: MeasuredShot, ssf: Ssf, level: DoubleArray): Assumption? {
        if (ssf.sharedGainCode.isEmpty()) {
            val flat = Assumption("uneven_light", "${where}the light was the same all over the chart.")
            return flat.takeIf { shot.means.white == null }
        }
        if (shot.means.white != null) {
            val solved = "the light on each patch was estimated together with the curves."
            return Assumption("uneven_light", where + solved)
        }
        val (least, most) = listOf(100.0 / level.max() - 100.0, 100.0 / level.min() - 100.0).map { signed(it) }
        return Assumption(
            "uneven_light",
            "${where}the unevenness of the light was estimated together with the curves: $least % to $most % on " +
                "the patches relative to the white one, almost the same for the three channels.",
        )
    }

    private fun signed(value: Double): String = fixed(value, 0).let { if (it.startsWith("-")) it else "+$it" }

    /** Describes a named lamp. */
    private fun named(lamp: Lamp): String =
        "the light was ${lamp.name} (${lamp.source}), smooth relative tolerance " +
            "${percent(lamp.tolerance, 1)}, ${lamp.sharedModes.size} mode(s)."

    private fun estimated(lamp: Lamp, light: EstimatedLamp): String =
        if (lamp.unnamed) unnamed(lamp.name, light) else called(lamp.name, light)

    /** Describes a light that was called by a name, and what the signals say. */
    private fun called(name: String, light: EstimatedLamp): String {
        val called = "the light was called $name; by the signals"
        val kelvin = "${grouped(light.kelvin)} ± ${grouped(light.kelvinStd)} K"
        // Called by its kind: nothing else was possible.
        val table = light.kinds[EstimatedLamp.NAMED] ?: return "$called $kelvin."
        val (kind, share) = light.kinds.entries.filter { it.key != EstimatedLamp.NAMED }.maxByOrNull { it.value }!!
        if (table > share) {
            return "$called $name itself (${percent(table, 0)}) or another ${singular(kind)}."
        }
        return "$called another ${singular(kind)} of $kelvin (${percent(share, 0)})."
    }

    /** One lamp of a kind. */
    private fun singular(kind: String): String =
        when (kind) {
            "white-led" -> "white LED"
            "fluorescent" -> "fluorescent lamp"
            else -> kind
        }

    /** A whole number in groups of three digits: 6,480. */
    private fun grouped(value: Double): String = fixed(value, 0).reversed().chunked(3).joinToString(",").reversed()

    /** Describes a light that was estimated from the signals. */
    private fun unnamed(name: String, light: EstimatedLamp): String {
        val kelvin = "${fixed(light.kelvin, 0)} ± ${fixed(light.kelvinStd, 0)} K."
        if (name == Lamp.TORCH) {
            return "the light was the phone's torch, a white LED, and was estimated from the signals: $kelvin"
        }
        val kinds = light.kinds.entries.sortedByDescending { it.value }
            .joinToString { "${it.key} ${percent(it.value, 0)}" }
        return "the light was not named and was estimated from the signals: $kinds, " +
            "$kelvin All kinds have the same prior probability; other kinds of light and mixtures of two are not " +
            "considered."
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
