package org.camssf.recovery

import org.camssf.Channel
import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.frozen
import org.camssf.short
import java.util.Collections
import kotlin.math.min

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
    /** Posterior probability of each kind, "daylight", "bulb", "white-led", "fluorescent"; they add up to 1. */
    public val kinds: Map<String, Double> = Collections.unmodifiableMap(LinkedHashMap(kinds))

    /** (681) relative spectral power on [Grid], of mean 1, averaged over the hypotheses; a copy. */
    public fun copyPower(): DoubleArray = sharedPower.copyOf()

    /** (681) one standard deviation of [copyPower], within and between the hypotheses; a copy. */
    public fun copyStd(): DoubleArray = sharedStd.copyOf()

    override fun toString(): String = "EstimatedLamp(${short(kelvin)} ± ${short(kelvinStd)} K, $kinds)"
}

/**
 * The recovered spectral sensitivity functions. Arrays are row-major, with columns R, G, B. A `copy` function
 * copies its array, so call it once before a loop. Safe to pass between threads.
 *
 * On a basis with a prior the three channels are one problem, p = 1; on the paper's basis each is one, p = 3.
 *
 * If basis or kind of light were chosen by their evidence and several hypotheses have weight, this is a mixture:
 * [copyValues], [copyStd], [copyPredicted], [copyLamp] and [copyGainCode] are mixed by the probabilities in
 * [choice]; [copyGap], [copyLayersGap] and [copyFinishSteps] are the largest of its parts; all else, also [copyCode], is that of the most probable part, so
 * [copyValues] do not follow from it. [lights] holds the estimated lights.
 *
 * @property l2 the quadratic penalty.
 * @property basis its name, "phones", "cameras", "ryyb" or "gaussian"; of a mixture that of the most probable part.
 * @property priorScale width of the prior relative to the learned one: 1, or 4 for a camera that does not belong to the
 *   family of its basis.
 * @property chartFading by how much the colours of the chart have faded in this answer, 0 to 1; 0 for none.
 */
