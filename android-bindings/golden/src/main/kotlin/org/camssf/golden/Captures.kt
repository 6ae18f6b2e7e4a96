package org.camssf.golden

import kotlinx.serialization.json.boolean
import kotlinx.serialization.json.double
import kotlinx.serialization.json.doubleOrNull
import kotlinx.serialization.json.int
import kotlinx.serialization.json.jsonArray
import kotlinx.serialization.json.jsonObject
import kotlinx.serialization.json.jsonPrimitive
import org.camssf.CalibrationOptions
import org.camssf.CaptureFit
import org.camssf.Grid
import org.camssf.ProgressReporter
import org.camssf.Rivals
import org.camssf.Solve
import org.camssf.photo.ChartPose
import org.camssf.photo.ColourMatrix
import org.camssf.photo.Estimate
import org.camssf.photo.FrameMeans
import org.camssf.photo.LensShading
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Normalise
import org.camssf.photo.PatchMask
import org.camssf.photo.PatchMeans
import org.camssf.photo.Photo
import org.camssf.photo.SampleNoise
import org.camssf.photo.Signals
import org.camssf.recovery.Engine
import org.camssf.recovery.EstimatedLamp
import org.camssf.recovery.FamilyTest
import org.camssf.recovery.Hypothesis
import org.camssf.recovery.Ssf
import org.camssf.recovery.Tensor
import org.camssf.spectra.ChartLayout
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.camssf.verdict.CameraWhite
import org.camssf.verdict.Case
import org.camssf.verdict.Causes
import org.camssf.verdict.Judge
import org.camssf.verdict.Reasons
import org.camssf.verdict.Rival
import org.camssf.verdict.Status
import org.camssf.verdict.UnitDrift
import org.camssf.verdict.Verdict
import org.camssf.verdict.VerdictInputs

private const val GOLDEN = "golden"
private val SQUARE = doubleArrayOf(-1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0)

/** The stage `signals`: patch statistics to Eq. (5). */
internal fun signals(case: Fields): Map<String, Any?> {
    val patches = List(case.number("patches").toInt()) { "patch ${it + 1}" }
    val signals = Normalise.all(case.parts("shots").map { means(it) }, patches, case.number("white").toInt())
    return measured(signals) + mapOf(
        "standard_error" to signals.sharedError,
        "assumptions" to signals.assumptions.map { it.code },
    )
}

private fun measured(signals: Signals): Map<String, Any?> = mapOf(
    "signals" to signals.sharedValues,
    "used" to signals.sharedUsed.asList().chunked(signals.patches),
)

/** The stage `calibrate`: what a phone does after measuring. */
internal fun calibrate(case: Fields, engines: List<Engine>): Map<String, Any?> {
    val done = Solve(engines, capture(case), options(case), ProgressReporter.NOBODY).run()
    if (done.verdict.outcome == Status.REFUSED) throw Reasons.refusal(done.verdict)
    val ssf = done.ssf
    return measured(done.signals) + mapOf(
        "ssf" to curves(1) { ssf.curve(it) },
        "ssf_std" to ssf.sharedStd?.let { curves(10) { ssf.deviation(it)!! } },
        "predicted" to ssf.sharedPredicted, "gap" to ssf.sharedGap, "channel_gain" to ssf.sharedGain,
        "rmsre_percent" to done.scores.sharedRmsre,
        "codes" to done.verdict.reasons.map { it.code },
    )
}

