package org.camssf.verdict

import org.camssf.Grid
import org.camssf.Nodes
import org.camssf.photo.ChartPose
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Signals
import org.camssf.recovery.BasisConstants
import org.camssf.recovery.Engine
import org.camssf.recovery.Gains
import org.camssf.recovery.OnnxEngine
import org.camssf.recovery.Ssf
import org.camssf.recovery.Tensor
import org.camssf.recovery.lampModes
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import kotlin.math.max
import kotlin.math.roundToInt

/**
 * The k measured shots that a verdict judges, with their chart, lamps, white reference and answer; the verdict's model
 * computes from them. Python's `camssf.verdict.goodness_of_fit`.
 */
internal class VerdictInputs(
    private val engine: Engine,
    val signals: Signals,
    val table: ChartTable,
    val lamps: List<Lamp>,
    val ssf: Ssf,
    private val whiteReflectance: DoubleArray,
    private val whiteTolerance: Double,
    gains: Gains? = null,
) {
    /** Gain modes of the light on the patches; null if there are none. */
    private val gains: Gains? = gains?.takeIf { it.modes.values.isNotEmpty() }
    private val k = signals.shots
    private val n = signals.patches

    /** The inputs of shot j only, with the answer to that shot. */
    fun only(j: Int, answer: Ssf): VerdictInputs = VerdictInputs(
        engine,
        signals.only(j),
        table,
        listOf(lamps[j]),
        answer.only(j, n),
        whiteReflectance,
        whiteTolerance,
        gains?.only(j),
    )

    /** Rules 1 and 2; with `shot`, for inputs of this shot only, also the explanations of rule 3. */
    fun goodnessOfFit(shot: MeasuredShot? = null): GoodnessOfFit {
        val directions = shot?.let {
            mapOf("explain" to Tensor.scalar(1.0), "level" to level(it), "fields" to fields(it))
        }
        val parts = engine.judge(arrays() + directions.orEmpty(), MISFIT).mapValues { it.value.values }
        val prior = if (ssf.sharedStd != null) parts.getValue("prior")[0] else 0.0
        val count = parts.getValue("count")[0].roundToInt()
        val explanations = shot?.let { explanations(it, parts) }.orEmpty()
        return GoodnessOfFit(parts.getValue("residual")[0], prior, count, explanations)
    }

    /**
     * ln of the Bayes factor of each drift of the blue curve before the first `new` shots (rule 10).
     *
     * @param basis that of the answer.
     */
    fun driftEvidences(basis: String, new: Int): DoubleArray {
        val constants = checkNotNull(BasisConstants.of(basis)) { "$basis is no learned basis" }
        return engine.judge(arrays() + shots(constants, new), listOf(DRIFT)).getValue(DRIFT).values
    }

    /**
     * ln of the evidence of each of [Causes.CAUSES] over that of none, and of an error of each patch; for inputs of one
     * shot.
     *
     * @param tables other tables of the chart.
     */
    fun causeEvidences(shot: MeasuredShot, tables: List<ChartTable>): Pair<DoubleArray, DoubleArray> {
        val (x, y) = places(shot.pose)
        val reference = DoubleArray(n) { if (shot.means.white == null && it == table.white) 1.0 else 0.0 }
        val reflectances = DoubleArray(tables.size * n * Grid.SIZE)
        tables.forEachIndexed { i, other -> other.sharedValues.copyInto(reflectances, i * n * Grid.SIZE) }
        val scene = mapOf(
            "weigh" to Tensor.scalar(1.0),
            "level" to level(shot),
            "places" to Tensor(DoubleArray(2 * n) { if (it % 2 == 0) x[it / 2] else y[it / 2] }, n, 2),
            "reference" to Tensor(reference, n),
            "tables" to Tensor(reflectances, tables.size, n, Grid.SIZE),
        )
        val constants = checkNotNull(BasisConstants.of(ssf.basis)) { "${ssf.basis} is no learned basis" }
        val of = engine.judge(arrays() + shots(constants, 0) + scene, CAUSE)
        return of.getValue(CAUSE[0]).values to of.getValue(CAUSE[1]).values
    }

    /** The model's inputs, without explanations, causes and new shots: level 1 and no fields. */
    private fun arrays(): Map<String, Tensor> {
        val used = DoubleArray(k * n) { if (signals.sharedUsed[it]) 1.0 else 0.0 }
        return mapOf(
            "signals" to rows { if (signals.sharedUsed[it / 3]) signals.sharedValues[it] else 1.0 },
            "standard_error" to rows { signals.sharedError[it] },
            "predicted" to rows { ssf.sharedPredicted[it] },
            "used" to Tensor(used, k, n),
            "level" to rows { 1.0 },
            "fields" to Tensor.full(0.0, 1, k, n),
            "curves" to Tensor(ssf.sharedValues, Grid.SIZE, 3),
            "code" to Tensor(ssf.sharedCode, ssf.sharedCode.size / 3, 3),
            "lamp" to Tensor(ssf.sharedLamp, k, Grid.SIZE),
            "lamp_tolerance" to Tensor(DoubleArray(k) { lamps[it].tolerance }, k),
            "lamp_modes" to lampModes(lamps, fewest = 1),
            "reflectance" to Tensor(table.sharedValues, n, Grid.SIZE),
            "chart_tolerance" to Tensor(table.sharedTolerance, n),
            "white_reflectance" to Tensor(whiteReflectance, Grid.SIZE),
            "white_tolerance" to Tensor.scalar(whiteTolerance),
            "gain_modes" to OnnxEngine.gainModes(gains, intArrayOf(k, n)),
            "gain_own" to Tensor.scalar(gains?.own ?: 0.0),
            "explain" to Tensor.scalar(0.0),
            "first_lamp" to Tensor(lamps[0].sharedValues, Grid.SIZE),
            "raw_white" to Tensor(DoubleArray(3 * k) { signals.rawWhite(it / 3)[it % 3] }, k, 3),
            "weigh" to Tensor.scalar(0.0),
            "places" to Tensor.full(0.0, n, 2),
            "reference" to Tensor.full(0.0, n),
            "tables" to Tensor.full(0.0, 1, n, Grid.SIZE),
        ) + shots(BasisConstants.of(BasisConstants.NAMES[0])!!, 0) // of no effect without new shots
    }

    /** Which shots are new, and the basis of the answer. */
    private fun shots(basis: BasisConstants, new: Int): Map<String, Tensor> = mapOf(
        "new" to Tensor(DoubleArray(k) { if (it < new) 1.0 else 0.0 }, k),
        "mean" to Tensor(basis.mean, 3, Nodes.SIZE),
        "dictionary" to Tensor(
            DoubleArray(basis.dictionary.size) { ssf.priorScale * basis.dictionary[it] }, 3, Nodes.SIZE, basis.atoms,
        ),
    )

    private fun rows(value: (Int) -> Double) = Tensor(DoubleArray(3 * k * n, value), k, n, 3)

    /** Those that the one shot's frames leave open, patches last. */
    private fun explanations(shot: MeasuredShot, parts: Map<String, DoubleArray>): List<Explanation> {
        val gains = KINDS.zip(parts.getValue("gain").toList()).toMap()
        val amounts = ONE_DIRECTION.zip(parts.getValue("amount").toList()).toMap()
        val open = KINDS.filterNot {
            (it == Cause.BLACK && shot.means.dark != null) || (it == Cause.WHITE && shot.means.white == null)
        }
        val ofPatches = parts.getValue("patch_gain")
        return open.map { Explanation(it, null, gains.getValue(it), amounts[it] ?: 0.0) } +
            used(signals, 0).map { Explanation(Cause.PATCH, it, ofPatches[it], 0.0) }
    }

    /** The one shot's white signal over the largest one, both above dark, (1, n, 3); 1 where it is not used. */
    private fun level(shot: MeasuredShot): Tensor = rows {
        val dark = signals.sharedDark[it]
        if (signals.sharedUsed[it / 3]) (signals.sharedWhite[it] - dark) / (shot.means.saturation - dark) else 1.0
    }

    /**
     * Uneven light over the one shot's chart, (f, 1, n): a plane and a bowl, or cubic terms if Σ includes these; and its
     * level if the white patch is the reference.
     */
    private fun fields(shot: MeasuredShot): Tensor {
        val (x, y) = places(shot.pose)
        val solved = gains != null
        val falls: List<(Double, Double) -> Double> = if (solved) {
            listOf({ u, _ -> u * u * u }, { u, v -> u * u * v }, { u, v -> u * v * v }, { _, v -> v * v * v })
        } else {
            listOf({ u, _ -> u }, { _, v -> v }, { u, v -> u * u + v * v })
        }
        val level: List<(Double, Double) -> Double> = if (shot.means.white ==
            null
        ) {
            listOf({ _, _ -> 1.0 })
        } else {
            emptyList()
        }
        val every = falls + level
        return Tensor(DoubleArray(every.size * n) { every[it / n](x[it % n], y[it % n]) }, every.size, 1, n)
    }

    /** Centres X, Y (n) of the patches, about the mean of the used ones, divided by the larger range. */
    private fun places(pose: ChartPose): List<DoubleArray> {
        val patches = used(signals, 0)
        val centres = List(2) { axis ->
            DoubleArray(n) { i -> (0..3).sumOf { pose.sharedQuads[8 * i + 2 * it + axis] } / 4 }
        }
        val size = max(centres.maxOf { axis -> patches.maxOf { axis[it] } - patches.minOf { axis[it] } }, 1.0)
        return centres.map { axis ->
            val middle = patches.sumOf { axis[it] } / patches.size
            DoubleArray(n) { (axis[it] - middle) / size }
        }
    }

    private companion object {
        val MISFIT = listOf("residual", "prior", "count", "gain", "amount", "patch_gain")
        val CAUSE = listOf("cause", "cause_patch")
        const val DRIFT = "drift"

        /** In the order of the model's output `gain`. */
        val KINDS = listOf(Cause.VEIL, Cause.BLACK, Cause.WHITE, Cause.LIGHT, Cause.TONE)

        /** In the order of the model's output `amount`. */
        val ONE_DIRECTION = listOf(Cause.VEIL, Cause.BLACK, Cause.TONE)
    }
}
