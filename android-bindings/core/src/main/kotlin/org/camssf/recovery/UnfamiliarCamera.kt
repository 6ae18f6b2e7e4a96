package org.camssf.recovery

import org.camssf.Rules
import kotlin.math.cbrt
import kotlin.math.exp
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.min
import kotlin.math.sqrt

/**
 * Whether a camera belongs to the family of its basis.
 *
 * @property length z(x), the length of the code as a standard normal number under the prior.
 * @property lampResidual gain in ln of the evidence if the named lamps may err by much more than declared; null if none
 *   was named.
 * @property longest limit of `length`. @property largest limit of `lampResidual`.
 */
internal class FamilyTest(val length: Double, val lampResidual: Double?, val longest: Double, val largest: Double) {
    /** Whether both numbers are within their limits. */
    val passed: Boolean get() = length <= longest && (lampResidual == null || lampResidual <= largest)
}

/**
 * Tests whether a camera belongs to the family of its basis (docs/verdict.md, rule 7). By the probability that it does
 * not, the answer is mixed with that of a prior [WIDER] times as wide. Python's camssf.recovery.unfamiliar_camera.
 */
internal object UnfamiliarCamera {
    /** Width of the prior of an unfamiliar camera, relative to the learned one. */
    val WIDER get() = Rules.shipped.number("choice.wider")

    /** Prior probability that a camera belongs to no family. */
    private val STRANGER get() = Rules.shipped.number("choice.stranger")

    /** Mean and standard deviation of z(x) of a family's members, and the latter of strangers, whose mean is 0. */
    private val FAMILIAR get() = Rules.shipped.number("choice.familiar")
    private val FAMILIAR_STD get() = Rules.shipped.number("choice.familiar_std")
    private val STRANGER_STD get() = Rules.shipped.number("choice.stranger_std")

    /** z(x) of the least odds of a stranger: below it they would rise again, since strangers spread more. */
    private val leastStrange: Double
        get() = FAMILIAR / (1.0 - (FAMILIAR_STD / STRANGER_STD) * (FAMILIAR_STD / STRANGER_STD))

    /** Largest ln of odds: the exponential of a larger one is no number. */
    private const val LARGEST = 700.0

    /** Smallest probability of a camera of no family at which the answer of a wider prior is computed. */
    private val UNFAMILIAR get() = Rules.shipped.number("choice.unfamiliar")

    /** Smooth relative error that a named lamp may have in the lamp residual. */
    private val LAMP_ERROR get() = Rules.shipped.number("choice.lamp_error")

    /** Tests an answer of the learned width; `named` says of which shots the lamp was named. */
    fun test(engine: Engine, observation: Observation, answer: Ssf, named: List<Boolean>): FamilyTest {
        val residual = if (named.any { it }) lampResidual(engine, observation, answer.logEvidence!!, named) else null
        val basis = engine.basis
        val longest = longestCode(basis, named.all { it })
        return FamilyTest(codeLength(answer)!!, residual, longest, largestResidual(basis))
    }

    /** Probability that a camera belongs to no family; 1 where the lamp residual is beyond its limit. */
    private fun strangerProbability(test: FamilyTest): Double {
        if (test.lampResidual != null && test.lampResidual > test.largest) return 1.0
        val z = max(test.length, leastStrange)
        val member = (z - FAMILIAR) / FAMILIAR_STD
        val stranger = z / STRANGER_STD
        val odds = ln(STRANGER / (1.0 - STRANGER) * FAMILIAR_STD / STRANGER_STD) +
            0.5 * (member * member - stranger * stranger)
        return 1.0 / (1.0 + exp(-min(odds, LARGEST)))
    }

    /**
     * The answer mixed with that of a wider prior by the probability that the camera belongs to no family.
     *
     * @param known of an answer: what was known under its hypothesis.
     * @param wider gives the answer of a prior [WIDER] times as wide, with the hypotheses of the first.
     */
    fun mixed(answer: Ssf, test: FamilyTest, known: (Ssf) -> Known, wider: () -> Ssf): Ssf {
        val share = strangerProbability(test)
        if (share < UNFAMILIAR) return answer
        return Mixture(listOf(answer, wider()), listOf(1.0 - share, share)).ofTwoWidths(known)
    }

    /**
     * z(x): the length of the code as a standard normal number under the prior; null without a prior. Under the prior
     * the posterior mean x is N(0, K), K = I - C: xᵀx is nearly a scaled χ² (Satterthwaite 1946).
     */
    fun codeLength(answer: Ssf): Double? {
        val covariance = answer.sharedCodeCovariance.takeIf { answer.sharedStd != null } ?: return null
        val size = answer.sharedCode.size
        var expected = 0.0
        var squares = 0.0
        for (at in covariance.indices) {
            val own = (if (at / size == at % size) 1.0 else 0.0) - covariance[at]
            squares += own * own
            if (at / size == at % size) expected += own
        }
        if (expected <= 0) return null // the posterior equals the prior
        val u = 2.0 * squares / (9.0 * expected * expected)
        return (cbrt(answer.sharedCode.sumOf { it * it } / expected) - (1.0 - u)) / sqrt(u)
    }

    /** Limit of [codeLength] on a basis; `named` says whether every lamp was named. */
    fun longestCode(basis: String, named: Boolean): Double = Rules.shipped.number(
        when (basis) {
            "phones", "ryyb" -> if (named) "verdict.unusual_phone" else "verdict.unusual_phone_unnamed"
            "cameras" -> "verdict.unusual_camera"
            else -> "verdict.improbable_curves"
        },
    )

    /** Limit of the lamp residual on a basis. */
    private fun largestResidual(basis: String): Double =
        Rules.shipped.number(if (basis == "cameras") "verdict.lamp_residual_camera" else "verdict.lamp_residual")

    /** ln of the evidence with errors of [LAMP_ERROR] in named lamps, minus that with the declared ones. */
    private fun lampResidual(
        engine: Engine,
        observation: Observation,
        logEvidence: Double,
        named: List<Boolean>,
    ): Double {
        val declared = observation.known.lampTolerance
        val loose = DoubleArray(named.size) {
            if (named[it]) max(declared.values[it], LAMP_ERROR) else declared.values[it]
        }
        val known = observation.known.withLampTolerance(Tensor(loose, named.size))
        val given = Observation(observation.signals, observation.standardError, known)
        return Recover.logEvidence(engine, given, 1.0) - logEvidence
    }
}
