package org.camssf.verdict

import org.camssf.Reason
import org.camssf.recovery.Choice
import kotlin.math.exp
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.sqrt

/**
 * Whether a unit's blue curve has moved since its previous result (rule 10 of docs/verdict.md): Python's
 * camssf.verdict.unit_drift.
 */
internal object UnitDrift {
    const val DRIFT = "unit_drift"
    private const val FIT = "goodness_of_fit"
    private const val RIVAL = "rival"

    /**
     * Probability that the blue curve has moved before the first `new` shots, at prior odds of 1 : 1; the drifts of
     * [VerdictInputs.driftEvidences] are equally probable.
     *
     * @param basis of the answer.
     * @param new number of new shots; they are the first ones.
     */
    fun probability(inputs: VerdictInputs, basis: String, new: Int): Double {
        val nats = inputs.driftEvidences(basis, new).toList()
        return 1.0 / (1.0 + exp(ln(nats.size.toDouble()) - Choice.logSum(nats)))
    }

    /**
     * Why new shots and those of a previous result have no common answer: a drift, or a bad fit of both together;
     * null if they have one, and where another lamp of a new shot explains more than a drift, or explains that shot alone
     * better than its lamp: then that lamp's name is wrong.
     *
     * @param joint the checks of the answer to all shots. @param alone those of the answer to the new ones.
     */
    fun contradiction(joint: List<Check>, alone: List<Check>): Reason? {
        val drift = find(joint, DRIFT)
        val (rival, own) = listOf(joint, alone).map { checks ->
            checks.filter { it.name == RIVAL && it.value > it.limit }.maxOfOrNull { it.value } ?: 0.0
        }
        if (own > 0.0 || rival > (drift?.let { nats(it.value) } ?: 0.0)) return null
        if (drift != null && drift.value > drift.limit) {
            return Reasons.because("drift", drift.value, mapOf("probability" to drift.value), threshold = drift.limit)
        }
        val fit = find(joint, FIT) ?: return null
        val over = find(joint, "misfit_refuses") ?: return null
        val ownFit = find(alone, FIT)
        if (fit.value <= fit.limit || (ownFit != null && ownFit.value > ownFit.limit)) return null
        return Reasons.because("contradiction", fit.value, mapOf("size" to sqrt(over.value)))
    }

    /** ln of the odds. */
    private fun nats(probability: Double) = ln(probability / max(1.0 - probability, Math.ulp(1.0)))

    private fun find(checks: List<Check>, name: String) = checks.firstOrNull { it.name == name }
}
