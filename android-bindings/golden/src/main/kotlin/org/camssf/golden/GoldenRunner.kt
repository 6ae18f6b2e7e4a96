package org.camssf.golden

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.JsonNull
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.CalibrationException
import org.camssf.Grid
import org.camssf.recovery.Choice
import org.camssf.recovery.Engine
import org.camssf.recovery.Frames
import org.camssf.recovery.Known
import org.camssf.recovery.ModelInputs
import org.camssf.recovery.ModelOutputs
import org.camssf.recovery.Observation
import org.camssf.recovery.OnnxEngine
import org.camssf.recovery.Penalties
import org.camssf.recovery.Recover
import org.camssf.recovery.Ssf
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
    public val skipped: String? = null,
    public val faults: List<String> = emptyList(),
    public val limits: Int = 0,
    public val limitsSkipped: Int = 0,
    public val difference: Double? = null,
)

/**
 * Runs the golden vectors on this machine: every stage that the Kotlin library has by itself or through the model.
 * Not thread-safe; holds the models until it is closed.
 */
public class GoldenRunner(private val files: GoldenFiles) : Closeable {
    private class Finding(val limit: String, val measured: Double, val bound: Double)

    private val forms = Forms(files)
    private val photos = Photos(files)
    private val captures = Captures(forms)
    private val colours = Colours(forms, photos)
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
        val others = manifest.getValue("spectra").jsonObject + manifest.getValue("dng").jsonObject
        for ((path, hash) in others + cases.mapKeys { "cases/${it.key}.json" }) {
            if (sha256(files.read(path)) != hash.jsonPrimitive.content) {
                throw GoldenError("$path differs from the manifest")
            }
        }
        return cases.keys.toList()
    }

    /** Runs one case. */
    public fun run(name: String): Outcome = try {
        val case = forms.case(name)
        val lacking = case.requires.filter { it !in CAPABILITIES }
        if (lacking.isEmpty()) {
            outcome(case)
        } else {
            Outcome(name, "needs ${lacking.joinToString()}, which is not part of Kotlin")
        }
    } catch (error: GoldenError) {
        Outcome(name, faults = listOf(error.message.orEmpty()))
    }

    private fun outcome(case: GoldenCase): Outcome {
        val outputs = try {
            outputs(case)
        } catch (error: CalibrationException) {
            val fault = "expect ${case.expect}, found $error".takeIf { error.code != case.expect }
            return Outcome(case.name, faults = listOfNotNull(fault), limits = 1)
        }
        if (case.expect != "success") {
            return Outcome(case.name, faults = listOf("expect ${case.expect}, found success"), limits = 1)
        }
        if (case.unread().isNotEmpty()) throw GoldenError("${case.name}: nobody reads ${case.unread()}")
        val (possible, lost) = case.limits.partition { limit -> limit.requires.all { it in CAPABILITIES } }
        val findings = possible.map { measure(case, it, outputs) } + absent(case, outputs)
        val faults = findings.filter { !(it.measured <= it.bound) }
            .map { "${it.limit}: ${it.measured} exceeds ${it.bound}" }
        val difference = findings.firstOrNull { it.limit == "ssf against outputs, norm" }?.measured
        return Outcome(case.name, null, faults, findings.size, lost.size, difference)
    }

    override fun close() {
        engines.values.forEach { it.close() }
        engines.clear()
    }

    private fun engine(basis: String): Engine = engines.getOrPut(basis) { OnnxEngine.load(basis) }

    /** The models of the case's basis: of `auto`, which names no hash, those that it weighs. */
    private fun engines(case: GoldenCase): List<Engine> {
        if (case.text("basis") == Choice.AUTO) return Choice.FAMILIES.map { engine(it) }
        return listOf(engine(case))
    }

    /** The model of the case's basis, if it is the one that the case was made with. */
    private fun engine(case: GoldenCase): Engine {
        val engine = engine(case.text("basis"))
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
            else -> Metrics.measure(limit.metric, found, forms.resolve(known))
        }
        return Finding("${limit.value} against ${limit.against}, ${limit.metric}", measured, limit.bound)
    }

    /** What is null in the file is absent in the answer: no band without a prior. */
    private fun absent(case: GoldenCase, outputs: Map<String, Any?>): List<Finding> =
        case.outputs!!.filter { it.value == JsonNull && it.key in outputs }.map { (name, _) ->
            val found = outputs[name]
            val empty = found == null || tensorOf(found)?.values?.all { it.isNaN() } == true
            Finding("$name is absent", if (empty) 0.0 else 1.0, 0.0)
        }

    private fun outputs(case: GoldenCase): Map<String, Any?> = when (case.stage) {
        "mosaic" -> photos.mosaic(case)
        "pose" -> photos.pose(case)
        "patches" -> photos.patches(case)
        "signals" -> captures.signals(case)
        "ssf" -> if (case.expect == "success") model(case) else recover(case)
        "choice" -> choice(case)
        "calibrate" -> captures.calibrate(case, engines(case))
        "light" -> captures.light(case, engines(case))
        "rivals" -> captures.rivals(case, engines(case))
        "verdict" -> VerdictStage(engine("phones"), forms).verdict(case)
        "colour" -> colours.colour(case)
        "spectrum" -> colours.spectrum(case)
        "regions" -> colours.regions(case)
        "picture" -> pictures.picture(case)
        "finder" -> finders.finder(case)
        else -> throw GoldenError("${case.name}: the stage ${case.stage} has no runner")
    }

    /** By the model's own contract; `lamp_estimate` is no output of a case. */
    private fun model(case: GoldenCase): Map<String, Any?> {
        val engine = engine(case)
        val inputs = ModelInputs(
            engine.basis, frames(case), case.tensor("standard_error"), known(case), case.number("l2")!!,
            case.number("gamma")!!, case.flag("nonnegative")!!, case.number("prior_scale") ?: 1.0, explain = true,
        )
        val found = engine.run(listOf(inputs))[0]
        val (size, covariance) = found["code"].size to found["code_covariance"]
        val sums = DoubleArray(3 * size) { at -> (0 until size / 3).sumOf { covariance[size / 3 * at + it] } }
        val others = ModelOutputs.NAMES - setOf("lamp_estimate", "gain_code", "code_covariance")
        return others.associateWith { found[it] } + mapOf(
            "ssf" to Tensor(found["ssf"], Grid.SIZE, 3), "code_covariance_sums" to Tensor(sums, size, 3),
        )
    }

    private fun frames(case: GoldenCase) = Frames(case.tensor("chart"), case.tensor("white"), case.tensor("dark"))

    private fun known(case: GoldenCase) = Known(
        case.tensor("reflectance"), case.tensor("chart_tolerance"), case.tensor("white_reflectance"),
        case.number("white_tolerance")!!, case.tensor("lamp"), case.tensor("lamp_tolerance"),
        case.tensor("lamp_modes"), case.gains(),
    )

    /** Cases that expect an error must be refused by the checks around the model. */
    private fun recover(case: GoldenCase): Map<String, Any?> {
        val scale = case.number("prior_scale") ?: 1.0
        Recover.recover(engine(case), observation(case), null, penalties(case), scale)
        return emptyMap()
    }

    private fun observation(case: GoldenCase): Observation {
        val frames = frames(case)
        val (chart, white, dark) = listOf(frames.chart, frames.white, frames.dark).map { it.values }
        val y = DoubleArray(chart.size) { (chart[it] - dark[it]) / (white[it] - dark[it]) }
        return Observation(Tensor(y, *frames.chart.shape), case.tensor("standard_error"), known(case))
    }

    private fun penalties(case: GoldenCase) =
        Penalties(case.number("l2"), doubleArrayOf(case.number("gamma")!!), case.flag("nonnegative"))

    /** What is weighed, and the answer; curves and bands on the 5-nm nodes, at peak 1. */
    private fun choice(case: GoldenCase): Map<String, Any?> {
        val prior = case["prior"].jsonObject.mapValues { number(it.value)!! }
        val ssf = Choice.recover(engines(case), observation(case), frames(case), penalties(case), prior)
        val test = ssf.familyTest!!
        return chosen(ssf) + mapOf(
            "weighed" to ssf.choice.map { listOf(it.basis) },
            "family_test" to listOf(test.length, test.lampResidual!!, test.longest, test.largest),
        )
    }

    public companion object {
        /** What Kotlin can do of what cases require. */
        @JvmField
        public val CAPABILITIES: Set<String> = setOf(
            "mosaic", "pose", "patches", "signals", "model", "verdict", "metadata", "colour", "finder",
        )

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

/** What was weighed, and the answer: curves and bands on the 5-nm nodes, at peak 1. */
internal fun chosen(ssf: Ssf): Map<String, Any?> = mapOf(
    "log_evidence" to ssf.choice.map { it.logEvidence },
    "probability" to ssf.choice.map { it.probability },
    "basis" to ssf.basis,
    "prior_scale" to ssf.priorScale,
    "chart_fading" to ssf.chartFading,
    "ssf" to curves(10) { ssf.curve(it) },
    "ssf_std" to curves(10) { ssf.deviation(it)!! },
    "predicted" to ssf.sharedPredicted,
    "gap" to ssf.sharedGap,
)

internal fun sha256(bytes: ByteArray): String =
    MessageDigest.getInstance("SHA-256").digest(bytes).joinToString("") { "%02x".format(it) }
