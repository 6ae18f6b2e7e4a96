package org.camssf.colour

import org.camssf.InvalidArgument
import org.camssf.Rows
import org.camssf.Rules
import org.camssf.json.range
import org.camssf.short
import org.camssf.spectra.Bundled
import kotlin.math.hypot
import kotlin.math.sqrt

/** CIE standard observer. */
public enum class Observer(
    /** Its name in results and in Python's options. */
    public val word: String,
) {
    /** CIE 1931, 2°. */
    CIE_1931("1931"),

    /** CIE 1964, 10°. */
    CIE_1964("1964"),
}

/** The white that colours are stated for. */
public enum class Adapted(
    /** Its name in results and in Python's options. */
    public val word: String,
) {
    /** The light itself. */
    LAMP("lamp"),

    /** Adapted to D50 by CAT16. */
    D50("D50"),

    /** Adapted to D65 by CAT16. */
    D65("D65"),
}

/**
 * How colours are stated.
 *
 * @property observer CIE 1931 (2°) or 1964 (10°).
 * @property white that Lab is relative to, and that XYZ is adapted to.
 */
public class View @JvmOverloads constructor(
    public val observer: Observer = Observer.CIE_1931,
    public val white: Adapted = Adapted.LAMP,
) {
    override fun equals(other: Any?): Boolean = other is View && observer == other.observer && white == other.white

    override fun hashCode(): Int = 31 * observer.hashCode() + white.hashCode()

    override fun toString(): String = "View(${observer.word}, ${white.word})"
}

/**
 * The white or grey surface, in the same light, that raw signals are divided by.
 *
 * @property reflectance of the surface, 0.02 to 1.2; 1 for a perfect diffuser.
 * @property tolerance relative error of its reflectance, one standard deviation, smooth over 100 nm.
 * @throws InvalidArgument a reference that is too dark, or an invalid reflectance, tolerance or number of signals.
 */
public class Reference private constructor(
    raw: DoubleArray,
    standardError: DoubleArray,
    public val reflectance: Double,
    public val tolerance: Double,
    internal val source: SignalSource?,
    /** As of [RawRegion]. */
    internal val sharedPhotonNoise: DoubleArray? = null,
) {
    internal val sharedRaw: DoubleArray = raw.copyOf()
    internal val sharedError: DoubleArray = standardError.copyOf()

    override fun toString(): String =
        "Reference(raw=${sharedRaw.joinToString { short(it) }}, reflectance=${short(reflectance)})"

    /** (3) raw signals. */
    public val raw: Rows get() = Rows(sharedRaw, 3)

    /** (3) standard errors of [raw]. */
    public val standardError: Rows get() = Rows(sharedError, 3)

    init {
        if (reflectance !in Bundled.limits.range("reference")) {
            throw InvalidArgument("A reference of reflectance $reflectance is none.", "Write 18 % as 0.18.")
        }
        if (!(tolerance >= 0 && tolerance.isFinite())) {
            throw InvalidArgument("A tolerance of $tolerance is none.", "Write 1 % as 0.01.")
        }
        if (sharedRaw.size != 3 || sharedError.size != 3) {
            throw InvalidArgument("A reference has three signals, not ${sharedRaw.size}.", "Give R, G, B.")
        }
        if (!isLit(sharedRaw, sharedError)) {
            throw InvalidArgument("The reference is too dark.", "Choose a lit white or grey surface.")
        }
    }

    /** (3) what raw signals are multiplied by to be relative to a perfect white. */
    internal val scale: DoubleArray = DoubleArray(3) { reflectance / sharedRaw[it] }

    /**
     * Raw signals (3) relative to a perfect white; the reference's error is added to theirs.
     *
     * @throws InvalidArgument invalid signals or standard errors.
     */
    internal fun relative(raw: DoubleArray, standardError: DoubleArray): RelativeSignals {
        RelativeSignals.check(standardError)
        val signals = DoubleArray(3) { raw[it] * scale[it] }
        val errors = DoubleArray(3) {
            hypot(standardError[it] * scale[it], signals[it] * sharedError[it] / sharedRaw[it])
        }
        return RelativeSignals(signals, errors)
    }

    /** A reference measured in a photo, with whose camera and exposure those of other regions are compared. */
    @JvmOverloads
    public constructor(region: RawRegion, reflectance: Double = 1.0, tolerance: Double = TOLERANCE) :
        this(region.sharedRaw, region.sharedError, reflectance, tolerance, region.source, region.sharedPhotonNoise)

    /**
     * A reference of raw signals whose photo is not known, so that its camera and exposure are not checked.
     *
     * @param raw (3) its raw signals R, G, B, black subtracted, with camera and exposure of the other signals; copied.
     * @param standardError (3) standard errors of `raw`; zeros by default; copied.
     */
    @JvmOverloads
    public constructor(
        raw: DoubleArray,
        standardError: DoubleArray = DoubleArray(3),
        reflectance: Double = 1.0,
        tolerance: Double = TOLERANCE,
    ) : this(raw, standardError, reflectance, tolerance, null)

    private companion object {
        /** Default relative error of a reference. */
        val TOLERANCE get() = Rules.shipped.number("colour.reference")
    }
}

