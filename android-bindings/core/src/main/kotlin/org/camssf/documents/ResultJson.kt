package org.camssf.documents

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonObjectBuilder
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.buildJsonObject
import org.camssf.CalibrationException
import org.camssf.Grid
import org.camssf.Solution
import org.camssf.Solve
import org.camssf.curves.Ssf
import org.camssf.evidence.Colour
import org.camssf.evidence.Reason
import org.camssf.evidence.Verdict
import org.camssf.photo.Assumption
import org.camssf.photo.Begun
import org.camssf.photo.ChartPose
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Photo
import org.camssf.photo.Signals
import org.camssf.short
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp

/** Results → "camssf-result/1" (Python's data/result.schema.json). */
internal object ResultJson {
    private val pretty = Json {
        prettyPrint = true
    }

    fun of(solution: Solution, model: String): String {
        val ssf = solution.ssf
        val begun = Begun(solution.capture.chart)
        begun.shots += solution.capture.shots
        begun.lamps = solution.capture.shots.map { it.lamp }
        val document = buildJsonObject {
            head(begun, solution.verdict, solution.assumptions, model) { j, i -> fitted(solution, j, i) }
            text("basis", ssf.basis)
            text("engine", "onnx")
            put("ssf", curves(List(3) { ssf.curve(it) }))
            put("ssf_std", if (ssf.std == null) JsonNull else curves(List(3) { ssf.deviation(it)!! }))
            put("channel_gain", array(ssf.channelGain))
            put("gap", array(ssf.gap))
            put("gamma", array(ssf.gamma))
            put("l2", JsonPrimitive(ssf.l2))
            put("uncertainty", uncertainty(solution))
            put(
                "scores",
                buildJsonObject {
                    put("rmsre_percent", array(solution.scores.rmsrePercent))
                    put("rmse", JsonNull)
                    put("delta_e00", JsonPrimitive(solution.scores.deltaE00))
                    text("unseen", solution.scores.unseen)
                },
            )
        }
        return write(document)
    }

    fun of(begun: Begun, verdict: Verdict): String = write(
        buildJsonObject {
            head(begun, verdict, emptyList(), null) { _, _ -> Fitted(false, null, null, null, null) }
            text("basis", "none")
            text("engine", "none")
        },
    )

    fun csv(ssf: Ssf): String {
        val columns =
            List(3) { ssf.curve(it) } + if (ssf.std == null) emptyList() else List(3) { ssf.deviation(it)!! }
        val names = listOf("red", "green", "blue")
        val header = listOf("wavelength_nm") + names + if (ssf.std == null) emptyList() else names.map { "${it}_std" }
        val grid = Grid.WAVELENGTHS
        return buildString {
            append(header.joinToString(",")).append('\n')
            for (m in 0 until Grid.SIZE) {
                append(short(grid[m]))
                for (column in columns) append(',').append(column[m])
                append('\n')
            }
        }
    }

    private fun write(document: JsonObject): String = pretty.encodeToString(JsonElement.serializer(), document) + "\n"

    /** What the fit knows of a patch. */
    private class Fitted(
        val used: Boolean,
        val predicted: DoubleArray?,
        val unseen: DoubleArray?,
        val measured: DoubleArray?,
        val synthetic: DoubleArray?,
    )

    private fun fitted(solution: Solution, shot: Int, patch: Int): Fitted {
        val at = shot * solution.signals.patches + patch
        fun triple(values: DoubleArray) = values.copyOfRange(3 * at, 3 * at + 3)
        return Fitted(
            solution.signals.used[at],
            triple(solution.ssf.predicted),
            triple(solution.unseen).takeIf { all -> all.all { it.isFinite() } },
            triple(solution.scores.measuredSrgb),
            triple(solution.scores.syntheticSrgb),
        )
    }

    /** The part that needs no curves. */
    private fun JsonObjectBuilder.head(
        begun: Begun,
        verdict: Verdict,
        assumptions: List<Assumption>,
        model: String?,
        fitted: (Int, Int) -> Fitted,
    ) {
        val table = begun.chart
        val photos = begun.shots.map { it.photo } + listOfNotNull(begun.photo)
        text("format", "camssf-result/1")
        put(
            "generator",
            buildJsonObject {
                text("name", "camssf")
                text("version", VERSION)
            },
        )
        put(
            "camera",
            buildJsonObject {
                text("make", photos.firstOrNull()?.make.orEmpty())
                text("model", photos.firstOrNull()?.model.orEmpty())
            },
        )
        put(
            "chart",
            buildJsonObject {
                text("name", table.name)
                text("table", table.table)
                text("layout", table.layout)
                text("source", table.source)
            },
        )
        val colours = Colour.reflectance(table)
        val shots = begun.shots.mapIndexed { j, shot -> shot(shot, table, colours) { fitted(j, it) } }
        put("shots", JsonArray(shots + listOfNotNull(inWork(begun))))
        put(
            "verdict",
            buildJsonObject {
                text("status", verdict.status)
                put("reasons", JsonArray(verdict.reasons.map { reason(it) }))
            },
        )
        put(
            "assumptions",
            JsonArray(
                assumptions.map {
                    buildJsonObject {
                        text("code", it.code)
                        text("message", it.message)
                    }
                },
            ),
        )
        put(
            "hashes",
            buildJsonObject {
                put("inputs", hashes(begun, photos))
                put("model", JsonPrimitive(model))
            },
        )
    }

