package org.camssf.colour

import org.camssf.Rows
import org.camssf.Rules
import org.camssf.short
import kotlin.math.ln
import kotlin.math.log10
import kotlin.math.max
import kotlin.math.sqrt

/** Indices of skin from its absorbance, -log₁₀ of reflectance. */
public enum class SkinIndex(
    /** Its name in results and in Python's options. */
    public val word: String,
) {
    /** The mean absorbance from 540 to 575 nm, less that at 650 nm. */
    ERYTHEMA("erythema"),

    /** The mean absorbance from 650 to 700 nm. */
    MELANIN("melanin"),
    ;

    /** (35) weights of the absorbance at the nodes, between which it is linear. */
    internal val weights: DoubleArray by lazy {
        if (this == ERYTHEMA) {
            mean(540, 575).also { add(it, -1.0, mean(650, 650)) }
        } else {
            mean(650, 700)
        }
    }

    private fun mean(first: Int, last: Int): DoubleArray {
        val weights = DoubleArray(SurfaceNodes.SIZE)
        for (nm in first..last) {
            val at = (nm - 380) / 10
            val share = nm % 10 / 10.0
            weights[at] += (1 - share) / (last - first + 1)
            if (share > 0) weights[at + 1] += share / (last - first + 1)
        }
        return weights
    }
}

/**
 * An index of skin.
 *
 * @property value of the index.
 * @property standardDeviation of the value.
 */
public class IndexValue internal constructor(public val value: Double, public val standardDeviation: Double) {
    override fun equals(other: Any?): Boolean =
        other is IndexValue && value == other.value && standardDeviation == other.standardDeviation

    override fun hashCode(): Int = 31 * value.hashCode() + standardDeviation.hashCode()

    override fun toString(): String = "${short(value)} ± ${short(standardDeviation)}"
}

/**
 * Lamps of the photos that were compared, and their weight.
 *
 * @property names of the lamps or their kinds, one for each photo.
 * @property weight probability among the combinations compared; 1 if all lamps were named.
 */
public class WeighedLamps internal constructor(public val names: List<String>, public val weight: Double) {
    override fun equals(other: Any?): Boolean =
        other is WeighedLamps && names == other.names && weight == other.weight

    override fun hashCode(): Int = 31 * names.hashCode() + weight.hashCode()

    override fun toString(): String = "${names.joinToString()}: ${short(weight)}"
}

/**
 * The reflectance of a surface from 380 to 720 nm every 10 nm, and its colour, with their covariance. Three or six
 * signals do not determine a spectrum: the answer holds for surfaces of the prior's kind. Safe to
 * pass between threads.
 *
 * @property distance of the signals from the nearest surface of the prior, in standard deviations.
 * @property fromPhoto share of the prior's variance of reflectance, 400 to 700 nm, that the signals removed; the rest of
 *   what the spectrum says is the prior.
 */
public class SurfaceSpectrum internal constructor(
    private val numbers: Numbers,
    public val distance: Double,
    public val fromPhoto: Double,
) {
    /**
     * Mean values and covariances, row-major.
     *
     * @property parts of the reflectance's covariance, in the order of [Part].
     */
    internal class Numbers(
        val reflectance: DoubleArray,
        val covariance: DoubleArray,
        val parts: List<DoubleArray>,
        val xyz: DoubleArray,
        val xyzCovariance: DoubleArray,
        val lab: DoubleArray,
        val labCovariance: DoubleArray,
    )

    override fun toString(): String =
        "SurfaceSpectrum(lab=${numbers.lab.joinToString { short(it) }}, distance=${short(distance)})"

    /** (35) reflectance at [wavelengths]. */
    public val reflectance: Rows get() = Rows(numbers.reflectance, SurfaceNodes.SIZE)

    /** (35, 35) covariance of [reflectance]. */
    public val covariance: Rows get() = Rows(numbers.covariance, SurfaceNodes.SIZE, SurfaceNodes.SIZE)

    /** (35) standard deviation of [reflectance]. */
    public val standardDeviation: Rows get() = Rows(roots(numbers.covariance), SurfaceNodes.SIZE)

    /** (3) XYZ under the first photo's light for the view's observer, adapted to its white. */
    public val xyz: Rows get() = Rows(numbers.xyz, 3)

    /** (3, 3) covariance of [xyz]. */
    public val xyzCovariance: Rows get() = Rows(numbers.xyzCovariance, 3, 3)

    /** (3) L*, a*, b*. */
    public val lab: Rows get() = Rows(numbers.lab, 3)

    /** (3, 3) covariance of [lab]. */
    public val labCovariance: Rows get() = Rows(numbers.labCovariance, 3, 3)

    /** Whether the surface is farther from the prior than four standard deviations: spectrum and bands do not hold. */
    public val outsidePrior: Boolean get() = distance > FAR

    /** (35) standard deviation of [reflectance] from one source; [Part.METAMERS] are surfaces of equal signals. */
    public fun deviation(of: Part): Rows = Rows(roots(numbers.parts[of.ordinal]), SurfaceNodes.SIZE)

    /** An index of skin, with the standard deviation that follows from [covariance]. */
    public fun index(of: SkinIndex): IndexValue {
        val row = DoubleArray(SurfaceNodes.SIZE) { max(numbers.reflectance[it], DARKEST) }
        val slopes = DoubleArray(row.size) { -of.weights[it] / (row[it] * ln(10.0)) }
        val variance = slopes.indices.sumOf { a ->
            slopes.indices.sumOf { slopes[a] * slopes[it] * numbers.covariance[a * slopes.size + it] }
        }
        return IndexValue(row.indices.sumOf { -log10(row[it]) * of.weights[it] }, sqrt(max(variance, 0.0)))
    }

    private fun roots(covariance: DoubleArray) = DoubleArray(SurfaceNodes.SIZE) {
        sqrt(max(covariance[it * (SurfaceNodes.SIZE + 1)], 0.0))
    }

    public companion object {
        /** (35) wavelengths of the reflectance, 380 to 720 nm every 10 nm. */
        @JvmStatic
        public val wavelengths: Rows = Rows(SurfaceNodes.wavelengths, SurfaceNodes.wavelengths.size)

        private val FAR get() = Rules.shipped.number("surfaces.far")

        /** Least reflectance that absorbance is computed of. */
        private val DARKEST get() = Rules.shipped.number("surfaces.darkest")
    }
}