/** Whether signals (3) are as bright as a reference needs. */
internal fun isLit(raw: DoubleArray, standardError: DoubleArray): Boolean {
    val least = Rules.shipped.number("colour.signal_to_noise")
    return (0..2).all { raw[it] > least * standardError[it] && raw[it].isFinite() && standardError[it] >= 0 }
}

/** Sources of a colour's uncertainty. */
public enum class Part {
    /** Uncertainty of the calibrated curves. */
    CURVES,

    /** Uncertainty of the lamp's spectrum. */
    LAMP,

    /** Noise of region and reference. */
    NOISE,

    /** A reference that is not exactly neutral, and light that differs between the two places. */
    REFERENCE,

    /** Surfaces that look the same to the camera but not to the observer. */
    METAMERS,
}

/**
 * A lamp that was compared, and its weight.
 *
 * @property name of the lamp, or its kind.
 * @property weight its probability among the lamps compared; 1 if the lamp was named.
 */
public class WeighedLamp internal constructor(
    public val name: String,
    public val weight: Double,
) {
    override fun equals(other: Any?): Boolean = other is WeighedLamp && name == other.name && weight == other.weight

    override fun hashCode(): Int = 31 * name.hashCode() + weight.hashCode()

    override fun toString(): String = "$name: ${short(weight)}"
}

/**
 * A standard colour with its covariance. Y of a perfect white diffuser is 1. Safe to
 * pass between threads.
 *
 * @property reach distance of the signals from those that any surface can give, in standard deviations.
 */
public class StandardColour internal constructor(
    internal val sharedXyz: DoubleArray,
    internal val sharedLab: DoubleArray,
    internal val parts: List<Spread>,
    public val reach: Double,
) {
    override fun toString(): String =
        "StandardColour(lab=${sharedLab.joinToString { short(it) }}, reach=${short(reach)})"

    /** (3) XYZ for the view's observer, adapted to its white. */
    public val xyz: Rows get() = Rows(sharedXyz, 3)

    /** (3) L*, a*, b*. */
    public val lab: Rows get() = Rows(sharedLab, 3)

    /** (3, 3) covariance of [xyz]: the sum of its parts. */
    public val xyzCovariance: Rows get() = Rows(sum { it.xyz }, 3, 3)

    /** (3, 3) covariance of [lab]. */
    public val labCovariance: Rows get() = Rows(sum { it.lab }, 3, 3)

    /** (3) standard deviations of L*, a*, b* from one source. */
    public fun deviation(of: Part): Rows = parts[of.ordinal].lab.let { covariance ->
        Rows(DoubleArray(3) { sqrt(covariance[4 * it]) }, 3)
    }

    private fun sum(of: (Spread) -> DoubleArray): DoubleArray = DoubleArray(9) { at -> parts.sumOf { of(it)[at] } }
}

/** Covariances (3, 3) of XYZ and of Lab. */
internal class Spread(val xyz: DoubleArray, val lab: DoubleArray)
