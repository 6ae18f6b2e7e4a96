package org.camssf.golden

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.JsonPrimitive
import kotlinx.serialization.json.boolean
import kotlinx.serialization.json.int
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.CalibrationException
import org.camssf.Grid
import org.camssf.Settings
import org.camssf.Solve
import org.camssf.curves.Engine
import org.camssf.curves.Evidence
import org.camssf.curves.Frames
import org.camssf.curves.Known
import org.camssf.curves.ModelInputs
import org.camssf.curves.ModelOutputs
import org.camssf.curves.OnnxEngine
import org.camssf.curves.Penalties
import org.camssf.curves.Recover
import org.camssf.curves.Tensor
import org.camssf.evidence.Reasons
import org.camssf.evidence.Status
import org.camssf.photo.ChartPose
import org.camssf.photo.LensShading
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Normalise
import org.camssf.photo.Photo
import org.camssf.photo.Signals
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import java.io.Closeable
import java.io.File
import java.security.MessageDigest
import kotlin.system.exitProcess

/**
 * How a golden case went.
 *
 * @property case its name, stage/name.
 * @property skipped the capability that this runner lacks, in words; null where it ran.
 * @property faults limits that do not hold, in words; empty where all hold.
 * @property limits how many limits were measured.
 * @property limitsSkipped how many of them need a capability that this runner lacks.
 * @property difference of the curves from those that Python stored, in parts of the peak; null where there are none.
 */
public class Outcome internal constructor(
    public val case: String,
    public val skipped: String?,
    public val faults: List<String>,
    public val limits: Int,
    public val limitsSkipped: Int,
    public val difference: Double? = null,
)

/**
 * Runs the golden vectors on this machine: every stage that the Kotlin library has by itself or through the model.
 * Not thread-safe; holds the models until it is closed.
 */
public class GoldenRunner(private val files: GoldenFiles) : Closeable {
    private class Finding(val limit: String, val measured: Double, val bound: Double)

    private val forms = Forms(files)
    private val photos = Photos(files, forms)
    private val frames = Statistics(forms)
    private val engines = HashMap<String, Engine>()

    /**
     * Names of all cases, from the manifest; every file's hash is checked.
     *
     * @throws GoldenError if a file differs from the manifest.
     */
    public fun names(): List<String> {
        val manifest = Json.parseToJsonElement(files.read("manifest.json").decodeToString()).jsonObject
        val cases = manifest.getValue("cases").jsonObject
        if (manifest.getValue("count").jsonPrimitive.int != cases.size) throw GoldenError("the manifest miscounts")
        val others = manifest.getValue("spectra").jsonObject + manifest.getValue("dng").jsonObject
        for ((path, hash) in others + cases.mapKeys { "cases/${it.key}.json" }) {
            val digest = MessageDigest.getInstance("SHA-256").digest(files.read(path))
            val found = digest.joinToString("") { "%02x".format(it) }
            if (found != hash.jsonPrimitive.content) throw GoldenError("$path differs from the manifest")
        }
        return cases.keys.toList()
    }

    /** Runs one case. */
    public fun run(name: String): Outcome {
        val case = try {
            GoldenCase.read(name, files)
        } catch (error: GoldenError) {
            return Outcome(name, null, listOf(error.message.orEmpty()), 0, 0)
        }
        val lacking = case.requires.filter { it !in CAPABILITIES }
        if (lacking.isNotEmpty()) {
            return Outcome(name, "needs ${lacking.joinToString()}, which is not part of Kotlin", emptyList(), 0, 0)
        }
        val outputs = try {
            outputs(case)
        } catch (error: GoldenError) {
            return Outcome(name, null, listOf(error.message.orEmpty()), 0, 0)
        } catch (error: CalibrationException) {
            val right = error.code == case.expect
            return Outcome(
                name,
                null,
                if (right) emptyList() else listOf("expect ${case.expect}, found $error"),
                1,
                0,
            )
        }
        if (case.expect != "success") return Outcome(name, null, listOf("expect ${case.expect}, found success"), 1, 0)
        val (possible, lost) = case.limits.partition { limit -> limit.requires.all { it in CAPABILITIES } }
        val findings = possible.map { measure(case, it, outputs) } + absent(case, outputs)
        val faults = findings.filter { !(it.measured <= it.bound) }
            .map { "${it.limit}: ${it.measured} exceeds ${it.bound}" }
        val difference = findings.firstOrNull { it.limit == "ssf against outputs, norm" }?.measured
        return Outcome(name, null, faults, findings.size, lost.size, difference)
    }

