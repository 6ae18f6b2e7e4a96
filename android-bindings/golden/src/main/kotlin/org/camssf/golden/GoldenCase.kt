package org.camssf.golden

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.contentOrNull
import kotlinx.serialization.json.double
import kotlinx.serialization.json.int
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive

/** A golden file breaks its format. */
public class GoldenError(message: String) : RuntimeException(message)

/** One limit of a case: the value, what it is held against, how, and how closely. */
internal class Limit(
    val value: String,
    val against: String,
    val metric: String,
    val bound: Double,
    val requires: List<String>,
)

/** A golden case, every key of it checked (golden/format.md, format 1). */
internal class GoldenCase private constructor(val name: String, private val json: JsonObject) {
    val stage: String = json.text("stage")
    val comment: String = json.text("comment")
    val expect: String = json.text("expect")
    val requires: List<String> = json.words("requires")
    val basisHash: String? = json.getValue("source").jsonObject.getValue("basis_sha256").jsonPrimitive.contentOrNull
    val inputs: JsonObject = json.getValue("inputs").jsonObject
    val outputs: JsonObject? = json.getValue("outputs") as? JsonObject
    val limits: List<Limit> = json.getValue("limits").jsonArray.map { limit(it.jsonObject) }

    fun known(limit: Limit): JsonElement = json.getValue(limit.against).jsonObject.getValue(limit.value)

    private fun limit(entry: JsonObject): Limit {
        keys("limit", entry, setOf("value", "against", "metric", "bound", "requires"))
        keys("bound", entry.getValue("bound").jsonObject, setOf("float64"))
        return Limit(
            entry.text("value"),
            entry.text("against"),
            entry.text("metric"),
            entry.getValue("bound").jsonObject.getValue("float64").jsonPrimitive.double,
            entry.words("requires"),
        )
    }

    private fun check() {
        keys("the case", json, FIELDS)
        need(json.getValue("format").jsonPrimitive.int == 1, "format 1")
        need(json.text("case") == name, "calls itself ${json.text("case")}")
        need(name.startsWith("$stage/"), "does not belong to the stage $stage")
        need(comment.isNotEmpty(), "has no comment")
        need(requires.all { it in CAPABILITIES }, "requires $requires")
        keys("source", json.getValue("source").jsonObject, setOf("generator", "basis", "basis_sha256", "spectra"))
        val needed = INPUTS[stage] ?: throw GoldenError("$name: there is no stage $stage")
        keys("inputs", inputs, needed + (MAY[stage].orEmpty() intersect inputs.keys))
        for (shot in (inputs["shots"] as? JsonArray).orEmpty()) checkShot(shot.jsonObject)
        if (expect != "success") {
            val empty = listOf("outputs", "oracle", "truth").all { json[it] == JsonNull } && limits.isEmpty()
            need(empty, "an error has no outputs, oracle, truth or limits")
            return
        }
        keys("outputs", outputs ?: throw GoldenError("$name: has no outputs"), OUTPUTS.getValue(stage))
        (json["oracle"] as? JsonObject)?.let { keys("oracle", it, ORACLE) }
        (json["truth"] as? JsonObject)?.let { keys("truth", it, setOf("ssf", "measured")) }
        need(limits.isNotEmpty(), "has no limits")
        for (limit in limits) {
            need(limit.against in setOf("outputs", "oracle", "truth"), "compares against ${limit.against}")
            need(limit.metric in Metrics.ALL, "there is no metric ${limit.metric}")
            need(limit.requires.all { it in CAPABILITIES }, "a limit requires ${limit.requires}")
            val against = json[limit.against] as? JsonObject
            need((against?.get(limit.value) ?: JsonNull) != JsonNull, "nothing to hold ${limit.value} against")
        }
    }

    private fun checkShot(shot: JsonObject) {
        keys("shot", shot, setOf("chart", "white", "dark", "black", "saturation"))
        for (frame in listOf("chart", "white", "dark")) {
            (shot[frame] as? JsonObject)?.let {
                keys(
                    frame,
                    it,
                    FRAME + if (stage ==
                        "verdict"
                    ) {
                        MORE
                    } else {
                        emptySet()
                    },
                )
            }
        }
    }

