package org.camssf.guide

import org.camssf.finder.ChartKind
import kotlin.math.PI
import kotlin.math.abs
import kotlin.math.cos
import kotlin.math.exp
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.sin
import kotlin.math.sqrt

/**
 * Measures how even the light on the chart is.
 *
 * **Gradient.** A patch has one colour, so changes within it come from the light: the gradient is the median of the
 * patches' slopes in ln. It does not depend on the chart's colours, and on the tone curve only by its steepness.
 *
 * **Shadow.** ln of all cells is fitted by the patches' reflectances (a tone curve of second order, and the
 * colourfulness because previews brighten or darken colours) and one step across a line. Lines of twelve directions
 * are tried. If a plane fits about as well, the light has a gradient and no shadow.
 *
 * **Glare** adds light, even to dark patches: a spot is much brighter than the rest of its own patch, by more than
 * the edge of a shadow explains. A veil over the whole chart is measured on the black patch.
 */
internal class Evenness(kind: ChartKind, private val reference: Reference?) {
    private val columns = kind.columns
    private val count = kind.columns * kind.rows
    private val size = 9 * count

    /** Positions of the cells, pitches from the chart's centre. */
    private val u = DoubleArray(size) { it / 9 % columns - (columns - 1) / 2.0 + (it % 9 % 3 - 1) * STEP }
    private val v = DoubleArray(size) { it / 9 / columns - (kind.rows - 1) / 2.0 + (it % 9 / 3 - 1) * STEP }
    private val width = kind.columns - 1.0
    private val height = kind.rows - 1.0
    private val sides = if (reference == null) emptyList() else lines()

    private val used = BooleanArray(count)
    private val rest = DoubleArray(size)
    private val steps = DoubleArray(size)
    private val sloped = DoubleArray(size)
    private val basis = Array(4) { DoubleArray(size) }
    private val slope = DoubleArray(count)

    /** Steepness of the frame's tone curve relative to sRGB's. */
    private var steepness = 1.0

    /** Stops; see [FrameMeasures]. */
    var gradient = 0.0
        private set
    var shadow: Double? = null
        private set
    var glare: List<Int> = emptyList()
        private set
    var veil: Double? = null
        private set

    /**
     * Measures a frame and sets the properties.
     *
     * @param white level of the white patch.
     */
    fun look(light: PatchLight, white: Double) {
        for (i in 0 until count) used[i] = light.clipped[i] < MOSTLY_CLEAR && light.level[i] > FAINTEST
        val within = gradients(light)
        val step = step(light)
        gradient = within / ln(2.0)
        shadow = if (reference == null) null else abs(step) / steepness / ln(2.0)
        // In the frame's own values, without correction for the tone curve.
        glare = spots(light, white, abs(step) + within / (width + height))
        veil = reference?.let {
            val black = it.black
            if (white > FAINTEST && abs(step) < EVEN && it.white !in glare) light.level[black] / white else null
        }
    }

    /** Gradient across the block in ln; 0 if fewer than a quarter of the patches can be used. */
    private fun gradients(light: PatchLight): Double {
        var sum = 0.0
        for ((axis, across) in listOf(width, height).withIndex()) {
            var found = 0
            for (patch in 0 until count) {
                if (!used[patch]) continue
                val at = 9 * patch
                var low = 0.0
                var high = 0.0
                for (k in 0..2) {
                    low += light.cells[if (axis == 0) at + 3 * k else at + k]
                    high += light.cells[if (axis == 0) at + 3 * k + 2 else at + 6 + k]
                }
                if (low <= 0 || high <= 0) continue
                slope[found++] = ln(high / low) / (2 * STEP)
            }
            if (4 * found < count) return 0.0
            slope.sort(0, found)
            sum += abs((slope[(found - 1) / 2] + slope[found / 2]) / 2) * across
        }
        return sum
    }

    /** Step across the best line in ln, in the frame's own values; 0 if a plane fits as well, or without a reference. */
    private fun step(light: PatchLight): Double {
        val reference = reference ?: return 0.0
        if (2 * used.count { it } < count) return 0.0
        for (cell in 0 until size) {
            val patch = cell / 9
            val tone = reference.tone[patch]
            val level = light.cells[cell]
            val known = used[patch] && level > 0
            rest[cell] = if (known) ln(level) else 0.0
            basis[0][cell] = if (known) 1.0 else 0.0
            basis[1][cell] = if (known) tone else 0.0
            basis[2][cell] = if (known) tone * tone else 0.0
            basis[3][cell] = if (known) reference.colourfulness[patch] else 0.0
        }
        for (k in basis.indices) {
            for (before in 0 until k) remove(basis[before], basis[k])
            val length = sqrt(dot(basis[k], basis[k]))
            if (length < 1e-9) return 0.0
            for (cell in 0 until size) basis[k][cell] /= length
        }
        steepness = (dot(basis[1], rest) / max(spread(reference), 1e-9)).coerceIn(FLATTEST, STEEPEST)
        basis.forEach { remove(it, rest) }
        for (cell in 0 until size) rest[cell] = rest[cell].coerceIn(-WILDEST, WILDEST)
        val whole = dot(rest, rest)
        val plane = whole - planeGain()
        var best = 0.0
        var height = 0.0
        for (side in sides) {
            for (cell in 0 until size) steps[cell] = if (side[cell] && used[cell / 9]) 1.0 else 0.0
            basis.forEach { remove(it, steps) }
            val length = dot(steps, steps)
            if (length < LEAST_SIDE * size) continue
            val along = dot(steps, rest)
            if (along * along / length > best) {
                best = along * along / length
                height = along / length
            }
        }
        if (whole - best > CLEARLY * plane) return 0.0
        return height
    }

