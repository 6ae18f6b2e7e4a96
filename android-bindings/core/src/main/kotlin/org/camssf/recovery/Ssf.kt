package org.camssf.recovery

import org.camssf.Curve
import org.camssf.Grid
import org.camssf.frozen
import org.camssf.short
import java.util.Collections

/**
 * One of the compared hypotheses.
 *
 * @property basis family of the camera, "phones", "cameras" or "ryyb".
 * @property logEvidence ln of the marginal likelihood of the signals, nats, up to a constant common to all
 *   hypotheses: only differences within one capture have a meaning.
 * @property probability posterior probability, 0 to 1; all add up to 1.
 */
public class Hypothesis internal constructor(
    public val basis: String,
    public val logEvidence: Double,
    public val probability: Double,
    kinds: List<String> = emptyList(),
) {
    /** Kind of each shot's light: "daylight", ...; "" for a named lamp. Empty if all lamps were named. */
    public val kinds: List<String> = kinds.frozen()

    private fun parts() = listOf(basis, logEvidence, probability, kinds)

    override fun equals(other: Any?): Boolean = other is Hypothesis && parts() == other.parts()

    override fun hashCode(): Int = parts().hashCode()

    override fun toString(): String =
        "Hypothesis(${(listOf(basis) + kinds).joinToString()}, probability=${short(probability)})"
}

/**
 * A shot's light as estimated from the signals, where its lamp was not named ([org.camssf.spectra.Lamp.auto]). Safe
 * to pass between threads.
 *
 * @property kelvin correlated colour temperature, K (McCamy 1992).
 * @property kelvinStd one standard deviation of `kelvin`, K.
 */
public class EstimatedLamp internal constructor(
    kinds: Map<String, Double>,
    internal val sharedPower: DoubleArray,
    internal val sharedStd: DoubleArray,
    public val kelvin: Double,
    public val kelvinStd: Double,
) {
    /**
     * Posterior probability of each kind, "daylight", "bulb", "white-led", "fluorescent", and "named" for the table of
     * the name that the light was called by; they add up to 1.
     */
    public val kinds: Map<String, Double> = Collections.unmodifiableMap(LinkedHashMap(kinds))

    /** Relative spectral power, of mean 1, averaged over the hypotheses. */
    public val power: Curve get() = Curve(sharedPower)

    /** One standard deviation of [power], within and between the hypotheses. */
    public val std: Curve get() = Curve(sharedStd)

    override fun toString(): String = "EstimatedLamp(${short(kelvin)} ± ${short(kelvinStd)} K, $kinds)"

    internal companion object {
        /** The kind of a lamp that is that of a table. */
        const val NAMED = "named"
    }
}

/**
 * The solver's answer: the curves and what follows from them. Arrays are row-major, columns R, G, B.
 *
 * On a basis with a prior the three channels are one problem, p = 1; on the paper's basis each is one, p = 3.
 *
 * If basis or kind of light were chosen by their evidence and several hypotheses have weight, this is a mixture:
 * values, std, predicted, lamp and gainCode are mixed by the probabilities in [choice]; gap, layersGap and finishSteps
 * are the largest of its parts; all else, also the code, is that of the most probable part, so the values do not
 * follow from it.
 *
 * @property sharedGain (3) raw white signal of each channel relative to green; ones where no frame was given.
 * @property sharedGamma (3) the l1 penalty of each channel's problem.
 * @property l2 the quadratic penalty.
 * @property basis "phones", "cameras", "ryyb" or "gaussian"; of a mixture that of the most probable part.
 */
