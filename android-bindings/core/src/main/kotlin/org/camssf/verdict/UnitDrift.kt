package org.camssf.verdict

import org.camssf.Grid
import org.camssf.LeastSquares
import org.camssf.Reason
import org.camssf.Rules
import org.camssf.recovery.Choice
import org.camssf.recovery.LearnedBasis
import kotlin.math.exp
import kotlin.math.ln
import kotlin.math.ln1p
import kotlin.math.max
import kotlin.math.min
import kotlin.math.roundToInt
import kotlin.math.sqrt

/**
 * Whether a unit's blue curve has moved since its previous result (rule 10 of docs/verdict.md): Python's
 * camssf.verdict.unit_drift.
 */
internal object UnitDrift {
    const val DRIFT = "unit_drift"
    private const val BLUE = 2
    private const val FIT = "goodness_of_fit"

    /** One standard deviation of a drift, in steps of the grid. */
    private val STEPS get() = (Rules.shipped.number("verdict.unit_drift_size") / Grid.STEP).roundToInt()

    /**
     * Probability that the blue curve has moved before the first `new` shots, at prior odds of 1 : 1.
     *
     * A drift v ~ N(0, 1) moves the blue curve, or its long-wave or short-wave flank, by v · STEPS in these shots.
     * With Σ of rule 1 and r = y - ŷ at the answer, and d and A the derivatives of ŷ by the drift and by the code:
     * g = dᵀ (Σ + A Aᵀ)⁻¹ r, G = dᵀ (Σ + A Aᵀ)⁻¹ d, and the ln of the Bayes factor is ½ g² / (1 + G) - ½ ln(1 + G).
     *
     * @param basis of the answer.
     * @param new number of new shots; they are the first ones.
     */
    fun probability(inputs: VerdictInputs, basis: LearnedBasis, new: Int): Double {
        val rows = Rows(inputs.signals)
        val covariance = Covariance(inputs, rows)
        val precision = Precision(covariance.blocks, covariance.shared)
        val derivative = Array(rows.size) { byCurve(inputs, rows, it) }
        fun column(channel: Int, first: Int, change: DoubleArray) = DoubleArray(rows.size) { row ->
            if (rows.channel(row) == channel && rows.shot(row) < first) dot(derivative[row], change) else 0.0
        }
        val code = (0..2).flatMap { c ->
            atoms(inputs, basis, c).map { precision.weighed(column(c, inputs.lamps.size, it)) }
        }
        val blue = DoubleArray(Grid.SIZE) { inputs.ssf.sharedValues[3 * it + BLUE] }
        val drifts = moves(blue).map { precision.weighed(column(BLUE, new, it)) }
        val off = rows.of(inputs.signals.sharedValues)
        for (row in off.indices) off[row] -= inputs.ssf.sharedPredicted[rows.at[row]]
        val rest = precision.weighed(off)
        val capacity = Array(code.size) { a ->
            DoubleArray(code.size) { b -> dot(code[a], code[b]) + if (a == b) 1.0 else 0.0 }
        }
        val pull = DoubleArray(code.size) { dot(code[it], rest) }
        val nats = drifts.map { d ->
            val hidden = DoubleArray(code.size) { dot(code[it], d) }
            val free = checkNotNull(LeastSquares.solve(capacity, hidden)) // Woodbury: what another code would explain
            val size = dot(d, d) - dot(hidden, free)
            val slope = dot(d, rest) - dot(free, pull)
            0.5 * slope * slope / (1.0 + size) - 0.5 * ln1p(size)
        }
        return 1.0 / (1.0 + exp(ln(nats.size.toDouble()) - Choice.logSum(nats)))
    }

    /** Derivative (681) of a row's signal by its channel's curve, (R - ŷ ρ_w) L dλ / W. */
    private fun byCurve(inputs: VerdictInputs, rows: Rows, row: Int): DoubleArray {
        val rho = inputs.whiteReflectance
        val from = rows.shot(row) * Grid.SIZE
        val lamp = inputs.ssf.sharedLamp
        val curves = inputs.ssf.sharedValues
        val channel = rows.channel(row)
        val white = (0 until Grid.SIZE).sumOf { lamp[from + it] * rho[it] * curves[3 * it + channel] }
        val predicted = inputs.ssf.sharedPredicted[rows.at[row]]
        val patch = rows.patch(row) * Grid.SIZE
        val table = inputs.table.sharedValues
        return DoubleArray(Grid.SIZE) { (table[patch + it] - predicted * rho[it]) * lamp[from + it] / white }
    }

    /**
     * Derivatives (681) of the answer's curve by the code: the basis's anchored atoms over its white signal under the
     * first lamp, which no atom changes.
     */
    private fun atoms(inputs: VerdictInputs, basis: LearnedBasis, channel: Int): List<DoubleArray> {
        val lamp = inputs.lamps[0].sharedValues
        val white = DoubleArray(Grid.SIZE) { inputs.whiteReflectance[it] * lamp[it] * Grid.STEP }
        val mean = basis.mean[channel]
        val scale = dot(white, mean)
        return basis.dictionary[channel].map { atom ->
            val share = dot(white, atom) / scale
            DoubleArray(Grid.SIZE) { inputs.ssf.priorScale * (atom[it] - mean[it] * share) / scale }
        }
    }

    /** Changes (681) of a curve whose whole, long-wave flank or short-wave flank moves by STEPS to the red. */
    internal fun moves(curve: DoubleArray): List<DoubleArray> {
        val peak = curve.indices.maxByOrNull { curve[it] }!!
        val steps = STEPS
        return listOf<(Int) -> Int>(
            { max(it - steps, 0) },
            { if (it > peak) max(it - steps, peak) else it },
            { if (it < peak) max(it - steps, 0) else it },
        ).map { from -> DoubleArray(curve.size) { curve[from(it)] - curve[it] } }
    }

    /**
     * Why new shots and those of a previous result have no common answer: a drift, or a bad fit of both together;
     * null if they have one.
     *
     * @param joint the checks of the answer to all shots. @param alone those of the answer to the new ones.
     */
    fun contradiction(joint: List<Check>, alone: List<Check>): Reason? {
        val drift = find(joint, DRIFT)
        if (drift != null && drift.value > drift.limit) {
            return Reasons.because("drift", drift.value, mapOf("probability" to drift.value), threshold = drift.limit)
        }
        val fit = find(joint, FIT) ?: return null
        val over = find(joint, "misfit_refuses") ?: return null
        val own = find(alone, FIT)
        if (fit.value <= fit.limit || (own != null && own.value > own.limit)) return null
        return Reasons.because("contradiction", fit.value, mapOf("size" to sqrt(over.value)))
    }

    private fun find(checks: List<Check>, name: String) = checks.firstOrNull { it.name == name }
}
