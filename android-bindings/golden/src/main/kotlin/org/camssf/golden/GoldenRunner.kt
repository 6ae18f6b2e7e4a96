package org.camssf.golden

import kotlinx.serialization.json.Json
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.CalibrationException
import org.camssf.recovery.Choice
import org.camssf.recovery.Engine
import org.camssf.recovery.OnnxEngine
import java.io.Closeable
import java.io.File
import java.security.MessageDigest
import kotlin.system.exitProcess

/** The folder golden/ of the repository, wherever it lies: on disk, or in an app's assets. */
public fun interface GoldenFiles {
    /** The content of a file by its path in golden/, "manifest.json" for example. */
    public fun read(path: String): ByteArray

    public companion object {
        /** A folder on disk. */
        @JvmStatic
        public fun of(folder: File): GoldenFiles = GoldenFiles { File(folder, it).readBytes() }
    }
}

/**
 * How a golden case went.
 *
 * @property case its name, stage/name.
 * @property faults what does not hold, in words; empty where all holds.
 * @property limits how many limits were measured.
 * @property limitsSkipped how many were not: they need the reference's rows.
 * @property difference of the curves from those that Python stored, in parts of the peak; null where there are none.
 */
public class Outcome internal constructor(
    public val case: String,
    public val faults: List<String>,
    public val limits: Int = 1,
    public val limitsSkipped: Int = 0,
    public val difference: Double? = null,
)

/**
 * Runs the golden vectors on this machine: every stage, by the Kotlin library and the model.
 * Not thread-safe; holds the models until it is closed.
 */
public class GoldenRunner(private val files: GoldenFiles) : Closeable {
    private val forms = Forms(files)
    private val photos = Photos(files)
    private val colours = Colours(photos)
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
        outcome(forms.case(name))
    } catch (error: GoldenError) {
        Outcome(name, listOf(error.message.orEmpty()))
    }

    private fun outcome(case: GoldenCase): Outcome {
        val outputs = try {
            outputs(case)
        } catch (error: CalibrationException) {
            val fault = "expect ${case.expect}, found $error".takeIf { error.code != case.expect }
            return Outcome(case.name, listOfNotNull(fault))
        }
        if (case.expect != "success") return Outcome(case.name, listOf("expect ${case.expect}, found success"))
        if (case.unread().isNotEmpty()) throw GoldenError("nothing reads ${case.unread()}")
        val limits = case.limits.filter { "reference" !in it.requires }
        val measured = limits.map { measure(case, it, outputs[it.value]) }
        val faults = limits.indices.filter { !(measured[it] <= limits[it].bound) }
            .map { "${limits[it]}: ${measured[it]} exceeds ${limits[it].bound}" }
        // What is null in the file is absent in the answer: no band without a prior.
        val present = case.absent.filter { name ->
            outputs[name] != null && tensorOf(outputs[name])?.values?.all { it.isNaN() } != true
        }
        val curves = limits.indexOfFirst { "$it" == "ssf against outputs, norm" }
        return Outcome(
            case.name, faults + present.map { "$it is not absent" }, limits.size, case.limits.size - limits.size,
            measured.getOrNull(curves),
        )
    }

    private fun measure(case: GoldenCase, limit: Limit, output: Any?): Double {
        val stored = case.stored(limit)
        if (limit.metric == "exact") return if (same(output, stored)) 0.0 else Double.POSITIVE_INFINITY
        return Metrics.measure(limit.metric, output, forms.resolve(stored))
    }

    override fun close() {
        engines.values.forEach { it.close() }
        engines.clear()
    }

    /** The models of the case's basis: of `auto`, which names no hash, those that it weighs. */
    private fun engines(case: GoldenCase): List<Engine> {
        if (case.text("basis") == Choice.AUTO) return Choice.FAMILIES.map { engine(it) }
        val engine = engine(case.text("basis"))
        if (engine.metadata["basis_sha256"] != case.basisHash) {
            throw GoldenError("${case.name} was made with another basis than the model's")
        }
        return listOf(engine)
    }

    private fun engine(basis: String): Engine = engines.getOrPut(basis) { OnnxEngine.load(basis) }

    private fun outputs(case: GoldenCase): Map<String, Any?> = when (case.stage) {
        "mosaic" -> photos.mosaic(case)
        "pose" -> photos.pose(case)
        "patches" -> photos.patches(case)
        "finder" -> photos.finder(case)
        "signals" -> signals(case)
        "ssf" -> if (case.expect == "success") model(case, engines(case)[0]) else recover(case, engines(case)[0])
        "choice" -> choice(case, engines(case))
        "calibrate" -> calibrate(case, engines(case))
        "light" -> light(case, engines(case))
        "rivals" -> rivals(case, engines(case))
        "verdict" -> verdict(case, engine("phones"))
        "colour" -> colours.colour(case)
        "spectrum" -> colours.spectrum(case)
        "regions" -> photos.regions(case)
        "picture" -> colours.picture(case)
        else -> throw GoldenError("${case.name}: the stage ${case.stage} has no runner")
    }

    public companion object {
        /**
         * Runs the cases of the folder golden/ that the further arguments name, or all. The last line sums up, a fault
         * gives status 1.
         */
        @JvmStatic
        public fun main(arguments: Array<String>) {
            val named = arguments.drop(1)
            val outcomes = GoldenRunner(GoldenFiles.of(File(arguments[0]))).use { runner ->
                val all = runner.names()
                val unknown = named - all
                if (unknown.isNotEmpty()) throw GoldenError("the manifest has no case ${unknown.joinToString()}")
                named.ifEmpty { all }.map { runner.run(it) }
            }
            for (outcome in outcomes) outcome.faults.forEach { println("FAULT ${outcome.case}: $it") }
            println("on ${System.getProperty("os.arch")}, Java ${System.getProperty("java.version")}")
            println(summary(outcomes))
            if (outcomes.any { it.faults.isNotEmpty() }) exitProcess(1)
        }

        /** One line: how many cases ran and failed, and how far the curves are from Python's. */
        @JvmStatic
        public fun summary(outcomes: List<Outcome>): String {
            val failed = outcomes.count { it.faults.isNotEmpty() }
            val (measured, skipped) = outcomes.sumOf { it.limits } to outcomes.sumOf { it.limitsSkipped }
            val off = outcomes.mapNotNull { it.difference }.maxOrNull()
            return "golden: ${outcomes.size} cases ran, $failed failed; $measured limits measured, " +
                "$skipped skipped (need reference); curves within $off of the peak of Python's"
        }
    }
}

internal fun sha256(bytes: ByteArray): String =
    MessageDigest.getInstance("SHA-256").digest(bytes).joinToString("") { "%02x".format(it) }