internal data class Ssf(
    private val curves: Curves,
    private val proof: Proof,
    val sharedGain: DoubleArray,
    val sharedGamma: DoubleArray,
    val l2: Double,
    val basis: String,
    private val family: Family = Family(),
    private val comparison: Comparison = Comparison(),
) {
    override fun toString(): String = "Ssf(basis=$basis, halfWidth=${short(halfWidth)})"

    /**
     * The curves and what belongs to them.
     *
     * @property values (681, 3) on [Grid], scaled so that Σ ρ_w L s dλ = 1 for the first lamp.
     * @property std (681, 3) posterior standard deviation of the curve of peak 1, times its peak; null without a prior.
     * @property code (r, 3) coefficients x.
     * @property codeCovariance (3 r, 3 r) posterior covariance of the code, red's coefficients first, then green's,
     *   then blue's, (H + I)⁻¹; null without a prior.
     * @property predicted (k, n, 3) signals predicted from these curves under `lamp`.
     * @property lamp (k, 681) each shot's lamp: the given one, changed by the estimate of its modes.
     * @property gainCode (k, g) estimated amplitudes v̂ of the gain modes of the light; empty if there are none.
     */
    class Curves(
        val values: DoubleArray,
        val std: DoubleArray?,
        val code: DoubleArray,
        val codeCovariance: DoubleArray?,
        val predicted: DoubleArray,
        val lamp: DoubleArray,
        val gainCode: DoubleArray = DoubleArray(0),
    )

    /**
     * Convergence and evidence.
     *
     * @property gap (3) relative duality gap of each channel's problem: a bound of the distance from the optimum.
     * @property layersGap (p) the same of the layers' solution, before the finish.
     * @property finishSteps (p) pivots of the finish; 0 where the layers' gap was small enough.
     * @property logEvidence ln of the marginal likelihood of the signals under basis and lamps, nats, up to a constant
     *   that depends only on the rows; null without a prior.
     */
    class Proof(
        val gap: DoubleArray,
        val layersGap: DoubleArray,
        val finishSteps: IntArray,
        val logEvidence: Double?,
    )

    /**
     * The camera against the family of its basis, and the chart against its table.
     *
     * @property priorScale width of the prior relative to the learned one: 1, or 4 for a camera that does not belong
     *   to the family.
     * @property test whether it belongs; null if the basis was named.
     * @property chartFading by how much the colours of the chart have faded in this answer, 0 to 1; 0 for none.
     */
    data class Family(val priorScale: Double = 1.0, val test: FamilyTest? = null, val chartFading: Double = 0.0)

    /**
     * The compared hypotheses and what was found among them.
     *
     * @property choice the hypotheses, phones before cameras; empty if nothing was compared.
     * @property lights of each shot the estimated light, null where its lamp was named; empty if all were.
     * @property kinds of the most probable hypothesis, one a shot.
     * @property between (3) share of each channel's variance that is between the hypotheses on the light; null if all
     *   lamps were named.
     * @property halfWidthOfBasis half-width of the most probable basis's hypotheses alone, of one width of its prior;
     *   null if that is the whole answer.
     */
    class Comparison(
        val choice: List<Hypothesis> = emptyList(),
        val lights: List<EstimatedLamp?> = emptyList(),
        val kinds: List<String> = emptyList(),
        val between: DoubleArray? = null,
        val halfWidthOfBasis: Double? = null,
    )

    val sharedValues: DoubleArray get() = curves.values
    val sharedStd: DoubleArray? get() = curves.std
    val sharedCode: DoubleArray get() = curves.code
    val sharedCodeCovariance: DoubleArray? get() = curves.codeCovariance
    val sharedPredicted: DoubleArray get() = curves.predicted
    val sharedLamp: DoubleArray get() = curves.lamp
    val sharedGainCode: DoubleArray get() = curves.gainCode
    val sharedGap: DoubleArray get() = proof.gap
    val sharedLayersGap: DoubleArray get() = proof.layersGap
    val sharedFinishSteps: IntArray get() = proof.finishSteps
    val logEvidence: Double? get() = proof.logEvidence
    val priorScale: Double get() = family.priorScale
    val familyTest: FamilyTest? get() = family.test
    val chartFading: Double get() = family.chartFading
    val choice: List<Hypothesis> get() = comparison.choice
    val lights: List<EstimatedLamp?> get() = comparison.lights
    val kinds: List<String> get() = comparison.kinds
    val between: DoubleArray? get() = comparison.between
    val halfWidthOfBasis: Double? get() = comparison.halfWidthOfBasis

    /** The curve (681) of a channel, of peak 1. */
    fun curve(channel: Int): DoubleArray {
        val peak = peak(channel)
        return DoubleArray(Grid.SIZE) { sharedValues[3 * it + channel] / peak }
    }

    /** One standard deviation (681) of [curve]; null without a prior. */
    fun deviation(channel: Int): DoubleArray? {
        val peak = peak(channel)
        return sharedStd?.let { std -> DoubleArray(Grid.SIZE) { std[3 * it + channel] / peak } }
    }

    private fun peak(channel: Int): Double = (0 until Grid.SIZE).maxOf { sharedValues[3 * it + channel] }

    /** The answer with the predictions (of n patches) and the lamp of shot j only. */
    fun only(j: Int, n: Int): Ssf = with(
        sharedPredicted.copyOfRange(3 * n * j, 3 * n * (j + 1)),
        sharedLamp.copyOfRange(Grid.SIZE * j, Grid.SIZE * (j + 1)),
    )

    /** The answer with these gains (k, g). */
    fun gaining(code: DoubleArray): Ssf = with(sharedPredicted, sharedLamp, code)

    /** The answer with these predicted signals (k, n, 3). */
    fun predicting(predicted: DoubleArray): Ssf = with(predicted, sharedLamp)

    private fun with(predicted: DoubleArray, lamp: DoubleArray, gains: DoubleArray = sharedGainCode): Ssf =
        copy(curves = Curves(sharedValues, sharedStd, sharedCode, sharedCodeCovariance, predicted, lamp, gains))

    /** This answer of a prior `scale` times as wide as that of `wide`, with the bands of `wide` and in its units. */
    fun withBandsOf(wide: Ssf, scale: Double): Ssf {
        val bands = List(3) { wide.deviation(it)!! }
        val peaks = List(3) { peak(it) }
        val std = DoubleArray(3 * Grid.SIZE) { bands[it % 3][it / 3] * peaks[it % 3] }
        val code = DoubleArray(sharedCode.size) { scale * sharedCode[it] }
        val own = Curves(
            sharedValues, std, code, wide.sharedCodeCovariance, sharedPredicted, sharedLamp, sharedGainCode,
        )
        return copy(curves = own, family = Family(wide.priorScale), comparison = Comparison(choice))
    }

    /** The answer with the hypotheses that it was chosen among, and the estimated lights. */
    fun chosen(
        choice: List<Hypothesis>,
        lights: List<EstimatedLamp?> = emptyList(),
        kinds: List<String> = emptyList(),
        between: DoubleArray? = null,
        halfWidthOfBasis: Double? = null,
    ): Ssf = copy(comparison = Comparison(choice, lights, kinds, between, halfWidthOfBasis))

    /** The answer with the outcome of its test, and by how much the chart has faded. */
    fun withFamilyTest(test: FamilyTest, chartFading: Double): Ssf =
        copy(family = Family(priorScale, test, chartFading))

    /** The mixture of which this is the most probable part: these curves and proof, all else as here. */
    fun mixed(
        values: DoubleArray,
        std: DoubleArray?,
        predicted: DoubleArray,
        lamp: DoubleArray,
        gainCode: DoubleArray,
        proof: Proof,
    ): Ssf {
        val curves = Curves(values, std, sharedCode, sharedCodeCovariance, predicted, lamp, gainCode)
        return copy(curves = curves, proof = proof, family = Family(priorScale), comparison = Comparison(choice))
    }

    /** The same answer with curves, bands and proof that are mixed with those of another width of its prior. */
    fun ofTwoWidths(
        values: DoubleArray,
        std: DoubleArray?,
        predicted: DoubleArray,
        proof: Proof,
        between: DoubleArray?,
    ): Ssf {
        val curves = Curves(values, std, sharedCode, sharedCodeCovariance, predicted, sharedLamp, sharedGainCode)
        val width = halfWidthOfBasis ?: halfWidth
        return copy(curves = curves, proof = proof, comparison = Comparison(choice, lights, kinds, between, width))
    }

    /** Mean half-width of the 95 % band, 400 to 700 nm, in parts of the peak; 0 without a prior. */
    val halfWidth: Double by lazy { if (sharedStd == null) 0.0 else halfWidth(List(3) { deviation(it)!! }) }

    /** [halfWidth] of the basis's mean camera before any photo, under the learned prior; null without a prior. */
    val halfWidthWithoutPhoto: Double? get() = PriorBand.halfWidth(basis)
}

