package org.camssf.guide

import kotlin.math.PI
import kotlin.math.max
import kotlin.math.sqrt

/**
 * Measures the blur of the patch borders.
 *
 * Across a border between a bright patch and the dark gap, blurred by a Gaussian of standard deviation σ, light rises
 * by its contrast C with a slope of at most C / (σ √(2π)). The slope gives σ.
 */
internal class Sharpness {
    private val profile = DoubleArray(LENGTH)

    /** Standard deviations of the borders along both directions, px, and their numbers. */
    private val blurs = arrayOf(DoubleArray(0), DoubleArray(0))
    private val counts = IntArray(2)

    /**
     * Standard deviation of the blur, px, the worse of both directions; null if too few borders have enough contrast.
     */
    fun look(pixels: Pixels, plane: ChartPlane, light: PatchLight, white: Double): Double? {
        counts.fill(0)
        if (blurs[0].size < 2 * light.count) for (i in 0..1) blurs[i] = DoubleArray(2 * light.count)
        for (patch in 0 until light.count) {
            val level = light.level[patch]
            if (level < BRIGHT * white || light.clipped[patch] > 0.02) continue
            for (side in SIDES) {
                val blur = border(pixels, plane, light, patch, side)
                val direction = side[0] and 1
                if (blur.isFinite()) blurs[direction][counts[direction]++] = blur
            }
        }
        var worst: Double? = null
        for (direction in 0..1) {
            val count = counts[direction]
            blurs[direction].sort(0, count)
            if (count >= FEWEST) worst = max(worst ?: 0.0, blurs[direction][count / 2])
        }
        return worst
    }

    /**
     * Standard deviation of one border's blur, px, from the mean profile of parallel lines that run from inside the
     * patch to beyond its gap; NaN if the contrast is too small.
     */
    private fun border(pixels: Pixels, plane: ChartPlane, light: PatchLight, patch: Int, side: IntArray): Double {
        val u = patch % light.columns
        val v = patch / light.columns
        profile.fill(0.0)
        for (line in 0 until LINES) {
            val aside = ASIDE * ((2 * line + 1.0) / LINES - 1)
            for (i in 0 until LENGTH) {
                val out = FROM + (TO - FROM) * i / (LENGTH - 1)
                val a = u + out * side[0] + aside * side[1]
                val b = v + out * side[1] + aside * side[0]
                profile[i] += pixels.between(plane.x(a, b), plane.y(a, b)) / LINES
            }
        }
        val end = (FROM + TO) / 2
        val length = (TO - FROM) * step(plane, u, v, side, end) / (LENGTH - 1)
        var gap = 0
        for (i in 1 until LENGTH) if (profile[i] < profile[gap]) gap = i
        var plateau = 0.0
        var steepest = 0.0
        for (i in 0 until INSIDE) plateau += profile[i] / INSIDE
        for (i in 2..gap) steepest = max(steepest, (profile[i - 2] - profile[i]) / (2 * length))
        val contrast = plateau - profile[gap]
        if (contrast < CONTRAST * plateau || steepest <= 0) return Double.NaN
        return contrast / (steepest * sqrt(2 * PI))
    }

    /** Length of one pitch across this border, px. */
    private fun step(plane: ChartPlane, u: Int, v: Int, side: IntArray, at: Double): Double {
        val a = u + (at - 0.05) * side[0]
        val b = v + (at - 0.05) * side[1]
        val c = u + (at + 0.05) * side[0]
        val d = v + (at + 0.05) * side[1]
        return Math.hypot(plane.x(c, d) - plane.x(a, b), plane.y(c, d) - plane.y(a, b)) / 0.1
    }

    private companion object {
        val SIDES = listOf(intArrayOf(1, 0), intArrayOf(-1, 0), intArrayOf(0, 1), intArrayOf(0, -1))

        /**
         * Ends of the profile, pitches from the patch's centre: the patch ends at 0.42 to 0.44, the next one begins
         * at 0.56 to 0.58.
         */
        const val FROM = 0.25
        const val TO = 0.58
        const val LENGTH = 34
        const val INSIDE = 4

        /** Half the length of a border that is read, pitches. */
        const val ASIDE = 0.25
        const val LINES = 10

        /** Share of white: darker patches have too little contrast with the gap. */
        const val BRIGHT = 0.15
        const val CONTRAST = 0.2
        const val FEWEST = 4
    }
}
