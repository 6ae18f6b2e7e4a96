package org.camssf.documents

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonObjectBuilder
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.buildJsonObject
import org.camssf.Camssf
import org.camssf.Grid
import org.camssf.fit.Colour
import org.camssf.flatten
import org.camssf.photo.Assumption
import org.camssf.photo.Begun
import org.camssf.photo.Photo
import org.camssf.photo.Signals
import org.camssf.recovery.EstimatedLamp
import org.camssf.recovery.Hypothesis
import org.camssf.verdict.Check
import org.camssf.verdict.Reason
import org.camssf.verdict.Verdict
import kotlin.math.roundToInt
import kotlin.math.sqrt

/** Writes results as "camssf-result/1" (schema: Python's data/result.schema.json). It computes no results. */
internal object ResultJson {
    /**
     * Writes a result with curves.
     *
     * @param model SHA-256 of the model file.
     */
    fun of(solution: Solution, model: String): String {
        val ssf = solution.ssf
        val shots = solution.capture.shots
        val begun = Begun(solution.capture)
        val signals = shots.indices.map { solution.signals.only(it) }
        val document = buildJsonObject {
            val fit = Fit(ssf.lights) { j, i -> fitted(solution, j, i) }
            head(begun, signals, solution.verdict, solution.assumptions, model, fit)
            text("basis", ssf.basis)
            text("engine", "onnx")
            put("ssf", curves(List(3) { ssf.curve(it) }))
            put("ssf_std", if (ssf.sharedStd == null) JsonNull else curves(List(3) { ssf.deviation(it)!! }))
            put("channel_gain", array(ssf.sharedGain))
            put("code_covariance", ssf.sharedCodeCovariance?.let { array(triangle(it)) } ?: JsonNull)
            put("gap", array(ssf.sharedGap))
            put("layers_gap", array(ssf.sharedLayersGap))
            put("finish_steps", JsonArray(ssf.sharedFinishSteps.map { JsonPrimitive(it) }))
            put("evidence", JsonPrimitive(ssf.logEvidence))
            put("prior_scale", JsonPrimitive(ssf.priorScale))
            put("chart_fading", JsonPrimitive(ssf.chartFading))
            put("choice", JsonArray(ssf.choice.map { weight(it) }))
            put("gamma", array(ssf.sharedGamma))
            put("l2", JsonPrimitive(ssf.l2))
            put("uncertainty", uncertainty(solution))
            put(
                "scores",
                buildJsonObject {
                    put("rmsre_percent", array(solution.scores.sharedRmsre))
                    put("rmse", JsonNull)
                    put("delta_e00", JsonPrimitive(solution.scores.deltaE00))
                    text("unseen", solution.scores.unseen)
                },
            )
        }
        return write(document)
    }

    /**
     * The fit's data: the estimated lamp of each shot with an unnamed light, and each patch by shot and patch number.
     */
    private class Fit(val lights: List<EstimatedLamp?>, val patch: (Int, Int) -> Fitted)

    private fun weight(of: Hypothesis): JsonObject = buildJsonObject {
        text("basis", of.basis)
        put("log_evidence", JsonPrimitive(of.logEvidence))
        put("probability", JsonPrimitive(of.probability))
        if (of.kinds.isNotEmpty()) put("kinds", JsonArray(of.kinds.map { JsonPrimitive(it) }))
    }

    /** Writes a refused result. */
    fun of(begun: Begun, verdict: Verdict): String = write(
        buildJsonObject {
            head(begun, begun.signals, verdict, emptyList(), null, Fit(emptyList()) { _, _ -> Fitted.NONE })
            text("basis", "none")
            text("engine", "none")
        },
    )

    /** On one line, by `toString`: the serializer takes four times as long where its code runs for the first time. */
    private fun write(document: JsonObject): String = "$document\n"