/** The stage `light`: curves and light where a lamp is unnamed, and the verdict on both, even where it refuses. */
internal fun light(case: Fields, engines: List<Engine>): Map<String, Any?> {
    val done = Solve(engines, capture(case), options(case), ProgressReporter.NOBODY).run()
    val ssf = done.ssf
    val lights = ssf.lights.filterNotNull()
    fun nodes(of: (EstimatedLamp) -> DoubleArray) = lights.map { of(it).filterIndexed { at, _ -> at % 10 == 0 } }
    return chosen(ssf) + judgement(done.verdict) + mapOf(
        "weighed" to ssf.choice.map { listOf(it.basis) + it.kinds },
        "length" to ssf.familyTest?.let { listOf(it.length, it.longest) },
        "likeliest" to ssf.kinds,
        "rmsre_percent" to done.scores.sharedRmsre,
        "kinds" to lights.map { it.kinds.values.toList() },
        "power" to nodes { it.sharedPower }, "power_std" to nodes { it.sharedStd },
        "kelvin" to lights.map { it.kelvin }, "kelvin_std" to lights.map { it.kelvinStd },
        "said" to done.assumptions.filter { it.code == "lamp" }.map { it.message },
    )
}

/** The stage `rivals`: gains of every rival lamp, shot by shot. */
internal fun rivals(case: Fields, engines: List<Engine>): Map<String, Any?> {
    val capture = capture(case)
    val table = capture.chart
    val signals = Normalise.all(capture.shots.map { it.means }, table.patches, table.white)
    val fit = CaptureFit(engines, capture, signals, options(case))
    val used = PatchMask(capture.shots.size, table.patches.size, signals.sharedUsed)
    val ssf = fit.curves(used, options(case).gamma?.let { doubleArrayOf(it) })
    return mapOf("gains" to Rivals.of(fit, ssf, used) { }.map { it.gain }.toDoubleArray())
}

private fun options(case: Fields): CalibrationOptions =
    CalibrationOptions.Builder().l2(case.findNumber("l2")).gamma(case.findNumber("gamma"))
        .nonnegative(case.flag("nonnegative")).lightPerPatch(case.findNumber("light_per_patch")).build()

private fun capture(case: Fields): MeasuredCapture {
    val tolerance = case.number("chart_tolerance")
    val lights = case.words("lights")
    val lamps = lamps(case)
    val stated = case.list("colour_matrices").map { of -> of.jsonArray.map { it.jsonObject } }
    // Corners of a square of 600 × 400 px, and 24 squares of 100 px within.
    val corners = DoubleArray(8) { (SQUARE[it] + 1) * if (it % 2 == 0) 300 else 200 }
    val quads = DoubleArray(8 * 24) { 50 * (SQUARE[it % 8] + 1) + 100 * if (it % 2 == 0) it / 8 % 6 else it / 8 / 6 }
    val shots = case.parts("shots").mapIndexed { j, shot ->
        val light = lights.getOrNull(j)?.takeIf { it.isNotEmpty() }?.let(::lamp) ?: lamps[j]
        val matrices = stated.getOrNull(j).orEmpty().map {
            ColourMatrix(it.getValue("light").jsonPrimitive.content, numbers(it.getValue("values")))
        }
        measuredShot(shot, light, poseOf(corners, quads), case, matrices)
    }
    val table = chart(case, case.number("white").toInt()) { n -> DoubleArray(n) { tolerance } }
    return MeasuredCapture(shots, table, case.findNumber("white_reflectance"))
}

/** The light that a word stands for: unnamed, the torch, or a name with its tolerance, `D55,2%`. */
private fun lamp(word: String): Lamp = when (word) {
    "auto" -> Lamp.auto()
    "torch" -> Lamp.torch()
    else -> Lamp.read(word.substringBefore(",")).withTolerance(word.substringAfter(",", ""))
}

/** Of patches that were placed by hand. */
internal fun poseOf(corners: DoubleArray, quads: DoubleArray): ChartPose =
    ChartPose("classic24", corners, quads, 0, "by hand", 1.0, emptyList())

private fun measuredShot(
    shot: Fields,
    lamp: Lamp,
    pose: ChartPose,
    case: Fields,
    matrices: List<ColourMatrix> = emptyList(),
): MeasuredShot {
    val means = means(shot)
    val (make, model) = listOf("make", "model").map { case.findText(it) ?: GOLDEN }
    fun photo(of: List<ColourMatrix>) = Photo(GOLDEN, 600, 400, 1, null, null, false, make, model, "", of)
    val (white, dark) = listOf(means.white, means.dark).map { frame -> frame?.let { photo(emptyList()) } }
    return MeasuredShot(lamp, photo(matrices), white, dark, pose, means, LensShading.AS_STORED)
}

