package org.camssf.recovery

import org.camssf.Grid
import org.camssf.frozen
import java.util.Collections

/**
 * One hypothesis among those that were weighed.
 *
 * @property basis of which family the camera is, "phones" or "cameras".
 * @property priorScale how many times as wide as its basis the prior was taken, 1 for a camera like those in it.
 * @property logEvidence ln of the marginal likelihood of the signals under it, nats, but for a constant common to all: only
 *   differences say something, and those of one capture alone.
 * @property probability 0 to 1, 1 in all: its weight among them, with what was believed beforehand.
 */
public class Hypothesis internal constructor(
    public val basis: String,
    public val priorScale: Double,
    public val logEvidence: Double,
    public val probability: Double,
    kinds: List<String> = emptyList(),
) {
    /** Of each shot's light, where one was not named: "daylight", ...; "" for a lamp that was. Empty where all were. */
    public val kinds: List<String> = kinds.frozen()
}

/**
 * What the signals say of a light that nobody named ([org.camssf.spectra.Lamp.auto]). Safe to pass between threads.
 *
 * @property kelvin correlated colour temperature, K (McCamy 1992).
 * @property kelvinStd one standard deviation of it, K.
 */
public class EstimatedLamp internal constructor(
    kinds: Map<String, Double>,
    internal val sharedPower: DoubleArray,
    internal val sharedStd: DoubleArray,
    public val kelvin: Double,
    public val kelvinStd: Double,
) {
    /** How probable each kind is: "daylight", "bulb", "white-led", "fluorescent"; 1 in all. */
    public val kinds: Map<String, Double> = Collections.unmodifiableMap(LinkedHashMap(kinds))

    /** (681) relative spectral power on [Grid], mean 1: the mean over kinds; a copy at each call. */
    public val power: DoubleArray get() = sharedPower.copyOf()

    /** (681) one standard deviation of [power], over kinds, their members and what these leave; likewise. */
    public val std: DoubleArray get() = sharedStd.copyOf()
}

