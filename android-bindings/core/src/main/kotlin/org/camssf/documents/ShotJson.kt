package org.camssf.documents

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.buildJsonObject
import org.camssf.Grid
import org.camssf.mean
import org.camssf.photo.ChartPose
import org.camssf.photo.InWork
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Photo
import org.camssf.photo.Signals
import org.camssf.recovery.EstimatedLamp
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp

/** The fit's data for a patch: three numbers each, except the light correction `level`; null if not available. */
internal class Fitted(
    val used: Boolean,
    val level: Double,
    val predicted: DoubleArray?,
    val unseen: DoubleArray?,
    val measured: DoubleArray?,
    val synthetic: DoubleArray?,
    val predictedStd: DoubleArray? = null,
    val unseenStd: DoubleArray? = null,
) {
    companion object {
        /** The value if there was no fit. */
        val NONE = Fitted(false, 1.0, null, null, null, null)
    }
}

/** One shot in a result document. */
internal object ShotJson {
    /**
     * Writes a measured shot.
     *
     * @param signals of this shot alone; null if they could not be computed. The measured data are written in any
     *   case.
     * @param colours (n, 3) sRGB of the table.
     * @param light the estimated lamp of an unnamed light; null for a named lamp.
     * @param fitted the fit's data of each patch, by patch number.
     */
    fun of(
        shot: MeasuredShot,
        signals: Signals?,
        table: ChartTable,
        colours: DoubleArray,
        light: EstimatedLamp?,
        fitted: (Int) -> Fitted,
    ): JsonObject {
        val means = shot.means
        return buildJsonObject {
            put("lamp", lamp(shot.lamp))
            text("white_reference", if (means.white != null) "white frame" else "white patch")
            text("dark_reference", if (means.dark != null) "dark frame" else "black level")
            put("photo", photo(shot.photo))
            put("white", frame(shot.white))
            put("dark", frame(shot.dark))
            text("lens_shading", shot.lensShading.word)
            put("pose", pose(shot.pose))
            put("saturation", JsonPrimitive(means.saturation))
            put("patches", patches(shot, signals, table, colours, fitted))
            light?.let { put("light", found(it)) }
        }
    }

    private fun patches(
        shot: MeasuredShot,
        signals: Signals?,
        table: ChartTable,
        colours: DoubleArray,
        fitted: (Int) -> Fitted,
    ): JsonArray {
        val means = shot.means
        val chart = means.chart
        val mean = chart.sharedMean
        val size = mean.size
        val y = signals?.sharedValues ?: DoubleArray(size)
        val error = signals?.sharedError ?: DoubleArray(size)
        val white =
            signals?.sharedWhite ?: means.white?.sharedMean ?: DoubleArray(size) { mean[3 * table.white + it % 3] }
        val dark = signals?.sharedDark ?: means.dark?.sharedMean ?: DoubleArray(size) { means.sharedBlack[it % 3] }
        val dead = chart.dead
        val gradient = chart.gradient
        return JsonArray(
            table.patches.mapIndexed { i, name ->
                fun triple(values: DoubleArray) = array(values.copyOfRange(3 * i, 3 * i + 3))
                val known = fitted(i)
                buildJsonObject {
                    text("name", name)
                    put("used", JsonPrimitive(known.used))
                    put("reflectance_srgb", triple(colours))
                    put("measured_srgb", known.measured?.let { array(it) } ?: JsonNull)
                    put("synthetic_srgb", known.synthetic?.let { array(it) } ?: JsonNull)
                    put("signal", triple(y))
                    put("level", JsonPrimitive(known.level))
                    put("predicted", known.predicted?.let { array(it) } ?: JsonNull)
                    put("unseen", known.unseen?.let { array(it) } ?: JsonNull)
                    if (known !== Fitted.NONE) {
                        put("predicted_std", known.predictedStd?.let { array(it) } ?: JsonNull)
                        put("unseen_std", known.unseenStd?.let { array(it) } ?: JsonNull)
                    }
                    put("standard_error", triple(error))
                    put("clipped", triple(chart.sharedClipped))
                    put("dead", triple(dead))
                    put("gradient", triple(gradient))
                    put("chart", triple(mean))
                    put("white", triple(white))
                    put("dark", triple(dark))
                }
            },
        )
    }

    /** Writes a shot whose measurement was not finished. */
    fun of(shot: InWork): JsonObject = buildJsonObject {
        put("lamp", lamp(shot.lamp))
        text("white_reference", "white patch")
        text("dark_reference", "black level")
        put("photo", photo(shot.photo))
        put("white", JsonNull)
        put("dark", JsonNull)
        put("pose", shot.pose?.let { pose(it) } ?: JsonNull)
        put("saturation", JsonPrimitive(shot.saturation))
        put("patches", JsonArray(emptyList()))
    }

    private fun lamp(lamp: Lamp): JsonObject = buildJsonObject {
        text("name", lamp.name)
        put("tolerance", JsonPrimitive(lamp.tolerance.takeUnless { lamp.unnamed }))
        lamp.toleranceKelvin?.let { put("tolerance_kelvin", JsonPrimitive(it)) }
        text("source", lamp.source)
        if (!lamp.unnamed) put("power", array(power(lamp)))
    }

    /** (681) power scaled to a mean of 1. */
    private fun power(lamp: Lamp): DoubleArray {
        val mean = mean(lamp.sharedValues)
        return DoubleArray(Grid.SIZE) { lamp.sharedValues[it] / mean }
    }

    private fun found(light: EstimatedLamp): JsonObject = buildJsonObject {
        put("kinds", JsonObject(light.kinds.mapValues { JsonPrimitive(it.value) }))
        put("wavelength_nm", array(Grid.WAVELENGTHS))
        put("power", array(light.sharedPower))
        put("std", array(light.sharedStd))
        put("kelvin", JsonPrimitive(light.kelvin))
        put("kelvin_std", JsonPrimitive(light.kelvinStd))
    }

    private fun photo(photo: Photo): JsonObject = buildJsonObject {
        text("name", photo.name)
        put("width", JsonPrimitive(photo.width))
        put("height", JsonPrimitive(photo.height))
        put("orientation", JsonPrimitive(photo.orientation))
        put("exposure", JsonPrimitive(photo.exposure))
        put("iso", JsonPrimitive(photo.iso))
        put("gain_map", JsonPrimitive(photo.gainMap))
        text("sha256", photo.sha256)
        text("camera", listOf(photo.make, photo.model).filter { it.isNotEmpty() }.joinToString(" "))
    }

    private fun frame(photo: Photo?): JsonElement {
        if (photo == null) return JsonNull
        return buildJsonObject {
            text("name", photo.name)
            text("sha256", photo.sha256)
        }
    }

    private fun pose(pose: ChartPose): JsonObject = buildJsonObject {
        text("layout", pose.layout)
        put("corners", points(pose.sharedCorners, 0))
        put("patches", JsonArray(List(pose.sharedQuads.size / 8) { points(pose.sharedQuads, 8 * it) }))
        put("quarter_turns", JsonPrimitive(pose.quarterTurns))
        text("method", pose.method)
        put("score", JsonPrimitive(pose.score))
        put("notes", JsonArray(pose.notes.map { JsonPrimitive(it) }))
    }

    private fun points(values: DoubleArray, from: Int): JsonArray =
        JsonArray(List(4) { array(values.copyOfRange(from + 2 * it, from + 2 * it + 2)) })
}