    private fun fitted(solution: Solution, shot: Int, patch: Int): Fitted {
        val at = shot * solution.signals.patches + patch
        fun triple(values: DoubleArray) = values.copyOfRange(3 * at, 3 * at + 3)
        return Fitted(
            solution.signals.sharedUsed[at],
            solution.predictions.level[at],
            triple(solution.ssf.sharedPredicted),
            finite(triple(solution.predictions.unseen)),
            triple(solution.scores.measuredSrgb),
            triple(solution.scores.syntheticSrgb),
            solution.predictions.std?.let { finite(triple(it)) },
            solution.predictions.unseenStd?.let { finite(triple(it)) },
        )
    }

    private fun finite(values: DoubleArray): DoubleArray? = values.takeIf { all -> all.all { it.isFinite() } }

    /** The members that need no curves. */
    private fun JsonObjectBuilder.head(
        begun: Begun,
        signals: List<Signals?>,
        verdict: Verdict,
        assumptions: List<Assumption>,
        model: String?,
        fit: Fit,
    ) {
        val table = begun.chart
        val photos = begun.shots.map { it.photo } + listOfNotNull(begun.inWork?.photo)
        text("format", "camssf-result/1")
        put(
            "generator",
            buildJsonObject {
                text("name", "camssf")
                text("version", Camssf.VERSION)
            },
        )
        put(
            "camera",
            buildJsonObject {
                text("make", photos.firstOrNull()?.make.orEmpty())
                text("model", photos.firstOrNull()?.model.orEmpty())
                put("unique_model", JsonPrimitive(photos.firstOrNull()?.uniqueModel?.ifEmpty { null }))
            },
        )
        put(
            "chart",
            buildJsonObject {
                text("name", table.name)
                text("table", table.table)
                text("layout", table.layout.name)
                text("source", table.source)
            },
        )
        val colours = Colour.reflectance(table)
        val shots = begun.shots.mapIndexed { j, shot ->
            ShotJson.of(shot, signals[j], table, colours, fit.lights.getOrNull(j)) { fit.patch(j, it) }
        }
        put("shots", JsonArray(shots + listOfNotNull(begun.inWork?.let { ShotJson.of(it) })))
        put(
            "verdict",
            buildJsonObject {
                text("status", verdict.outcome.word)
                put("reasons", JsonArray(verdict.reasons.map { reason(it) }))
                if (verdict.checks.isNotEmpty()) put("checks", JsonArray(verdict.checks.map { check(it) }))
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

    private fun check(check: Check): JsonObject = buildJsonObject {
        text("name", check.name)
        put("shot", JsonPrimitive(check.shot))
        put("value", JsonPrimitive(check.value))
        put("limit", JsonPrimitive(check.limit))
        put("refuses", JsonPrimitive(check.refuses))
        text("beyond", check.beyond)
    }

    private fun hashes(begun: Begun, photos: List<Photo>): JsonObject = buildJsonObject {
        begun.files.forEach { (name, sha256) -> text(name, sha256) }
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

    /** Half-width of the band, the half-width with each shot alone, and the uncertainty budget. */
    private fun uncertainty(solution: Solution): JsonElement {
        val known = solution.uncertainty ?: return JsonNull
        return buildJsonObject {
            put("half_width", JsonPrimitive(known.halfWidth))
            put("half_width_without_photo", JsonPrimitive(known.halfWidthWithoutPhoto))
            put("alone", array(known.alone.toDoubleArray()))
            put(
                "budget",
                JsonArray(
                    known.budget.map {
                        buildJsonObject {
                            text("source", it.source)
                            text("size", it.size)
                            put("share", array(it.share))
                        }
                    },
                ),
            )
        }
    }

    /** The lower triangle of a symmetric matrix, including its diagonal, row by row. */
    private fun triangle(matrix: DoubleArray): DoubleArray {
        val size = sqrt(matrix.size.toDouble()).roundToInt()
        return List(size) { matrix.copyOfRange(it * size, it * size + it + 1) }.flatten()
    }

    private fun curves(channels: List<DoubleArray>): JsonObject = buildJsonObject {
        put("wavelength_nm", array(Grid.WAVELENGTHS))
        listOf("red", "green", "blue").forEachIndexed { c, name -> put(name, array(channels[c])) }
    }
}
