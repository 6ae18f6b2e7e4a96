package org.camssf.colour

import org.camssf.recovery.Tensor
import kotlin.math.cbrt
import kotlin.math.exp
import kotlin.math.ln
import kotlin.math.max

/**
 * XYZ of pixels of one light: the posterior's means without noise at nodes of ln r/g and ln b/g. Cube roots, of which
 * Lab consists, are bilinear between them. Ratios beyond e³ count as e³.
 *
 * @param means (NODES, NODES, 3) XYZ over its white, of [signals].
 * @property white (3) XYZ of the white that Lab is relative to.
 */
internal class PixelTable(means: DoubleArray, private val white: DoubleArray) {
    /** (NODES, NODES, 3) cube roots of XYZ over white and over the mean of the signals; ln b/g varies faster. */
    private val values = DoubleArray(NODES * NODES * 3) { cbrt(means[it]) }

    /** XYZ (3) of the signals at a place, or L*, a*, b*. */
    fun colour(place: Place, lab: Boolean, into: DoubleArray) {
        val at = place.at
        val u = place.u
        val v = place.v
        for (c in 0..2) {
            val left = (1 - v) * values[at + c] + v * values[at + 3 + c]
            val right = (1 - v) * values[at + 3 * NODES + c] + v * values[at + 3 * NODES + 3 + c]
            into[c] = place.root * ((1 - u) * left + u * right)
        }
        if (lab) {
            Spaces.labOfRoots(into)
        } else {
            for (c in 0..2) into[c] = white[c] * into[c] * into[c] * into[c]
        }
    }

    /** Where signals lie in the tables of all lights; reused from pixel to pixel. */
    class Place {
        /** Cube root of the mean of the signals. */
        var root = 0.0
            private set

        /** Index of the node below, and the shares of the next ones. */
        var at = 0
            private set
        var u = 0.0
            private set
        var v = 0.0
            private set

        /** Moves to signals; those below black count as black, and NaN gives a root of NaN. */
        fun move(red: Double, green: Double, blue: Double) {
            val r = max(red, 0.0)
            val g = max(green, 0.0)
            val b = max(blue, 0.0)
            val level = (r + g + b) / 3
            root = cbrt(level)
            if (!(level > 0)) return // black and NaN are so by their root
            val least = SMALL * level
            val middle = ln(max(g, least))
            val x = along(ln(max(r, least)) - middle)
            val y = along(ln(max(b, least)) - middle)
            val i = x.toInt().coerceAtMost(NODES - 2)
            val j = y.toInt().coerceAtMost(NODES - 2)
            u = x - i
            v = y - j
            at = 3 * (i * NODES + j)
        }

        private fun along(ratio: Double): Double = ((ratio + EDGE) / STEP).coerceIn(0.0, NODES - 1.0)
    }

    companion object {
        /** Along each ratio. */
        const val NODES = 129

        /** Along each ratio, of a covariance. */
        const val COARSE = 17
        private const val EDGE = 3.0
        private const val STEP = 2 * EDGE / (NODES - 1)

        /** Signals below this share of the level have ratios beyond the edge. */
        private const val SMALL = 1e-6

        /** (NODES, NODES, 3) exact signals of mean 1. */
        val signals: Tensor get() = Tensor(signalsAt(NODES), NODES, NODES, 3)

        /** (COARSE², 3) exact signals of mean 1. */
        val coarseSignals: Tensor = Tensor(signalsAt(COARSE), COARSE * COARSE, 3)

        /** (nodes, nodes, 3) signals of mean 1 at so many nodes of each ratio, row-major. */
        private fun signalsAt(nodes: Int): DoubleArray {
            val step = 2 * EDGE / (nodes - 1)
            val z = DoubleArray(3 * nodes * nodes)
            for (at in z.indices step 3) {
                z[at] = exp(at / 3 / nodes * step - EDGE)
                z[at + 1] = 1.0
                z[at + 2] = exp(at / 3 % nodes * step - EDGE)
                val level = (z[at] + z[at + 1] + z[at + 2]) / 3
                for (c in at..at + 2) z[c] /= level
            }
            return z
        }
    }
}
