package org.camssf.guide

/**
 * Where advice begins and ends. Python has no guide, so these stand here and not in rules.json. None of them refuses a
 * capture: that is the verdict's part, on the RAW photo.
 *
 * Each pair is (begin, end): once said, advice stays until the measure is better by the difference, which is about three
 * times what a steady preview's measure moves from frame to frame.
 */
internal object Limits {
    /** Sightings below are no chart, as the finder has it. */
    const val CONFIDENCE = 0.75

    /** docs/photograph.md asks for a third of the picture's width; a quarter still gives patches of 100 px in RAW. */
    val SIZE = Limit(0.25, 0.27, below = true)

    /** What [SIZE]'s advice leads to. */
    const val GOOD_SIZE = 0.4

    /** Pitches: the refinement on the mosaic looks beyond the patches. */
    val MARGIN = Limit(0.0, 0.1, below = true)

    /** Degrees. Gloss of a semi-matt patch grows beyond it, and the line of sight leaves 45°/0°. */
    val TILT = Limit(20.0, 16.0)

    /** Pitches a second: at 1/30 s of exposure 2 % of a patch. */
    val SPEED = Limit(0.7, 0.5)

    /** Level of the white patch: below, the dark patches lose their bits; above, the next channel clips. */
    val DARK = Limit(0.30, 0.36, below = true)
    val BRIGHT = Limit(0.90, 0.86)

    /** What exposure advice leads to: docs/photograph.md's three quarters of full scale, with some room. */
    const val GOOD_WHITE = 0.65

    /** Share of the white patch at the ceiling. */
    val CLIPPED = Limit(0.05, 0.02)

    /** An 8-bit value from here on is at the ceiling. */
    const val CEILING = 252

    /** px, and pitches: half the margin that measuring leaves around each patch. The larger of both counts. */
    val BLUR_PIXELS = Limit(1.6, 1.4)
    val BLUR_PITCHES = Limit(0.045, 0.04)

    /** A spot: brighter than its patch by this share of white, and by this factor. */
    const val SPOT = 0.04
    const val SPOT_FACTOR = 1.35

    /** Patches with a spot. */
    val GLARE = Limit(0.5, 0.5)

    /** Black over white: 0.035 on a clean chart; a preview that lifts its shadows may show twice that. */
    val VEIL = Limit(0.12, 0.10)

    /** Stops. Half of it is what the colours of a preview may look like. */
    val SHADOW = Limit(0.40, 0.32)

    /** Stops: 20 % across the chart, which without a white frame stays in the signals. */
    val GRADIENT = Limit(0.27, 0.21)

    /** Share of white: a wooden desk, which lights nothing on it, stays below; half a view of red wall does not. */
    val TINT = Limit(0.28, 0.24)

    /** Frames: of each measure the median of so many counts. */
    const val MEDIAN = 5

    /** Frames that other advice must last before it is said. */
    const val PATIENCE = 4

    /** Frames that the chart may be lost before it is said. */
    const val LOST = 6

    /** Frames that all must hold before "now". */
    const val HELD = 10

    /** s: corners are compared over so long, so that the search's own jitter counts little; at most [PAUSE]. */
    const val SPAN = 0.1
    const val PAUSE = 0.6
}

/**
 * @property begin where advice begins.
 * @property end where it ends.
 * @property below whether small values are the bad ones.
 */
internal class Limit(val begin: Double, val end: Double, val below: Boolean = false) {
    /** Whether a value is bad, if it was so before; an unknown one is not. */
    fun bad(value: Double, before: Boolean): Boolean {
        val limit = if (before) end else begin
        return if (below) value < limit else value > limit
    }
}