/**
 * The recovered spectral sensitivity functions. Arrays are row-major, columns R, G, B; each call copies one (16 kB for a
 * curve of three channels), so what a caller writes changes nothing here: keep the array in a loop. Safe to pass between
 * threads.
 *
 * On a basis with a prior the three channels are one problem, on the paper's each is one: p = 1 or 3.
 *
 * Where the signals chose and no hypothesis was clear, this is a mixture: [values], [std], [predicted] and [lamp] are mixed
 * by the probabilities in [choice]; [gap], [layersGap] and [finishSteps] are the largest of its parts; all else, [code] too,
 * is the likeliest part's, and [values] do not follow from it. The same holds where nobody named a light and the signals
 * told it: [lights] says what they told.
 *
 * @property l2 the quadratic penalty.
 * @property basis its name, "phones", "cameras" or "gaussian"; of a mixture the likeliest one's.
 * @property priorScale how many times as wide as its basis the prior was taken, 1 where the basis was told; of a mixture the
 *   likeliest part's.
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
    /** (3) share of each channel's variance that stands between the hypotheses on the light; null where it was named. */
    internal val between: DoubleArray? = null,
) {
    /**
     * What was weighed where the signals chose the basis or a light's kind, in the order of phones and cameras; empty where
     * all was told.
     */
    public val choice: List<Hypothesis> = choice.frozen()

    /** Of each shot what the signals say of its light, null where it was named; empty where all were. */
    public val lights: List<EstimatedLamp?> = lights.frozen()

    /** The answer; shapes and units as of the properties of their names. */
    internal class Curves(
        val values: DoubleArray,
        val std: DoubleArray?,
        val code: DoubleArray,
        val codeCovariance: DoubleArray?,
        val predicted: DoubleArray,
        val lamp: DoubleArray,
        val gainCode: DoubleArray = DoubleArray(0),
    )

    /** How good it is; likewise. */
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
    public val values: DoubleArray get() = sharedValues.copyOf()

    /** (681, 3) posterior standard deviation of the curve of peak 1, times its peak; null where the basis has no prior. */
    public val std: DoubleArray? get() = sharedStd?.copyOf()

    /** (r, 3) coefficients. */
    public val code: DoubleArray get() = sharedCode.copyOf()

    /**
     * (3 r, 3 r) posterior covariance of [code], red's r coefficients first, then green's, then blue's, (H + I)⁻¹; null
     * where the basis has no prior. 41 kB a copy.
     */
    public val codeCovariance: DoubleArray? get() = sharedCodeCovariance?.copyOf()

    /** (k, n, 3) the signals that these curves give under [lamp], 1. */
    public val predicted: DoubleArray get() = sharedPredicted.copyOf()

    /** (3) relative duality gap of the problem that each channel stands in, 1: the proof that came with the answer. */
    public val gap: DoubleArray get() = sharedGap.copyOf()

    /** (p) the same of the layers' own answer, before the finish. */
    public val layersGap: DoubleArray get() = sharedLayersGap.copyOf()

    /** (p) pivots that the finish took; 0 where the layers' own proof was enough. */
    public val finishSteps: IntArray get() = sharedFinishSteps.copyOf()

    /**
     * ln of the marginal likelihood of the signals under basis and lamps, nats, but for a constant that the rows alone
     * decide; null where the basis has no prior.
     */
    public val logEvidence: Double? get() = proof.logEvidence

    /** (3) the l1 penalty of the problem that each channel stands in. */
    public val gamma: DoubleArray get() = sharedGamma.copyOf()

    /** (3) raw white signal of each channel relative to green; ones where no frame was given. */
    public val channelGain: DoubleArray get() = sharedGain.copyOf()

    /** (k, 681) each shot's lamp as the answer takes it: as given, but for what the signals say of its modes. */
    public val lamp: DoubleArray get() = sharedLamp.copyOf()

    /**
     * (k, g) what the signals say of the light's gain modes, where no white frame was taken; empty where one was.
     * [org.camssf.Calibrated.level] is what follows from it.
     */
    public val gainCode: DoubleArray get() = sharedGainCode.copyOf()

    /** The curve (681) of a channel, 0 red, 1 green, 2 blue, its peak 1. */
    public fun curve(channel: Int): DoubleArray {
        val peak = peak(channel)
        return DoubleArray(Grid.SIZE) { sharedValues[3 * it + channel] / peak }
    }

    /** One standard deviation (681) of [curve]; null where the basis has no prior. */
    public fun deviation(channel: Int): DoubleArray? {
        val peak = peak(channel)
        return sharedStd?.let { std -> DoubleArray(Grid.SIZE) { std[3 * it + channel] / peak } }
    }

    /** Half-width (681) of the 95 % band about [curve], 1.96 standard deviations; null where there is none. */
    public fun band(channel: Int): DoubleArray? =
        deviation(channel)?.let { std -> DoubleArray(std.size) { 1.96 * std[it] } }

    private fun peak(channel: Int): Double {
        require(channel in 0..2) { "there are three channels, 0 to 2, none is $channel" }
        return (0 until Grid.SIZE).maxOf { sharedValues[3 * it + channel] }
    }

    /** What this answer says of shot j alone, of n patches. */
    internal fun only(j: Int, n: Int): Ssf = with(
        sharedPredicted.copyOfRange(3 * n * j, 3 * n * (j + 1)),
        sharedLamp.copyOfRange(Grid.SIZE * j, Grid.SIZE * (j + 1)),
    )

    /** The same with these gains (k, g). */
    internal fun gaining(code: DoubleArray): Ssf = with(sharedPredicted, sharedLamp, code)

    /** The same curves, which predict these signals (k, n, 3). */
    internal fun predicting(predicted: DoubleArray): Ssf = with(predicted, sharedLamp)

    private fun with(predicted: DoubleArray, lamp: DoubleArray, gains: DoubleArray = sharedGainCode): Ssf {
        val seen = Curves(sharedValues, sharedStd, sharedCode, sharedCodeCovariance, predicted, lamp, gains)
        return Ssf(seen, proof, sharedGain, sharedGamma, l2, basis, priorScale, choice, lights, kinds, between)
    }

    /** The same, chosen among these, in a light of these kinds where nobody named it. */
    internal fun chosen(
        choice: List<Hypothesis>,
        lights: List<EstimatedLamp?> = emptyList(),
        kinds: List<String> = emptyList(),
        between: DoubleArray? = null,
    ): Ssf = Ssf(curves, proof, sharedGain, sharedGamma, l2, basis, priorScale, choice, lights, kinds, between)

    /** The same but for curves and proof: a mixture of which this is the likeliest part. */
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

    /** Mean half-width of the 95 % band, 400 to 700 nm, in parts of the peak; 0 where there is none. */
    internal val halfWidth: Double
        get() {
            val bands = List(3) { band(it) ?: return 0.0 }
            return (40..640).sumOf { m -> bands.sumOf { it[m] } } / (3 * 601)
        }
}

/** Signals (k, n, 3) that curves (681, 3) of any scale give of patches (n, 681) under lamps (k, 681): Eq. (5). */
internal fun predictSignals(
    values: DoubleArray,
    reflectance: DoubleArray,
    lamp: DoubleArray,
    white: DoubleArray,
): DoubleArray {
    val n = reflectance.size / Grid.SIZE
    val predicted = DoubleArray(3 * n * (lamp.size / Grid.SIZE))
    for (j in 0 until lamp.size / Grid.SIZE) {
        for (c in 0..2) {
            val seen = DoubleArray(Grid.SIZE) { lamp[j * Grid.SIZE + it] * values[3 * it + c] }
            val level = (0 until Grid.SIZE).sumOf { white[it] * seen[it] }
            for (i in 0 until n) {
                val from = i * Grid.SIZE
                predicted[3 * (j * n + i) + c] =
                    (0 until Grid.SIZE).sumOf { reflectance[from + it] * seen[it] } / level
            }
        }
    }
    return predicted
}