    /** Norm of the part of the tone that a constant does not explain; [step] divides by it to get the steepness. */
    private fun spread(reference: Reference): Double {
        var sum = 0.0
        var squares = 0.0
        var n = 0
        for (patch in 0 until count) {
            if (!used[patch]) continue
            sum += reference.tone[patch]
            squares += reference.tone[patch] * reference.tone[patch]
            n++
        }
        return sqrt(9 * max(squares - sum * sum / max(n, 1), 0.0))
    }

    /** Sum of squares of [rest] that a plane explains: a slope along u, and what one along v adds. */
    private fun planeGain(): Double {
        free(u)
        steps.copyInto(sloped)
        val gain = gain()
        free(v)
        val length = dot(sloped, sloped)
        val share = if (length > 1e-9) dot(sloped, steps) / length else 0.0
        for (cell in 0 until size) steps[cell] -= share * sloped[cell]
        return gain + gain()
    }

    /** Sum of squares of [rest] that the direction [steps] explains. */
    private fun gain(): Double {
        val length = dot(steps, steps)
        return if (length > 1e-9) dot(steps, rest).let { it * it / length } else 0.0
    }

    /** Sets [steps] to a direction without what the basis explains. */
    private fun free(direction: DoubleArray) {
        for (cell in 0 until size) steps[cell] = if (used[cell / 9]) direction[cell] else 0.0
        basis.forEach { remove(it, steps) }
    }

    /**
     * Indices of the patches with a spot of glare.
     *
     * @param explained ln of the change within a patch that gradient and shadow may cause.
     */
    private fun spots(light: PatchLight, white: Double, explained: Double): List<Int> {
        if (white <= 0) return emptyList()
        val factor = Limits.SPOT_FACTOR * exp(explained)
        val shining = (0 until count).filter {
            val low = light.middle[it]
            // If glare covers most of a patch, its darkest cell shows the patch's own level.
            val least = (9 * it until 9 * it + 9).minOf { cell -> light.cells[cell] }
            val base = minOf(low, max(least, FAINTEST))
            light.top[it] - base > Limits.SPOT * white && light.top[it] > factor * base
        }
        val reference = reference
        if (shining.isEmpty() || reference == null) return shining
        // A patch that glare covers completely has no edge inside, but one of its neighbours has.
        return (0 until count).filter { patch ->
            val wanted = white * reference.luminance[patch] / reference.luminance[reference.white]
            val high = light.level[patch] - wanted > 2 * Limits.SPOT * white && light.level[patch] > factor * wanted
            patch in shining || (high && shining.any { beside(it, patch) })
        }
    }

    private fun beside(a: Int, b: Int) =
        abs(a % columns - b % columns) <= 1 && abs(a / columns - b / columns) <= 1

    private fun remove(unit: DoubleArray, from: DoubleArray) {
        val along = dot(unit, from)
        for (cell in 0 until size) from[cell] -= along * unit[cell]
    }

    private fun dot(a: DoubleArray, b: DoubleArray): Double {
        var sum = 0.0
        for (cell in 0 until size) sum += a[cell] * b[cell]
        return sum
    }

    /**
     * Cells beyond each of the lines: twelve directions with 23 positions each, so that a line lies between any two
     * cells.
     */
    private fun lines(): List<BooleanArray> = (0 until 12).flatMap { turn ->
        val (c, s) = cos(turn * PI / 12) to sin(turn * PI / 12)
        val along = DoubleArray(size) { c * u[it] + s * v[it] }
        val (low, high) = along.min() to along.max()
        (1..23).map { place ->
            val line = low + (high - low) * place / 24
            BooleanArray(size) { along[it] > line }
        }
    }

    private companion object {
        /** Distance between the centres of neighbouring cells, pitches. */
        const val STEP = 2 * PatchLight.REACH / 3

        const val MOSTLY_CLEAR = 0.02

        /** Largest step in ln that may be noise; up to it, black / white is reported. */
        const val EVEN = 0.2
        const val FAINTEST = 0.002

        /** Limit of residuals in ln: larger ones come from glare and must not move a line. */
        const val WILDEST = 1.0

        /** Smallest share of the cells' variance that a line must split off: p (1 - p) for a share p of the cells. */
        const val LEAST_SIDE = 0.05

        /** A shadow must leave at most this share of the squared residuals that the best plane leaves. */
        const val CLEARLY = 0.8

        /** Bounds of the steepness of a preview's tone curve relative to sRGB's. */
        const val FLATTEST = 0.7
        const val STEEPEST = 1.8
    }
}
