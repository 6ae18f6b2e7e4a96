package org.camssf.golden

import kotlinx.serialization.json.JsonArray
import kotlinx.serialization.json.JsonElement
import kotlinx.serialization.json.JsonObject
import kotlinx.serialization.json.jsonObject
import org.camssf.Grid
import org.camssf.photo.Estimate
import org.camssf.photo.FrameMeans
import org.camssf.photo.PatchMeans
import org.camssf.photo.Photo
import org.camssf.photo.SampleNoise
import org.camssf.recovery.Gains
import org.camssf.recovery.Tensor
import org.camssf.spectra.ChartLayout
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import org.camssf.verdict.Verdict

/** Every tenth point of the grid. */
internal const val NODES = 69

/** Curves (points, 3) of three channels, every `step`-th point of the grid. */
internal fun curves(step: Int, of: (Int) -> DoubleArray): Tensor {
    val channels = List(3) { of(it) }
    val points = (Grid.SIZE + step - 1) / step
    return Tensor(DoubleArray(3 * points) { channels[it % 3][step * (it / 3)] }, points, 3)
}

/** Status and reasons of a verdict. */
internal fun judgement(verdict: Verdict): Map<String, Any?> = mapOf(
    "status" to verdict.outcome.word,
    "codes" to verdict.reasons.map { it.code },
    "messages" to verdict.reasons.map { it.message },
    "advice" to verdict.reasons.map { it.advice },
    "values" to verdict.reasons.map { it.value ?: 0.0 },
    "thresholds" to verdict.reasons.map { it.threshold ?: 0.0 },
)

/** A photo of nothing in particular. */
internal val PHOTO = Photo("golden", 600, 400, 1, null, null, false, "golden", "golden", "")

/** Patch statistics as cases give them. */
internal fun Forms.means(shot: JsonElement): PatchMeans {
    val given = shot.jsonObject
    val (chart, white, dark) = listOf("chart", "white", "dark").map { frame(given.getValue(it)) }
    val noise = given["noise"]?.let { noise(it.jsonObject) }
    val saturation = number(given.getValue("saturation"))!!
    return PatchMeans(chart!!, white, dark, numbers(given.getValue("black")), saturation, noise = noise)
}

private fun noise(of: JsonObject): SampleNoise {
    val (unlike, like) = listOf("unlike", "like").map { name ->
        (of.getValue(name) as? JsonArray)?.let { numbers(it) }?.let { (value, error) -> Estimate(value, error) }
    }
    return SampleNoise(number(of.getValue("step"))!!, unlike, like)
}

private fun Forms.frame(frame: JsonElement): FrameMeans? {
    if (frame !is JsonObject) return null
    fun values(name: String) = frame[name]?.let { resolve(it).values }
    val mean = values("mean")!!
    val still = DoubleArray(mean.size)
    val count = values("count")
    val greens = values("greens") ?: DoubleArray(mean.size / 3 * 2) { mean[it / 2 * 3 + 1] }
    return FrameMeans(
        mean, values("standard_error")!!, LongArray(mean.size) { count?.get(it)?.toLong() ?: 400 },
        values("clipped")!!, values("dead") ?: still, still, greens,
    )
}

/** The classic chart with the case's reflectances. */
internal fun GoldenCase.classic(white: Int, tolerance: (Int) -> DoubleArray): ChartTable {
    val reflectance = tensor("reflectance")
    val n = reflectance.shape[0]
    val layout = ChartTable.read("classic24").layout
    val table = if (has("table")) text("table") else "golden"
    return ChartTable(
        "classic24", table, layout, List(n) { "patch ${it + 1}" }, Grid.wavelengths.values, reflectance.values,
        tolerance(n), white, "golden/spectra",
    )
}

/** The lamp of each shot. */
internal fun GoldenCase.lamps(): List<Lamp> {
    val (lamp, modes, tolerance) = listOf("lamp", "lamp_modes", "lamp_tolerance").map { tensor(it) }
    fun row(of: Tensor, at: Int) = of.values.copyOfRange(at * Grid.SIZE, (at + 1) * Grid.SIZE)
    val q = modes.shape[1]
    return tolerance.values.indices.map { j ->
        Lamp("golden", row(lamp, j), tolerance.values[j], List(q) { row(modes, j * q + it) }, "golden/spectra")
    }
}

/** Gain modes; null where the case has none. */
internal fun GoldenCase.gains(): Gains? =
    if (has("gain_modes")) Gains(tensor("gain_modes"), number("gain_own")!!) else null

/** The chart of the inputs `layout` and `csv`; null where the case has none. */
internal fun GoldenCase.card(): ChartTable? {
    val layout = find("layout") ?: return null
    val printed = ChartLayout.parse("card.json", layout.toString().toByteArray())
    return ChartTable.parse("card.csv", text("csv").toByteArray(), printed)
}
