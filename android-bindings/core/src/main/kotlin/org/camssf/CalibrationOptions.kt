package org.camssf

import kotlinx.coroutines.CoroutineDispatcher
import kotlinx.coroutines.Dispatchers

/** Options of a calibration, made by [Builder]. Immutable; safe to pass between threads. */
public class CalibrationOptions private constructor(private val values: Options) {
    /** 1-based numbers of the patches that enter the fit; null for all, which are then cross-validated fold by fold. */
    public val fit: List<Int>? get() = values.fit

    /** The quadratic penalty λ₂; null for the basis's own. */
    public val l2: Double? get() = values.l2

    /**
     * The l1 penalty γ. On the paper's basis null chooses it by the discrepancy principle: the largest γ whose residual
     * is not above the measured noise.
     */
    public val gamma: Double? get() = values.gamma

    /** Whether all coefficients are ≥ 0; null: only on the paper's basis. */
    public val nonnegative: Boolean? get() = values.nonnegative

    /**
     * Relative difference of the light from patch to patch, one standard deviation, if each patch was photographed
     * separately; 8 % is 0.08. Null if the patches were in one photo.
     */
    public val lightPerPatch: Double? get() = values.lightPerPatch

    /** A result of this unit under a named lamp, from a calibration or [SavedResult.read]; null if there is none. */
    public val previous: CalibrationResult? get() = values.previous

    /** Hears of each step on the thread that calibrates; null for none. */
    public val progress: ProgressListener? get() = values.progress

    /** On whose threads the suspending functions calibrate. */
    public val dispatcher: CoroutineDispatcher get() = values.dispatcher

    override fun equals(other: Any?): Boolean = other is CalibrationOptions && values == other.values

    override fun hashCode(): Int = values.hashCode()

    override fun toString(): String = "Calibration$values"

    /** A builder that begins with these options. */
    public fun toBuilder(): Builder = Builder(values)

    internal data class Options(
        val fit: List<Int>? = null,
        val l2: Double? = null,
        val gamma: Double? = null,
        val nonnegative: Boolean? = null,
        val lightPerPatch: Double? = null,
        val previous: CalibrationResult? = null,
        val progress: ProgressListener? = null,
        val dispatcher: CoroutineDispatcher = Dispatchers.Default,
    )

    /** Collects options, named as the properties of [CalibrationOptions]; what is not set keeps its default. */
    public class Builder internal constructor(private var values: Options) {
        public constructor() : this(Options())

        /** Patches that enter the fit, numbered from 1; copied. */
        public fun fit(patches: List<Int>?): Builder = with(values.copy(fit = patches?.frozen()))

        /** The quadratic penalty. */
        public fun l2(l2: Double?): Builder = with(values.copy(l2 = l2))

        /** The l1 penalty. */
        public fun gamma(gamma: Double?): Builder = with(values.copy(gamma = gamma))

        /** Whether all coefficients are ≥ 0. */
        public fun nonnegative(nonnegative: Boolean?): Builder = with(values.copy(nonnegative = nonnegative))

        /** Relative difference of the light from patch to patch. */
        public fun lightPerPatch(difference: Double?): Builder = with(values.copy(lightPerPatch = difference))

        /** A result of the same unit under a named lamp; its answer stays unless the common one is accepted. */
        public fun previous(result: CalibrationResult?): Builder = with(values.copy(previous = result))

        /** Hears of each step. */
        public fun progress(listener: ProgressListener?): Builder = with(values.copy(progress = listener))

        /** On whose threads the suspending functions calibrate; [Dispatchers.Default] if it is not set. */
        public fun dispatcher(dispatcher: CoroutineDispatcher): Builder = with(values.copy(dispatcher = dispatcher))

        private fun with(values: Options) = apply { this.values = values }

        /** The options. */
        public fun build(): CalibrationOptions = CalibrationOptions(values)

        override fun toString(): String = "${build()}"
    }

    public companion object {
        /** No option is set. */
        @JvmField
        public val DEFAULT: CalibrationOptions = Builder().build()
    }
}
