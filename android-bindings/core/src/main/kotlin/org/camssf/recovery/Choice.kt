package org.camssf.recovery

import org.camssf.Rules
import kotlin.math.exp
import kotlin.math.ln

/**
 * Evidence → the basis that answers: phones, cameras, or a mixture of both, by their marginal likelihood.
 *
 * Which family a camera belongs to, and whether it lies as near to it as those that the basis was learned from, is weighed
 * by the evidence of each hypothesis. A clear winner answers alone; else the answers are mixed by their probabilities, and
 * their bands by the law of total variance. Python's camssf.recovery.hypotheses, in its order.
 */
internal object Choice {
    const val AUTO = "auto"

    /** The bases that `auto` chooses from, in this order. */
    val FAMILIES = listOf("phones", "cameras")

    /** How much wider a camera may lie than those that its basis was learned from. */
    val SCALES: List<Double> get() = listOf(1.0, Rules.shipped.number("choice.wide"))

    /** What is believed of the second scale beforehand. */
    private val UNUSUAL get() = Rules.shipped.number("choice.unusual")

    /** Odds at which a basis answers alone. */
    val CLEAR get() = Rules.shipped.number("choice.clear")

    /** An answer of a smaller weight moves no curve. */
    private const val NEGLIGIBLE = 1e-6

    /**
     * What a file's own words for maker and model say of the basis beforehand: odds by basis, never a proof. Who makes both
     * is told by the model's first letters.
     */
    fun believed(make: String, model: String): Map<String, Double> {
        val name = "$make $model".lowercase()
        return Rules.shipped.makers.filterValues { makers -> makers.any { name.startsWith(it) } }.mapValues { CLEAR }
    }

    /** A basis and how wide its prior is taken, with ln of what is believed of both beforehand. */
    class Family(val engine: Engine, val scale: Double, val belief: Double)

    /** All that is weighed where nobody told the basis, with the odds of each family beforehand. */
    fun asked(engines: List<Engine>, prior: Map<String, Double>): List<Family> = engines.flatMap { engine ->
        val odds = prior[engine.basis] ?: 1.0
        SCALES.zip(listOf(1.0 - UNUSUAL, UNUSUAL)) { scale, belief -> Family(engine, scale, ln(odds * belief)) }
    }

    /**
     * The curves that explain the signals, on the basis that they speak for.
     *
     * @param engines of [FAMILIES], in this order.
     * @param prior the odds of each family beforehand; equal where nothing is said.
     * @throws org.camssf.CalibrationException as [Recover.recover] does, of any of the four answers.
     */
    fun recover(
        engines: List<Engine>,
        observation: Observation,
        frames: Frames?,
        penalties: Penalties,
        prior: Map<String, Double>,
    ): Ssf {
        val asked = asked(engines, prior)
        val answers = asked.map { Recover.recover(it.engine, observation, frames, penalties, it.scale) }
        return choose(observation.known, answers, asked.map { it.belief })
    }

    /** One answer of several to the same signals, each with ln of what was believed of it beforehand. */
    fun choose(known: Known, answers: List<Ssf>, beliefs: List<Double>): Ssf {
        val likely = probabilities(answers.mapIndexed { i, each -> each.logEvidence!! + beliefs[i] })
        val told = answers.mapIndexed { i, each ->
            Hypothesis(each.basis, each.priorScale, each.logEvidence!!, likely[i])
        }
        val weights = posteriorWeights(told)
        val kept = answers.indices.filter { weights[it] > NEGLIGIBLE }
        if (kept.size == 1) return answers[kept[0]].chosen(told)
        val mixture = Mixture(kept.map { answers[it] }, kept.map { weights[it] })
        return mixture.ssf(known, mixture.mean { it.sharedLamp }).chosen(told)
    }

    /** The weights that answer: a basis that is [CLEAR] times as probable as all others answers alone. */
    fun posteriorWeights(told: List<Hypothesis>): List<Double> {
        val share = told.groupBy { it.basis }.mapValues { (_, own) -> own.sumOf { it.probability } }
        val winner = share.maxByOrNull { it.value }!!
        val clear = winner.value >= CLEAR * (1.0 - winner.value)
        val weights = told.map { if (clear && it.basis != winner.key) 0.0 else it.probability }
        return weights.map { it / weights.sum() }
    }

    /** e^l / Σ e^l without overflow. */
    fun probabilities(logarithms: List<Double>): List<Double> {
        val largest = logarithms.max()
        val weights = logarithms.map { exp(it - largest) }
        return weights.map { it / weights.sum() }
    }
}