    private fun reason(reason: Reason): JsonObject = buildJsonObject {
        text("code", reason.code)
        text("message", reason.message)
        text("advice", reason.advice)
        put("value", JsonPrimitive(reason.value))
        put("threshold", JsonPrimitive(reason.threshold))
    }

    private fun hashes(begun: Begun, photos: List<Photo>): JsonObject = buildJsonObject {
        begun.chart.file?.let { text("chart table: ${it.name}", it.sha256) }
        begun.lamps.forEachIndexed { j, lamp ->
            lamp.file?.let { text("shot ${j + 1}, lamp: ${it.name}", it.sha256) }
        }
        photos.forEachIndexed { j, photo -> text("shot ${j + 1}, chart: ${photo.name}", photo.sha256) }
        begun.shots.forEachIndexed { j, shot ->
            shot.white?.let { text("shot ${j + 1}, white: ${it.name}", it.sha256) }
            shot.dark?.let { text("shot ${j + 1}, dark: ${it.name}", it.sha256) }
        }
    }

    private fun lamp(lamp: Lamp): JsonObject = buildJsonObject {
        text("name", lamp.name)
        put("tolerance", JsonPrimitive(lamp.tolerance))
        text("source", lamp.source)
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
        put("corners", points(pose.corners, 0))
        put("patches", JsonArray(List(pose.quads.size / 8) { points(pose.quads, 8 * it) }))
        put("quarter_turns", JsonPrimitive(pose.quarterTurns))
        text("method", pose.method)
        put("score", JsonPrimitive(pose.score))
        put("notes", JsonArray(pose.notes.map { JsonPrimitive(it) }))
    }

    private fun points(values: DoubleArray, from: Int): JsonArray =
        JsonArray(List(4) { array(values.copyOfRange(from + 2 * it, from + 2 * it + 2)) })

    /** A shot that was not measured to its end. */
    private fun inWork(begun: Begun): JsonObject? {
        val photo = begun.photo ?: return null
        val lamp = begun.lamp ?: return null
        return buildJsonObject {
            put("lamp", lamp(lamp))
            text("white_reference", "white patch")
            text("dark_reference", "black level")
            put("photo", photo(photo))
            put("white", JsonNull)
            put("dark", JsonNull)
            put("pose", begun.pose?.let { pose(it) } ?: JsonNull)
            put("saturation", JsonPrimitive(begun.saturation))
            put("patches", JsonArray(emptyList()))
        }
    }

    private fun shot(
        shot: MeasuredShot,
        table: ChartTable,
        colours: DoubleArray,
        fitted: (Int) -> Fitted,
    ): JsonObject {
        val means = shot.means
        val signals = try {
            Signals.normalise(listOf(means), table.patches, table.white)
        } catch (_: CalibrationException) {
            null // the refusal is on its way; what was measured is shown all the same
        }
        val size = means.chart.mean.size
        val y = signals?.values ?: DoubleArray(size)
        val error = signals?.standardError ?: DoubleArray(size)
        val white =
            signals?.white ?: means.white?.mean ?: DoubleArray(size) { means.chart.mean[3 * table.white + it % 3] }
        val dark = signals?.dark ?: means.dark?.mean ?: DoubleArray(size) { means.black[it % 3] }
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
            put(
                "patches",
                JsonArray(
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
                            put("predicted", known.predicted?.let { array(it) } ?: JsonNull)
                            put("unseen", known.unseen?.let { array(it) } ?: JsonNull)
                            put("standard_error", triple(error))
                            put("clipped", triple(means.chart.clipped))
                            put("dead", triple(means.chart.dead))
                            put("gradient", triple(means.chart.gradient))
                            put("chart", triple(means.chart.mean))
                            put("white", triple(white))
                            put("dark", triple(dark))
                        }
                    },
                ),
            )
        }
    }

    /** How wide the band is, and would be with each shot alone; the budget by source is Python's only. */
    private fun uncertainty(solution: Solution): JsonElement {
        val alone = solution.alone ?: return JsonNull
        return buildJsonObject {
            put("half_width", JsonPrimitive(Solve.halfWidth(solution.ssf)))
            put("alone", array(alone.toDoubleArray()))
            put("budget", JsonArray(emptyList()))
        }
    }

    private fun curves(channels: List<DoubleArray>): JsonObject = buildJsonObject {
        put("wavelength_nm", array(Grid.WAVELENGTHS))
        listOf("red", "green", "blue").forEachIndexed { c, name -> put(name, array(channels[c])) }
    }

    private fun array(values: DoubleArray): JsonArray = JsonArray(values.map { JsonPrimitive(it) })

    private fun JsonObjectBuilder.text(name: String, value: String) {
        put(name, JsonPrimitive(value))
    }

    /** Of camssf, the same as the Python package's. */
    const val VERSION = "0.1.0"
}