    override fun close() {
        engines.values.forEach { it.close() }
        engines.clear()
    }

    /** The model of the case's basis, if it is the one that the case was made with. */
    private fun engine(case: GoldenCase): Engine {
        val basis = case.inputs.text("basis")
        val engine = engines.getOrPut(basis) { OnnxEngine.load(basis) }
        if (engine.metadata["basis_sha256"] != case.basisHash) {
            throw GoldenError("${case.name} was made with another basis than the model's")
        }
        return engine
    }

    private fun measure(case: GoldenCase, limit: Limit, outputs: Map<String, Any?>): Finding {
        val known = case.known(limit)
        val found = outputs[limit.value]
        val measured = when {
            limit.metric == "exact" -> if (Exact.same(found, known)) 0.0 else Metrics.WRONG
            found is Tensor -> Metrics.measure(limit.metric, found, forms.resolve(known))
            else -> Metrics.WRONG
        }
        return Finding("${limit.value} against ${limit.against}, ${limit.metric}", measured, limit.bound)
    }

    /** What is null in the file is absent in the answer: no band without a prior. */
    private fun absent(case: GoldenCase, outputs: Map<String, Any?>): List<Finding> =
        case.outputs!!.filter { it.value == JsonNull && it.key in outputs }.map { (name, _) ->
            val found = outputs[name]
            val empty = found == null || (found is Tensor && found.values.all { it.isNaN() })
            Finding("$name is absent", if (empty) 0.0 else 1.0, 0.0)
        }

    private fun outputs(case: GoldenCase): Map<String, Any?> = when (case.stage) {
        "mosaic" -> photos.mosaic(case)
        "pose" -> photos.pose(case)
        "patches" -> photos.patches(case)
        "signals" -> signals(case)
        "ssf" -> if (case.expect == "success") model(case) else recover(case)
        "layers" -> layers(case)
        "calibrate" -> calibrate(case)
        "verdict" -> Weighing(forms, frames).verdict(case)
        else -> throw GoldenError("${case.name}: the stage ${case.stage} has no runner")
    }

    private fun signals(case: GoldenCase): Map<String, Any?> {
        val n = case.inputs.getValue("patches").jsonPrimitive.int
        val white = case.inputs.getValue("white").jsonPrimitive.int
        val shots = case.inputs.getValue("shots").jsonArray.map { frames.means(it.jsonObject) }
        val found = Normalise.all(shots, List(n) { "patch ${it + 1}" }, white)
        return mapOf(
            "signals" to Tensor(found.values, shots.size, n, 3),
            "standard_error" to Tensor(found.standardError, shots.size, n, 3),
            "used" to used(found),
            "assumptions" to JsonArray(found.assumptions.map { JsonPrimitive(it.code) }),
        )
    }

    private fun used(signals: Signals): JsonElement = JsonArray(
        List(signals.shots) { j ->
            JsonArray(
                List(signals.patches) {
                    JsonPrimitive(
                        signals.used[
                            j * signals.patches +
                                it,
                        ],
                    )
                },
            )
        },
    )

