package org.camssf.guide

/**
 * Limits at which advice begins and ends.
 *
 * Python has no guide, so the limits are here and not in rules.json. None of them refuses a capture; the verdict does
 * that, on the RAW photo.
 *
 * Each pair is (begin, end): advice stays until the measure has passed `end`. The difference is about three times the
 * variation of a measure between frames of a steady preview.
 */
internal object Limits {
    /** Smallest confidence of a candidate that counts as a chart, as in the finder. */
    const val CONFIDENCE = 0.75

    /**
     * Size of the chart: docs/photograph.md recommends a third of the picture's width; a quarter still gives large
     * patches in RAW.
     */
    val SIZE = Limit(0.25, 0.27, below = true)

    /** Size that the advice for [SIZE] aims at. */
    const val GOOD_SIZE = 0.4

    /** Pitches: the refinement on the mosaic also samples around the patches. */
    val MARGIN = Limit(0.0, 0.1, below = true)

    /** Degrees. At larger angles a semi-matt patch has more gloss, and the geometry is no longer 45°/0°. */
    val TILT = Limit(20.0, 16.0)

    /** Pitches per second: at 1/30 s of exposure, 2 % of a patch. */
    val SPEED = Limit(0.7, 0.5)

    /** Level of the white patch: below [DARK], dark patches lose bits; above [BRIGHT], the next channel clips. */
    val DARK = Limit(0.30, 0.36, below = true)
    val BRIGHT = Limit(0.90, 0.86)

    /**
     * Level of the white patch that exposure advice aims at: three quarters of full scale (docs/photograph.md), with
     * a margin.
     */
    const val GOOD_WHITE = 0.65

    /** Share of the white patch's pixels that are at the ceiling. */
    val CLIPPED = Limit(0.05, 0.02)

    /** Smallest 8-bit value that counts as the ceiling. */
    const val CEILING = 252

    /**
     * Blur in px and in pitches: half the margin that measuring leaves around each patch. The larger of both limits
     * applies.
     */
    val BLUR_PIXELS = Limit(1.6, 1.4)
    val BLUR_PITCHES = Limit(0.045, 0.04)

    /** A spot of glare is brighter than its patch by this share of white, and by this factor. */
    const val SPOT = 0.04
    const val SPOT_FACTOR = 1.35

    /** Number of patches with a spot of glare. */
    val GLARE = Limit(0.5, 0.5)

    /**
     * Level of the black patch / level of the white patch: 0.035 on a clean chart; about twice that if the preview
     * lifts its shadows.
     */
    val VEIL = Limit(0.12, 0.10)

    /** Stops. Inexact colours of a preview may look like half of this. */
    val SHADOW = Limit(0.40, 0.32)

    /** Stops: 20 % across the chart, which stays in the signals if there is no white frame. */
    val GRADIENT = Limit(0.27, 0.21)

    /**
     * Share of white: a wooden desk below the chart, which does not light it, is below; a red wall in half of the
     * view is above.
     */
    val TINT = Limit(0.28, 0.24)

    /** Number of frames: each measure is their median. */
    const val MEDIAN = 5

    /** Number of frames that new advice must last before it is given. */
    const val PATIENCE = 4

    /** Number of frames without a chart before [Advice.NO_CHART] is given. */
    const val LOST = 6

    /** Number of frames in which all conditions must hold before "now". */
    const val HELD = 10

    /** Seconds over which corners are compared, so that jitter of the search has little effect; at most [PAUSE]. */
    const val SPAN = 0.1
    const val PAUSE = 0.6
}

/**
 * A limit with hysteresis.
 *
 * @property begin value at which advice begins.
 * @property end value at which it ends.
 * @property below true if small values are bad.
 */
internal class Limit(val begin: Double, val end: Double, val below: Boolean = false) {
    /** True if a value is bad; `before` is the previous answer. NaN is not bad. */
    fun bad(value: Double, before: Boolean): Boolean {
        val limit = if (before) end else begin
        return if (below) value < limit else value > limit
    }
}