/** 95 % of a normal distribution lie within so many standard deviations of its mean. */
internal const val BAND = 1.96

/** Mean half-width of the 95 % bands, 400 to 700 nm, of three curves' standard deviations (681). */
internal fun halfWidth(deviations: List<DoubleArray>): Double =
    (40..640).sumOf { m -> deviations.sumOf { BAND * it[m] } } / (3 * 601)

/** Signals (k, n, 3) of patches (n, 681) under lamps (k, 681), Eq. (5), from curves (681, 3) of any scale. */
internal fun predictSignals(
    values: DoubleArray,
    reflectance: DoubleArray,
    lamp: DoubleArray,
    white: DoubleArray,
): DoubleArray {
    val n = reflectance.size / Grid.SIZE
    val level = whiteSignals(values, lamp, white)
    val predicted = DoubleArray(3 * n * (lamp.size / Grid.SIZE))
    for (j in 0 until lamp.size / Grid.SIZE) {
        for (c in 0..2) {
            val seen = DoubleArray(Grid.SIZE) { lamp[j * Grid.SIZE + it] * values[3 * it + c] }
            for (i in 0 until n) {
                val from = i * Grid.SIZE
                predicted[3 * (j * n + i) + c] =
                    (0 until Grid.SIZE).sumOf { reflectance[from + it] * seen[it] } / level[3 * j + c]
            }
        }
    }
    return predicted
}

/** Signals (k, 3) of the white reference (681) under lamps (k, 681), from curves (681, 3) of any scale. */
internal fun whiteSignals(values: DoubleArray, lamp: DoubleArray, white: DoubleArray): DoubleArray =
    DoubleArray(lamp.size / Grid.SIZE * 3) { at ->
        val from = at / 3 * Grid.SIZE
        (0 until Grid.SIZE).sumOf { white[it] * (lamp[from + it] * values[3 * it + at % 3]) }
    }
