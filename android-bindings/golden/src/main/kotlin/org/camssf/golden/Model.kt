package org.camssf.golden

import kotlinx.serialization.json.jsonObject
import org.camssf.Grid
import org.camssf.recovery.Choice
import org.camssf.recovery.Engine
import org.camssf.recovery.Frames
import org.camssf.recovery.Gains
import org.camssf.recovery.Known
import org.camssf.recovery.ModelInputs
import org.camssf.recovery.ModelOutputs
import org.camssf.recovery.Observation
import org.camssf.recovery.Penalties
import org.camssf.recovery.Recover
import org.camssf.recovery.Ssf
import org.camssf.recovery.Tensor

/** The stage `ssf` by the model's own contract; `lamp_estimate` is no output of a case. */
internal fun model(case: Fields, engine: Engine): Map<String, Any?> {
    val inputs = ModelInputs(
        engine.basis, frames(case), case.tensor("standard_error"), known(case), case.number("l2"),
        case.number("gamma"), case.flag("nonnegative")!!, case.findNumber("prior_scale") ?: 1.0, explain = true,
    )
    val outputs = engine.run(listOf(inputs))[0]
    val size = outputs["code"].size
    val sums = outputs["code_covariance"].asList().chunked(size / 3) { it.sum() }.toDoubleArray()
    val others = ModelOutputs.NAMES - setOf("lamp_estimate", "gain_code", "code_covariance")
    return others.associateWith { outputs[it] } + mapOf(
        "ssf" to Tensor(outputs["ssf"], Grid.SIZE, 3), "code_covariance_sums" to Tensor(sums, size, 3),
    )
}

/** Cases of the stage `ssf` that expect an error must be refused by the checks around the model. */
internal fun recover(case: Fields, engine: Engine): Map<String, Any?> {
    Recover.recover(engine, observation(case), null, penalties(case), case.findNumber("prior_scale") ?: 1.0)
    return emptyMap()
}

/** The stage `choice`: what is weighed, and the answer. */
internal fun choice(case: Fields, engines: List<Engine>): Map<String, Any?> {
    val prior = case["prior"].jsonObject.mapValues { number(it.value) }
    val ssf = Choice.recover(engines, observation(case), frames(case), penalties(case), prior)
    val test = ssf.familyTest!!
    return chosen(ssf) + mapOf(
        "weighed" to ssf.choice.map { listOf(it.basis) },
        "family_test" to listOf(test.length, test.lampResidual!!, test.longest, test.largest),
    )
}

/** What was weighed, and the answer: curves and bands on the 5-nm nodes, at peak 1. */
internal fun chosen(ssf: Ssf): Map<String, Any?> = mapOf(
    "log_evidence" to ssf.choice.map { it.logEvidence }, "probability" to ssf.choice.map { it.probability },
    "basis" to ssf.basis, "prior_scale" to ssf.priorScale, "chart_fading" to ssf.chartFading,
    "ssf" to curves(10) { ssf.curve(it) },
    "ssf_std" to curves(10) { ssf.deviation(it)!! },
    "predicted" to ssf.sharedPredicted, "gap" to ssf.sharedGap,
)

private fun frames(case: Fields) = Frames(case.tensor("chart"), case.tensor("white"), case.tensor("dark"))

private fun known(case: Fields) = Known(
    case.tensor("reflectance"), case.tensor("chart_tolerance"), case.tensor("white_reflectance"),
    case.number("white_tolerance"), case.tensor("lamp"), case.tensor("lamp_tolerance"), case.tensor("lamp_modes"),
    gains(case),
)

/** Gain modes; null where the case has none. */
internal fun gains(case: Fields): Gains? =
    if (case.has("gain_modes")) Gains(case.tensor("gain_modes"), case.number("gain_own")) else null

private fun observation(case: Fields): Observation {
    val frames = frames(case)
    val (chart, white, dark) = listOf(frames.chart, frames.white, frames.dark).map { it.values }
    val y = DoubleArray(chart.size) { (chart[it] - dark[it]) / (white[it] - dark[it]) }
    return Observation(Tensor(y, *frames.chart.shape), case.tensor("standard_error"), known(case))
}

private fun penalties(case: Fields) =
    Penalties(case.findNumber("l2"), doubleArrayOf(case.number("gamma")), case.flag("nonnegative"))