public class Ssf internal constructor(
    private val curves: Curves,
    private val proof: Proof,
    internal val sharedGain: DoubleArray,
    internal val sharedGamma: DoubleArray,
    public val l2: Double,
    public val basis: String,
    public val priorScale: Double = 1.0,
    choice: List<Hypothesis> = emptyList(),
    lights: List<EstimatedLamp?> = emptyList(),
    internal val kinds: List<String> = emptyList(),
    /**
     * (3) share of each channel's variance that is between the hypotheses on the light; null if all lamps were named.
     */
    internal val between: DoubleArray? = null,
    /** Whether the camera belongs to the family of its basis; null if the basis was named. */
    internal val familyTest: FamilyTest? = null,
    public val chartFading: Double = 0.0,
    /** [halfWidth] of the most probable basis's hypotheses alone; null if all lamps were named. */
    internal val halfWidthOfBasis: Double? = null,
) {
    /**
     * The compared hypotheses, if basis or kind of light were chosen by their evidence, phones before cameras; else
     * empty.
     */
    public val choice: List<Hypothesis> = choice.frozen()

    /** Of each shot the estimated light, null where its lamp was named; empty if all were. */
    public val lights: List<EstimatedLamp?> = lights.frozen()

    override fun toString(): String = "Ssf(basis=$basis, halfWidth=${short(halfWidth)})"

    /** The curves and what belongs to them; shapes and units as of the public properties of these names. */
    internal class Curves(
        val values: DoubleArray,
        val std: DoubleArray?,
        val code: DoubleArray,
        val codeCovariance: DoubleArray?,
        val predicted: DoubleArray,
        val lamp: DoubleArray,
        val gainCode: DoubleArray = DoubleArray(0),
    )

    /** Convergence and evidence; shapes and units as of the public properties of these names. */
    internal class Proof(
        val gap: DoubleArray,
        val layersGap: DoubleArray,
        val finishSteps: IntArray,
        val logEvidence: Double?,
    )

    internal val sharedValues: DoubleArray get() = curves.values
    internal val sharedStd: DoubleArray? get() = curves.std
    internal val sharedCode: DoubleArray get() = curves.code
    internal val sharedCodeCovariance: DoubleArray? get() = curves.codeCovariance
    internal val sharedPredicted: DoubleArray get() = curves.predicted
    internal val sharedLamp: DoubleArray get() = curves.lamp
    internal val sharedGainCode: DoubleArray get() = curves.gainCode
    internal val sharedGap: DoubleArray get() = proof.gap
    internal val sharedLayersGap: DoubleArray get() = proof.layersGap
    internal val sharedFinishSteps: IntArray get() = proof.finishSteps

    /** (681, 3) on [Grid], scaled so that Σ ρ_w L s dλ = 1 for the first lamp; [curve] gives peak 1. */
    public fun copyValues(): DoubleArray = sharedValues.copyOf()

    /**
     * (681, 3) posterior standard deviation of the curve of peak 1, times its peak; null on a basis without a prior.
     */
    public fun copyStd(): DoubleArray? = sharedStd?.copyOf()

    /** (r, 3) coefficients x. */
    public fun copyCode(): DoubleArray = sharedCode.copyOf()

    /**
     * (3 r, 3 r) posterior covariance of [copyCode], red's r coefficients first, then green's, then blue's, (H + I)⁻¹;
     * null on a basis without a prior.
     */
    public fun copyCodeCovariance(): DoubleArray? = sharedCodeCovariance?.copyOf()

    /** (k, n, 3) signals predicted from these curves under [copyLamp], 1. */
    public fun copyPredicted(): DoubleArray = sharedPredicted.copyOf()

    /** (3) relative duality gap of each channel's problem, 1: a bound of the distance from the optimum. */
    public fun copyGap(): DoubleArray = sharedGap.copyOf()

    /** (p) the same of the layers' solution, before the finish. */
    public fun copyLayersGap(): DoubleArray = sharedLayersGap.copyOf()

    /** (p) pivots of the finish; 0 where the layers' gap was small enough. */
    public fun copyFinishSteps(): IntArray = sharedFinishSteps.copyOf()

    /**
     * ln of the marginal likelihood of the signals under basis and lamps, nats, up to a constant that depends only on
     * the rows; null on a basis without a prior.
     */
    public val logEvidence: Double? get() = proof.logEvidence

    /** (3) the l1 penalty of each channel's problem. */
    public fun copyGamma(): DoubleArray = sharedGamma.copyOf()

    /** (3) raw white signal of each channel relative to green; ones where no frame was given. */
    public fun copyChannelGain(): DoubleArray = sharedGain.copyOf()

    /** (k, 681) each shot's lamp: the given one, changed by the estimate of its modes. */
    public fun copyLamp(): DoubleArray = sharedLamp.copyOf()

    /**
     * (k, g) estimated amplitudes v̂ of the gain modes of the light; empty if there are none, as with a white frame.
     * [org.camssf.Calibrated.level] is the correction that follows from them.
     */
    public fun copyGainCode(): DoubleArray = sharedGainCode.copyOf()

    /** The curve (681) of a channel, of peak 1. */
    public fun curve(channel: Channel): DoubleArray = curve(channel.ordinal)

    /** One standard deviation (681) of [curve]; null on a basis without a prior. */
    public fun deviation(channel: Channel): DoubleArray? = deviation(channel.ordinal)

    /** Half-width (681) of the 95 % band about [curve], 1.96 standard deviations; null on a basis without a prior. */
    public fun band(channel: Channel): DoubleArray? = band(channel.ordinal)

    /**
     * The curve of a channel at a wavelength, linear between the points of [Grid]; the peak is 1.
     *
     * @throws InvalidArgument the wavelength lies outside 380 to 720 nm.
     */
    public fun at(nm: Double, channel: Channel): Double = between(nm, curve(channel))

    /** Half-width of the 95 % band about [at]; null on a basis without a prior. */
    public fun bandAt(nm: Double, channel: Channel): Double? = band(channel)?.let { between(nm, it) }

    private fun between(nm: Double, values: DoubleArray): Double {
        val place = (nm - 380.0) / Grid.STEP
        if (!(place >= 0.0 && place <= Grid.SIZE - 1)) {
            throw InvalidArgument("$nm nm lies outside 380 to 720 nm.", "Ask for a wavelength of that range.")
        }
        val left = min(place.toInt(), Grid.SIZE - 2)
        return values[left] + (place - left) * (values[left + 1] - values[left])
    }

    internal fun curve(channel: Int): DoubleArray {
        val peak = peak(channel)
        return DoubleArray(Grid.SIZE) { sharedValues[3 * it + channel] / peak }
    }

    internal fun deviation(channel: Int): DoubleArray? {
        val peak = peak(channel)
        return sharedStd?.let { std -> DoubleArray(Grid.SIZE) { std[3 * it + channel] / peak } }
    }

    internal fun band(channel: Int): DoubleArray? =
        deviation(channel)?.let { std -> DoubleArray(std.size) { 1.96 * std[it] } }

    private fun peak(channel: Int): Double = (0 until Grid.SIZE).maxOf { sharedValues[3 * it + channel] }

    /** The answer with the predictions (of n patches) and the lamp of shot j only. */
    internal fun only(j: Int, n: Int): Ssf = with(
        sharedPredicted.copyOfRange(3 * n * j, 3 * n * (j + 1)),
        sharedLamp.copyOfRange(Grid.SIZE * j, Grid.SIZE * (j + 1)),
    )

    /** The answer with these gains (k, g). */
    internal fun gaining(code: DoubleArray): Ssf = with(sharedPredicted, sharedLamp, code)

    /** The answer with these predicted signals (k, n, 3). */
    internal fun predicting(predicted: DoubleArray): Ssf = with(predicted, sharedLamp)

    private fun with(predicted: DoubleArray, lamp: DoubleArray, gains: DoubleArray = sharedGainCode): Ssf {
        val seen = Curves(sharedValues, sharedStd, sharedCode, sharedCodeCovariance, predicted, lamp, gains)
        return copy(curves = seen)
    }

    /** This answer of a prior `scale` times as wide as that of `wide`, with the bands of `wide` and in its units. */
    internal fun withBandsOf(wide: Ssf, scale: Double): Ssf {
        val bands = List(3) { wide.deviation(it)!! }
        val peaks = List(3) { peak(it) }
        val std = DoubleArray(3 * Grid.SIZE) { bands[it % 3][it / 3] * peaks[it % 3] }
        val code = DoubleArray(sharedCode.size) { scale * sharedCode[it] }
        val own = Curves(
            sharedValues, std, code, wide.sharedCodeCovariance, sharedPredicted, sharedLamp, sharedGainCode,
        )
        return Ssf(own, proof, sharedGain, sharedGamma, l2, basis, wide.priorScale, choice)
    }

    /** The answer with the hypotheses that it was chosen among, and the estimated lights. */
    internal fun chosen(
        choice: List<Hypothesis>,
        lights: List<EstimatedLamp?> = emptyList(),
        kinds: List<String> = emptyList(),
        between: DoubleArray? = null,
        halfWidthOfBasis: Double? = null,
    ): Ssf = Ssf(
        curves, proof, sharedGain, sharedGamma, l2, basis, priorScale, choice, lights, kinds, between, familyTest,
        chartFading, halfWidthOfBasis,
    )

    /** The answer with the outcome of its test, and by how much the chart has faded. */
    internal fun withFamilyTest(test: FamilyTest, chartFading: Double): Ssf = copy(curves, test, chartFading)

    private fun copy(
        curves: Curves,
        familyTest: FamilyTest? = this.familyTest,
        chartFading: Double = this.chartFading,
    ): Ssf = Ssf(
        curves, proof, sharedGain, sharedGamma, l2, basis, priorScale, choice, lights, kinds, between, familyTest,
        chartFading, halfWidthOfBasis,
    )

    /** The mixture of which this is the most probable part: these curves and proof, all else as here. */
    internal fun mixed(
        values: DoubleArray,
        std: DoubleArray?,
        predicted: DoubleArray,
        lamp: DoubleArray,
        gainCode: DoubleArray,
        proof: Proof,
    ): Ssf {
        val curves = Curves(values, std, sharedCode, sharedCodeCovariance, predicted, lamp, gainCode)
        return Ssf(curves, proof, sharedGain, sharedGamma, l2, basis, priorScale, choice)
    }

    /** Mean half-width of the 95 % band, 400 to 700 nm, in parts of the peak; 0 on a basis without a prior. */
    public val halfWidth: Double
        get() {
            val bands = List(3) { band(it) ?: return 0.0 }
            return (40..640).sumOf { m -> bands.sumOf { it[m] } } / (3 * 601)
        }

    /**
     * [halfWidth] of the basis's mean camera before any photo, under the prior of the learned width: what is known of a
     * typical camera; null on a basis without a prior.
     */
    public val halfWidthWithoutPhoto: Double? get() = PriorBand.halfWidth(basis)
}

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