private fun means(shot: Fields): PatchMeans {
    val (chart, white, dark) = listOf("chart", "white", "dark").map { name -> shot.part(name)?.let(::frame) }
    val noise = shot.part("noise")?.let { of ->
        val (unlike, like) = listOf("unlike", "like").map { name ->
            of.findValues(name)?.let { (value, error) -> Estimate(value, error) }
        }
        SampleNoise(of.number("step"), unlike, like)
    }
    return PatchMeans(chart!!, white, dark, shot.values("black"), shot.number("saturation"), noise = noise)
}

private fun frame(of: Fields): FrameMeans {
    val mean = of.values("mean")
    val none = DoubleArray(mean.size)
    val count = of.findValues("count")?.map { it.toLong() }
    val greens = of.findValues("greens") ?: DoubleArray(mean.size / 3 * 2) { mean[it / 2 * 3 + 1] }
    return FrameMeans(
        mean, of.values("standard_error"), LongArray(mean.size) { count?.get(it) ?: 400 }, of.values("clipped"),
        of.findValues("dead") ?: none, none, greens,
    )
}

/** The classic chart with the case's reflectances. */
private fun chart(case: Fields, white: Int, tolerance: (Int) -> DoubleArray): ChartTable {
    val reflectance = case.tensor("reflectance")
    val n = reflectance.shape[0]
    val patches = List(n) { "patch ${it + 1}" }
    return ChartTable(
        "classic24", case.findText("table") ?: GOLDEN, ChartTable.read("classic24").layout, patches,
        Grid.wavelengths.values, reflectance.values, tolerance(n), white, "golden/spectra",
    )
}

/** The chart of the inputs `layout` and `csv`; null where the case has none. */
internal fun printedChart(case: Fields): ChartTable? {
    val layout = case.find("layout") ?: return null
    val printed = ChartLayout.parse("card.json", layout.toString().toByteArray())
    return ChartTable.parse("card.csv", case.text("csv").toByteArray(), printed)
}

/** The lamp of each shot. */
private fun lamps(case: Fields): List<Lamp> {
    val (lamp, modes) = listOf("lamp", "lamp_modes").map { case.tensor(it) }
    fun row(of: Tensor, at: Int) = of.values.copyOfRange(at * Grid.SIZE, (at + 1) * Grid.SIZE)
    val q = modes.shape[1]
    return case.values("lamp_tolerance").mapIndexed { j, tolerance ->
        Lamp(GOLDEN, row(lamp, j), tolerance, List(q) { row(modes, j * q + it) }, "golden/spectra")
    }
}