    /** By the model's own contract; `lamp_estimate` is no output of a case. */
    private fun model(case: GoldenCase): Map<String, Any?> {
        fun given(name: String) = forms.resolve(case.inputs.getValue(name))
        val frames = Frames(given("chart"), given("white"), given("dark"))
        val found = engine(case).run(
            ModelInputs(
                frames,
                given("standard_error"),
                known(case),
                given("l2").values[0],
                given("gamma").values[0],
                case.inputs.getValue("nonnegative").jsonPrimitive.boolean,
            ),
        )
        val r = found["code"].size / 3
        val shapes = mapOf(
            "ssf" to intArrayOf(Grid.SIZE, 3),
            "ssf_std" to intArrayOf(Grid.SIZE, 3),
            "code" to intArrayOf(r, 3),
            "code_covariance" to intArrayOf(3 * r, 3 * r),
            "signals" to frames.chart.shape,
            "predicted" to frames.chart.shape,
            "evidence" to intArrayOf(),
        )
        return (ModelOutputs.NAMES - "lamp_estimate").associateWith { name ->
            Tensor(found[name], *(shapes[name] ?: intArrayOf(found[name].size)))
        }
    }

    /**
     * What the model's layers give by themselves: its answer, where the finish took no step, and a case that lets a model
     * run demands none.
     */
    private fun layers(case: GoldenCase): Map<String, Any?> {
        val has = engine(case).metadata.let { listOf(it["iteration"], it["depth"]) }
        val wanted = listOf(case.inputs.text("iteration"), case.inputs.text("depth"))
        if (has != wanted) throw GoldenError("${case.name}: layers $wanted, but the model has $has")
        return model(case).filterKeys { it in setOf("ssf", "gap", "finish_steps") }
    }

    private fun known(case: GoldenCase): Known {
        fun given(name: String) = forms.resolve(case.inputs.getValue(name))
        return Known(
            given("reflectance"), given("chart_tolerance"), given("white_reflectance"),
            given("white_tolerance").values[0], given("lamp"), given("lamp_tolerance"), given("lamp_modes"),
        )
    }

    /** Cases that expect an error must be refused by the checks around the model. */
    private fun recover(case: GoldenCase): Map<String, Any?> {
        fun given(name: String) = forms.resolve(case.inputs.getValue(name))
        val (chart, white, dark) = listOf("chart", "white", "dark").map { given(it) }
        val y = DoubleArray(chart.values.size) {
            (chart.values[it] - dark.values[it]) / (white.values[it] - dark.values[it])
        }
        val evidence = Evidence(Tensor(y, *chart.shape), given("standard_error"), known(case))
        val penalties = Penalties(
            given("l2").values[0],
            doubleArrayOf(given("gamma").values[0]),
            case.inputs.getValue("nonnegative").jsonPrimitive.boolean,
        )
        Recover.recover(engine(case), evidence, null, penalties)
        return emptyMap()
    }

