package org.camssf.golden

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonArray
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
import org.camssf.photo.Normalise
import org.camssf.recovery.Choice
import org.camssf.recovery.Engine
import org.camssf.recovery.Frames
import org.camssf.recovery.Hypothesis
import org.camssf.recovery.Known
import org.camssf.recovery.ModelInputs
import org.camssf.recovery.ModelOutputs
import org.camssf.recovery.Observation
import org.camssf.recovery.OnnxEngine
import org.camssf.recovery.Penalties
import org.camssf.recovery.Recover
import org.camssf.recovery.Tensor
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
    private val captures = Captures(forms, frames)
    private val colours = Colours(files, forms, photos)
    private val pictures = Pictures(colours, photos)
    private val finders = Finders(photos)
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

    private fun engine(basis: String): Engine = engines.getOrPut(basis) { OnnxEngine.load(basis) }

    /** The models of the case's basis: of `auto`, which names no hash, those that it weighs. */
    private fun engines(case: GoldenCase): List<Engine> {
        if (case.inputs.text("basis") == Choice.AUTO) return Choice.FAMILIES.map { engine(it) }
        return listOf(engine(case))
    }

    /** The model of the case's basis, if it is the one that the case was made with. */
    private fun engine(case: GoldenCase): Engine {
        val engine = engine(case.inputs.text("basis"))
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
        "choice" -> choice(case)
        "calibrate" -> captures.calibrate(case, engines(case))
        "light" -> captures.light(case, engines(case))
        "rivals" -> captures.rivals(case, engines(case))
        "verdict" -> VerdictStage(engine("phones"), forms, frames).verdict(case)
        "colour" -> colours.colour(case)
        "spectrum" -> colours.spectrum(case)
        "regions" -> colours.regions(case)
        "picture" -> pictures.picture(case)
        "finder" -> finders.finder(case)
        else -> throw GoldenError("${case.name}: the stage ${case.stage} has no runner")
    }

    private fun signals(case: GoldenCase): Map<String, Any?> {
        val n = case.inputs.getValue("patches").jsonPrimitive.int
        val white = case.inputs.getValue("white").jsonPrimitive.int
        val shots = case.inputs.getValue("shots").jsonArray.map { frames.means(it.jsonObject) }
        val found = Normalise.all(shots, List(n) { "patch ${it + 1}" }, white)
        return mapOf(
            "signals" to Tensor(found.sharedValues, shots.size, n, 3),
            "standard_error" to Tensor(found.sharedError, shots.size, n, 3),
            "used" to usedOf(found),
            "assumptions" to JsonArray(found.assumptions.map { JsonPrimitive(it.code) }),
        )
    }

    /** By the model's own contract; `lamp_estimate` is no output of a case. */
    private fun model(case: GoldenCase): Map<String, Any?> {
        fun given(name: String) = forms.resolve(case.inputs.getValue(name))
        val frames = Frames(given("chart"), given("white"), given("dark"))
        val engine = engine(case)
        val inputs = ModelInputs(
            engine.basis,
            frames,
            given("standard_error"),
            known(case),
            given("l2").values[0],
            given("gamma").values[0],
            case.inputs.getValue("nonnegative").jsonPrimitive.boolean,
            priorScale(case),
            explain = true,
        )
        val found = engine.run(listOf(inputs))[0]
        val r = found["code"].size / 3
        val shapes = mapOf(
            "ssf" to intArrayOf(Grid.SIZE, 3),
            "ssf_std" to intArrayOf(Grid.SIZE, 3),
            "code" to intArrayOf(r, 3),
            "code_covariance" to intArrayOf(3 * r, 3 * r),
            "signals" to frames.chart.shape,
            "predicted" to frames.chart.shape,
            "predicted_std" to frames.chart.shape,
            "budget" to intArrayOf(found["budget"].size / 3, 3),
            "evidence" to intArrayOf(),
        )
        return (ModelOutputs.NAMES - setOf("lamp_estimate", "gain_code")).associateWith { name ->
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

    /** How much wider the prior is taken: 1 where the case does not say. */
    private fun priorScale(case: GoldenCase): Double = case.inputs["prior_scale"]?.let { number(it) } ?: 1.0

    private fun known(case: GoldenCase): Known {
        fun given(name: String) = forms.resolve(case.inputs.getValue(name))
        return Known(
            given("reflectance"), given("chart_tolerance"), given("white_reflectance"),
            given("white_tolerance").values[0], given("lamp"), given("lamp_tolerance"), given("lamp_modes"),
            gains(case.inputs, forms),
        )
    }

    /** Cases that expect an error must be refused by the checks around the model. */
    private fun recover(case: GoldenCase): Map<String, Any?> {
        Recover.recover(engine(case), observation(case), null, penalties(case), priorScale(case))
        return emptyMap()
    }

    private fun observation(case: GoldenCase): Observation {
        fun given(name: String) = forms.resolve(case.inputs.getValue(name))
        val (chart, white, dark) = listOf("chart", "white", "dark").map { given(it) }
        val y = DoubleArray(chart.values.size) {
            (chart.values[it] - dark.values[it]) / (white.values[it] - dark.values[it])
        }
        return Observation(Tensor(y, *chart.shape), given("standard_error"), known(case))
    }

    private fun penalties(case: GoldenCase): Penalties {
        fun given(name: String) = forms.resolve(case.inputs.getValue(name)).values[0]
        val nonnegative = case.inputs.getValue("nonnegative").jsonPrimitive.boolean
        return Penalties(given("l2"), doubleArrayOf(given("gamma")), nonnegative)
    }

    /** What is weighed, and the answer; curves and bands on the 5-nm nodes, at peak 1. */
    private fun choice(case: GoldenCase): Map<String, Any?> {
        val observation = observation(case)
        val (chart, white, dark) = listOf("chart", "white", "dark").map { forms.resolve(case.inputs.getValue(it)) }
        val prior = case.inputs.getValue("prior").jsonObject.mapValues { number(it.value)!! }
        val ssf = Choice.recover(engines(case), observation, Frames(chart, white, dark), penalties(case), prior)
        fun weighed(of: (Hypothesis) -> Double) = Tensor(ssf.choice.map(of).toDoubleArray(), ssf.choice.size)
        val test = ssf.familyTest!!
        val numbers = doubleArrayOf(test.length, test.lampResidual!!, test.longest, test.largest)
        return mapOf(
            "weighed" to JsonArray(ssf.choice.map { JsonArray(listOf(JsonPrimitive(it.basis))) }),
            "family_test" to Tensor(numbers, numbers.size),
            "log_evidence" to weighed { it.logEvidence },
            "probability" to weighed { it.probability },
            "basis" to ssf.basis,
            "prior_scale" to ssf.priorScale,
            "chart_fading" to Tensor.scalar(ssf.chartFading),
            "ssf" to onNodes { ssf.curve(it) },
            "ssf_std" to onNodes { ssf.deviation(it)!! },
            "predicted" to Tensor(ssf.sharedPredicted, *chart.shape),
            "gap" to Tensor(ssf.sharedGap, 3),
        )
    }

    public companion object {
        /** What Kotlin can do of what cases require. */
        @JvmField
        public val CAPABILITIES: Set<String> = GoldenCase.CAPABILITIES - "reference"

        /**
         * Runs the cases of a folder, or of the resources under golden/: those that the further arguments name, or
         * all. The last line sums up, a fault gives status 1.
         */
        @JvmStatic
        public fun main(arguments: Array<String>) {
            val folder = arguments.firstOrNull()
            val files = if (folder == null) GoldenFiles.resources("golden/") else GoldenFiles.of(File(folder))
            val named = arguments.drop(1)
            val outcomes = GoldenRunner(files).use { runner ->
                val all = runner.names()
                val unknown = named - all
                if (unknown.isNotEmpty()) throw GoldenError("the manifest has no case ${unknown.joinToString()}")
                named.ifEmpty { all }.map { runner.run(it) }
            }
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