/** The stage `verdict`: the judge, and the numbers of its rules 1 to 3. */
internal fun verdict(case: Fields, engine: Engine): Map<String, Any?> {
    val y = case.tensor("signals")
    val (k, n) = y.shape
    val white = case.values("white")
    val used = case.list("used").flatMap { row -> row.jsonArray.map { it.jsonPrimitive.boolean } }.toBooleanArray()
    val signals =
        Signals(k, n, y.values, case.values("standard_error"), white, white, case.values("dark"), used, emptyList())
    val lamps = lamps(case)
    val choice = case.list("choice").map { of ->
        val (basis, probability) = of.jsonArray.map { it.jsonPrimitive }
        Hypothesis(basis.content, 0.0, probability.double)
    }
    val basis = choice.maxByOrNull { it.probability }?.basis ?: case.findText("basis") ?: GOLDEN
    val table = chart(case, 18) { case.values("chart_tolerance") }
    val inputs = VerdictInputs(
        engine, signals, table, lamps, answer(case, case, basis, choice), case.values("white_reflectance"),
        case.number("white_tolerance"), gains(case),
    )
    val rivals = case.list("rivals").map { of ->
        val (shot, name, gain) = of.jsonArray.map { it.jsonPrimitive }
        Rival(shot.int, name.content, gain.double)
    }
    val centres = case.values("centres")
    val shots = case.parts("shots").mapIndexed { j, shot ->
        val quads = DoubleArray(8 * n) { centres[2 * (j * n + it / 8) + it % 2] + SQUARE[it % 8] }
        measuredShot(shot, lamps[j], poseOf(SQUARE, quads), case)
    }
    val neutrals = case.list("neutrals").map { shot ->
        shot.jsonArray.map { pair ->
            val (light, camera) = pair.jsonArray.map { case.forms.resolve(it).values }
            CameraWhite(light, camera)
        }
    }
    return outputs(
        Case(
            inputs, shots, case.parts("alone").map { answer(case, it, basis, choice) }, neutrals,
            case.findText("family"), List(k) { case.flag("unnamed") ?: false },
            drift = case.findNumber("new")?.let { UnitDrift.probability(inputs, basis, it.toInt()) },
        ) { rivals },
    )
}

/** An answer: its curves, code and predictions, and what all answers of the case share. */
private fun answer(case: Fields, own: Fields, basis: String, choice: List<Hypothesis>): Ssf {
    val spread = case.findValues("code_variance")?.let { of ->
        DoubleArray(of.size * of.size) { if (it / of.size == it % of.size) of[it % of.size] else 0.0 }
    }
    val curves = Ssf.Curves(
        own.values("ssf"), case.findValues("ssf_std"), own.values("code"), spread, own.values("predicted"),
        case.values("lamp"),
    )
    val proof = Ssf.Proof(DoubleArray(3), DoubleArray(1), IntArray(1), null)
    val ones = DoubleArray(3) { 1.0 }
    val ssf = Ssf(curves, proof, ones, DoubleArray(3), 1.0, basis, comparison = Ssf.Comparison(choice))
    val (length, residual, longest, largest) = case.list("family_test").map { it.jsonPrimitive.doubleOrNull }
        .ifEmpty { return ssf }
    return ssf.withFamilyTest(
        FamilyTest(length!!, residual, longest!!, largest!!),
        case.findNumber("chart_fading") ?: 0.0,
    )
}

private fun outputs(case: Case): Map<String, Any?> {
    val verdict = Judge.judge(case)
    val joint = case.inputs.goodnessOfFit()
    val each = case.each()
    return judgement(verdict) + mapOf(
        "checks" to verdict.checks.map { "${it.name} ${it.beyond} ${it.shot ?: "whole"}" },
        "checked" to verdict.checks.map { listOf(it.value, it.limit, it.refuses ?: 0.0) },
        "fatal" to verdict.reasons.map { it.fatal },
        "causes" to case.shots.indices.flatMap { j ->
            listOf(emptySet(), Causes.BY_WHITE).flatMap { witnesses ->
                case.causes(j, case.rivals(), witnesses)?.probability?.values.orEmpty()
            }
        },
        "named" to each.map { one ->
            one.bestExplanation()?.let { best -> best.cause.word + best.patch?.let { " $it" }.orEmpty() }
        },
        "residual" to joint.residual, "prior" to joint.prior, "count" to joint.count,
        "z" to listOf(joint.z) + each.map { it.z },
        "gains" to each.flatMap { one -> one.explanations.map { it.gain } },
    )
}

/** Status and reasons of a verdict. */
private fun judgement(verdict: Verdict): Map<String, Any?> = mapOf(
    "status" to verdict.outcome.word, "codes" to verdict.reasons.map { it.code },
    "messages" to verdict.reasons.map { it.message }, "advice" to verdict.reasons.map { it.advice },
    "values" to verdict.reasons.map { it.value ?: 0.0 },
    "thresholds" to verdict.reasons.map { it.threshold ?: 0.0 },
)