    /** From patch statistics on: what a phone does after measuring. */
    private fun calibrate(case: GoldenCase): Map<String, Any?> {
        fun given(name: String) = forms.resolve(case.inputs.getValue(name))
        fun maybe(name: String) = number(case.inputs.getValue(name))
        val reflectance = given("reflectance")
        val n = reflectance.shape[0]
        val table = ChartTable(
            "classic24",
            "golden",
            "classic24",
            List(n) { "patch ${it + 1}" },
            reflectance.values,
            DoubleArray(n) { maybe("chart_tolerance")!! },
            case.inputs.getValue("white").jsonPrimitive.int,
            "golden/spectra",
        )
        val square = doubleArrayOf(0.0, 0.0, 100.0, 0.0, 100.0, 100.0, 0.0, 100.0)
        val pose = ChartPose(
            "classic24",
            DoubleArray(8) { square[it] * if (it % 2 == 0) 6 else 4 },
            DoubleArray(8 * 24) {
                val patch = it / 8
                square[it % 8] + 100 * if (it % 2 == 0) patch % 6 else patch / 6
            },
            0,
            "by hand",
            1.0,
            emptyList(),
        )
        val photo = Photo("golden", 600, 400, 1, null, null, false, "golden", "golden", "")
        val lamp = given("lamp")
        val modes = given("lamp_modes")
        val tolerance = given("lamp_tolerance")
        val shots = case.inputs.getValue("shots").jsonArray.mapIndexed { j, entry ->
            val means = frames.means(entry.jsonObject)
            val light = Lamp(
                "golden",
                row(lamp, j),
                tolerance.values[j],
                List(modes.shape[1]) { row(modes, j * modes.shape[1] + it) },
                "golden/spectra",
            )
            MeasuredShot(
                light,
                photo,
                photo.takeIf { means.white != null },
                photo.takeIf { means.dark != null },
                pose,
                means,
                LensShading.AS_STORED,
            )
        }
        val nonnegative = (case.inputs.getValue("nonnegative") as JsonPrimitive).takeIf { it !is JsonNull }
        val settings = Settings(null, maybe("l2"), maybe("gamma"), nonnegative?.boolean)
        val capture = MeasuredCapture(shots, table, maybe("white_reflectance"))
        val done = Solve(engine(case), capture, settings) { _, _ -> }.run()
        if (done.verdict.outcome == Status.REFUSED) throw Reasons.refusal(done.verdict)
        val ssf = done.ssf
        fun columns(of: (Int) -> DoubleArray): Tensor {
            val channels = List(3) { of(it) }
            return Tensor(DoubleArray(3 * Grid.SIZE) { channels[it % 3][it / 3] }, Grid.SIZE, 3)
        }
        return mapOf(
            "signals" to Tensor(done.signals.values, shots.size, n, 3),
            "used" to used(done.signals),
            "ssf" to columns { ssf.curve(it) },
            "ssf_std" to if (ssf.std == null) null else columns { ssf.deviation(it)!! },
            "predicted" to Tensor(ssf.predicted, shots.size, n, 3),
            "gap" to Tensor(ssf.gap, 3),
            "channel_gain" to Tensor(ssf.channelGain, 3),
            "rmsre_percent" to Tensor(done.scores.rmsrePercent, 3),
            "codes" to JsonArray(done.verdict.reasons.map { JsonPrimitive(it.code) }),
        )
    }

    private fun row(tensor: Tensor, at: Int): DoubleArray =
        tensor.values.copyOfRange(at * Grid.SIZE, (at + 1) * Grid.SIZE)

    public companion object {
        /** What Kotlin can do of what cases require. */
        @JvmField
        public val CAPABILITIES: Set<String> = GoldenCase.CAPABILITIES - "reference"

        /** Runs all cases of a folder, or of the resources under golden/; the last line sums up, a fault gives status 1. */
        @JvmStatic
        public fun main(arguments: Array<String>) {
            val folder = arguments.firstOrNull()
            val files = if (folder == null) GoldenFiles.resources("golden/") else GoldenFiles.of(File(folder))
            val outcomes = GoldenRunner(files).use { runner -> runner.names().map { runner.run(it) } }
            for (outcome in outcomes) {
                outcome.skipped?.let { println("skipped ${outcome.case}: $it") }
                outcome.faults.forEach { println("FAULT ${outcome.case}: $it") }
            }
            println("on ${System.getProperty("os.arch")}, Java ${System.getProperty("java.version")}")
            println(summary(outcomes))
            if (outcomes.any { it.faults.isNotEmpty() }) exitProcess(1)
        }

        /** One line: how many ran, failed and were skipped, and why. */
        @JvmStatic
        public fun summary(outcomes: List<Outcome>): String {
            val ran = outcomes.count { it.skipped == null }
            val failed = outcomes.count { it.faults.isNotEmpty() }
            val why = outcomes.mapNotNull { it.skipped }.groupingBy { it }.eachCount()
                .entries.joinToString("; ") { "${it.value} ${it.key}" }
            val limits = outcomes.sumOf { it.limits }
            val lost = outcomes.sumOf { it.limitsSkipped }
            val off = outcomes.mapNotNull { it.difference }.maxOrNull()
            return "golden: $ran of ${outcomes.size} cases ran, $failed failed, ${outcomes.size - ran} skipped " +
                "($why); $limits limits measured, $lost skipped (need reference); " +
                "curves within $off of the peak of Python's"
        }
    }
}
