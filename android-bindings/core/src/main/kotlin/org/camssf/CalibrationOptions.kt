package org.camssf

import kotlinx.coroutines.CoroutineDispatcher
import kotlinx.coroutines.Dispatchers

/**
 * Options of a calibration, made by [Builder]. Immutable; safe to pass between threads.
 *
 * @property l2 the quadratic penalty λ₂; null for the basis's own.
 * @property gamma the l1 penalty γ. On the paper's basis null chooses it by the discrepancy principle: the largest γ
 *   whose residual is not above the measured noise.
 * @property nonnegative whether all coefficients are ≥ 0; null: only on the paper's basis.
 * @property lightPerPatch relative difference of the light from patch to patch, one standard deviation, if each patch
 *   was photographed separately; 8 % is 0.08. Null if the patches were in one photo.
 * @property previous a result of this unit under a named lamp, from a calibration or [SavedResult.read]; null if there
 *   is none.
 * @property progress hears of each step on the thread that calibrates; null for none.
 * @property dispatcher on whose threads the suspending functions calibrate.
 */
public class CalibrationOptions private constructor(builder: Builder) {
    /** 1-based numbers of the patches that enter the fit; null for all, which are then cross-validated fold by fold. */
    public val fit: List<Int>? = builder.fit?.frozen()
    public val l2: Double? = builder.l2
    public val gamma: Double? = builder.gamma
    public val nonnegative: Boolean? = builder.nonnegative
    public val lightPerPatch: Double? = builder.lightPerPatch
    public val previous: CalibrationResult? = builder.previous
    public val progress: ProgressListener? = builder.progress
    public val dispatcher: CoroutineDispatcher = builder.dispatcher

    private fun parts() = listOf(fit, l2, gamma, nonnegative, lightPerPatch, previous, progress, dispatcher)

    override fun equals(other: Any?): Boolean = other is CalibrationOptions && parts() == other.parts()

    override fun hashCode(): Int = parts().hashCode()

    override fun toString(): String =
        "CalibrationOptions(fit=$fit, l2=$l2, gamma=$gamma, nonnegative=$nonnegative, lightPerPatch=$lightPerPatch, " +
            "previous=$previous)"

    /** A builder that begins with these options. */
    public fun toBuilder(): Builder = Builder().also {
        it.fit = fit
        it.l2 = l2
        it.gamma = gamma
        it.nonnegative = nonnegative
        it.lightPerPatch = lightPerPatch
        it.previous = previous
        it.progress = progress
        it.dispatcher = dispatcher
    }

    /** Collects options, named as the properties of [CalibrationOptions]; what is not set keeps its default. */
    public class Builder {
        internal var fit: List<Int>? = null
        internal var l2: Double? = null
        internal var gamma: Double? = null
        internal var nonnegative: Boolean? = null
        internal var lightPerPatch: Double? = null
        internal var previous: CalibrationResult? = null
        internal var progress: ProgressListener? = null
        internal var dispatcher: CoroutineDispatcher = Dispatchers.Default

        /** Patches that enter the fit, numbered from 1; copied by [build]. */
        public fun fit(patches: List<Int>?): Builder = apply { fit = patches }

        /** The quadratic penalty. */
        public fun l2(l2: Double?): Builder = apply { this.l2 = l2 }

        /** The l1 penalty. */
        public fun gamma(gamma: Double?): Builder = apply { this.gamma = gamma }

        /** Whether all coefficients are ≥ 0. */
        public fun nonnegative(nonnegative: Boolean?): Builder = apply { this.nonnegative = nonnegative }

        /** Relative difference of the light from patch to patch. */
        public fun lightPerPatch(difference: Double?): Builder = apply { lightPerPatch = difference }

        /** A result of the same unit under a named lamp. */
        public fun previous(result: CalibrationResult?): Builder = apply { previous = result }

        /** Hears of each step. */
        public fun progress(listener: ProgressListener?): Builder = apply { progress = listener }

        /** On whose threads the suspending functions calibrate; [Dispatchers.Default] if it is not set. */
        public fun dispatcher(dispatcher: CoroutineDispatcher): Builder = apply { this.dispatcher = dispatcher }

        /** The options. */
        public fun build(): CalibrationOptions = CalibrationOptions(this)

        override fun toString(): String = "${build()}"
    }

    public companion object {
        /** No option is set. */
        @JvmField
        public val DEFAULT: CalibrationOptions = Builder().build()
    }
}