    private fun keys(where: String, found: JsonObject, allowed: Set<String>) {
        need(
            found.keys == allowed,
            "$where: unknown ${(found.keys - allowed).sorted()}, missing ${(allowed - found.keys).sorted()}",
        )
    }

    private fun need(holds: Boolean, message: String) {
        if (!holds) throw GoldenError("$name: $message")
    }

    companion object {
        private val FRAME = setOf("mean", "standard_error", "clipped")
        private val MORE = setOf("count", "dead", "greens")
        private val FIELDS = setOf(
            "format", "case", "stage", "comment", "expect", "requires", "source", "inputs", "outputs", "oracle",
            "truth", "limits",
        )

        /** What a runner may have; golden/format.md explains each. */
        val CAPABILITIES = setOf(
            "mosaic", "pose", "patches", "signals", "reference", "model", "verdict", "metadata", "colour", "finder",
        )
        private val PROBLEM = setOf("matrix", "target", "covariance", "l2", "gamma", "nonnegative")
        private val ROWS = setOf(
            "basis",
            "reflectance",
            "chart_tolerance",
            "white_reflectance",
            "white_tolerance",
            "lamp",
            "lamp_tolerance",
            "lamp_modes",
        )
        private val CALL =
            ROWS + setOf("chart", "white", "dark", "standard_error", "l2", "gamma", "nonnegative")
        private val CAPTURE = setOf(
            "shots", "reflectance", "chart_tolerance", "white", "lamp", "lamp_tolerance", "lamp_modes",
            "white_reflectance", "basis", "l2", "gamma", "nonnegative",
        )

        /** Inputs that a case may leave out. */
        private val MAY = mapOf(
            "sensing" to setOf("gain_modes", "gain_own"),
            "ssf" to setOf("prior_scale", "gain_modes", "gain_own"),
            "calibrate" to setOf("make", "model", "light_per_patch"),
            "light" to setOf("make", "model", "colour_matrices", "torch", "called"),
            "finder" to setOf("layout", "csv"),
            "pose" to setOf("layout", "csv"),
            "rivals" to setOf("make", "model"),
            "verdict" to
                setOf(
                    "choice", "family", "family_test", "chart_fading", "code_variance", "unnamed", "new",
                    "gain_modes", "gain_own", "basis",
                ),
        )
        private val STATISTICS =
            setOf("mean", "standard_error", "count", "clipped", "dead", "gradient", "greens")
        private val INPUTS = mapOf(
            "mosaic" to setOf("dng"),
            "pose" to setOf("dng", "table", "corners"),
            "patches" to setOf("photo", "white", "dark", "quads", "lens_shading"),
            "signals" to setOf("shots", "patches", "white"),
            "sensing" to ROWS + setOf("signals", "standard_error"),
            "weights" to PROBLEM + "depths",
            "solve" to PROBLEM + setOf("depth", "finish"),
            "ssf" to CALL,
            "layers" to CALL + setOf("iteration", "depth"),
            "choice" to CALL + "prior",
            "calibrate" to CAPTURE,
            "light" to CAPTURE + "unnamed",
            "rivals" to CAPTURE,
            "verdict" to setOf(
                "reflectance", "chart_tolerance", "white_reflectance", "white_tolerance", "lamp", "lamp_tolerance",
                "lamp_modes", "signals", "standard_error", "used", "white_is_patch", "white", "dark", "shots",
                "centres", "ssf", "ssf_std", "code", "predicted", "alone", "rivals", "neutrals",
            ),
            "colour" to setOf("result", "lamp", "signals", "standard_error", "reference", "view"),
            "spectrum" to setOf("result", "photos", "prior", "view"),
            "regions" to setOf("photo", "areas", "dark", "lens_shading"),
            "picture" to setOf("result", "lamp", "photo", "dark", "white", "space", "shading", "area"),
            "finder" to setOf("dng", "form"),
        )
        private val OUTPUTS = mapOf(
            "mosaic" to setOf(
                "sha256", "width", "height", "samples_sha256", "cfa", "black", "white", "make", "model", "exposure",
                "iso", "orientation", "color_matrix1", "color_matrix2", "as_shot_neutral", "gain_maps",
                "as_shot_white_xy", "noise_profile", "masked_areas", "bad_pixels",
            ),
            "pose" to setOf("corners", "quads", "quarter_turns", "score", "kept"),
            "patches" to
                listOf("chart", "white", "dark").flatMap { frame -> STATISTICS.map { "${frame}_$it" } }.toSet() +
                setOf("black", "saturation", "noise_step", "noise_unlike", "noise_like"),
            "signals" to setOf("signals", "standard_error", "used", "assumptions"),
            "sensing" to setOf("matrix", "target", "covariance"),
            "weights" to setOf("rho", "W", "z"),
            "solve" to setOf("code", "objective", "gap", "layers_gap", "finish_steps", "evidence"),
            "ssf" to setOf(
                "ssf", "ssf_std", "code", "code_covariance", "signals", "predicted", "predicted_std", "budget", "gap",
                "layers_gap", "finish_steps", "evidence", "channel_gain",
            ),
            "layers" to setOf("ssf", "objective", "gap", "finish_steps", "distance"),
            "choice" to setOf(
                "weighed", "log_evidence", "probability", "basis", "prior_scale", "chart_fading", "family_test",
                "ssf", "ssf_std", "predicted", "gap",
            ),
            "light" to setOf(
                "weighed", "log_evidence", "probability", "basis", "prior_scale", "chart_fading", "length",
                "likeliest", "ssf", "ssf_std", "predicted", "gap", "rmsre_percent", "kinds", "power", "power_std",
                "kelvin", "kelvin_std", "status", "codes", "messages", "values", "thresholds", "said",
            ),
            "rivals" to setOf("gains"),
            "calibrate" to setOf(
                "signals", "used", "ssf", "ssf_std", "predicted", "gap", "channel_gain", "rmsre_percent", "codes",
            ),
            "verdict" to setOf(
                "status", "codes", "fatal", "values", "thresholds", "named", "residual", "prior", "count", "z",
                "gains",
                "messages",
                "advice",
                "checks",
                "checked",
                "causes",
            ),
            "colour" to setOf(
                "xyz", "lab", "xyz_covariance", "lab_covariance", "parts", "white", "lamps", "weights",
                "chi_squared", "far", "reach",
            ),
            "spectrum" to setOf(
                "reflectance", "covariance_sums", "parts", "indices", "xyz", "lab", "xyz_covariance",
                "lab_covariance", "white", "distance", "from_photo", "lamps", "weights", "chi_squared",
            ),
            "regions" to setOf("raw", "standard_error"),
            "picture" to setOf("picture", "uncertainty"),
            "finder" to setOf("findings", "kinds", "mirrored", "seen", "corners", "patches", "confidence"),
        )
        private val ORACLE = setOf("solver", "polished", "x", "objective", "gap", "ssf")

        fun read(name: String, files: GoldenFiles): GoldenCase {
            val json = try {
                Json.parseToJsonElement(files.read("cases/$name.json").decodeToString()).jsonObject
            } catch (error: IllegalArgumentException) {
                throw GoldenError("$name: not readable as JSON (${error.message})")
            }
            return try {
                GoldenCase(name, json).apply { check() }
            } catch (error: NoSuchElementException) {
                throw GoldenError("$name: ${error.message}")
            }
        }
    }
}

internal fun JsonObject.text(name: String): String = getValue(name).jsonPrimitive.content

internal fun JsonObject.words(name: String): List<String> = getValue(name).jsonArray.map { it.jsonPrimitive.content }

/** A number, or null; JSON lacks NaN: it is written as a word. */
internal fun number(element: JsonElement): Double? = (element as JsonPrimitive).contentOrNull?.toDouble()
