package org.camssf.colour

import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.Nodes
import org.camssf.fit.Colour
import kotlin.math.max
import kotlin.math.sqrt

/**
 * The surfaces' white-balanced signals under a lamp, and their true XYZ.
 *
 * @property signals (n, 3), row by row.
 * @property xyz (n, 3) true values.
 * @property white (3) XYZ of a perfect white.
 */
internal class Learned(val signals: DoubleArray, val xyz: DoubleArray, val white: DoubleArray) {
    companion object {
        fun of(power: DoubleArray, curves: Three, functions: Three): Learned {
            val (xyz, white) = truth(power, functions)
            return Learned(signals(power, curves), xyz, white)
        }

        /** White-balanced signals (n, 3) of the surfaces. */
        fun signals(power: DoubleArray, curves: Three): DoubleArray {
            val seen = lit(power, curves)
            return through(seen) { seen[it].sum() }
        }

        /** XYZ (n, 3) of the surfaces and (3) of a perfect white under a lamp. */
        fun truth(power: DoubleArray, functions: Three): Pair<DoubleArray, DoubleArray> {
            val seen = lit(power, functions)
            val scale = seen[1].sum()
            return through(seen) { scale } to DoubleArray(3) { seen[it].sum() / scale }
        }

        /** The lamp's power times each of three curves, on the grid. */
        fun lit(power: DoubleArray, curves: Three): Three = Array(3) { c ->
            DoubleArray(Grid.SIZE) { power[it] * curves[c][it] }
        }

        /** Σ R · seen / scale for every surface R, (n, 3). */
        inline fun through(seen: Three, scale: (Int) -> Double): DoubleArray {
            val found = DoubleArray(3 * Tables.surfaces.size)
            for (c in 0..2) {
                val nodes = Nodes.fold(seen[c])
                val level = scale(c)
                Tables.surfaces.forEachIndexed { i, surface -> found[3 * i + c] = dot(surface, nodes) / level }
            }
            return found
        }
    }
}

/**
 * A transform of white-balanced signals to XYZ under a lamp: a matrix of r, g, b, or a root-polynomial of degree 2
 * (Finlayson, Mackiewicz and Hurlbert, IEEE Trans. Image Process. 2015, 24, 1460). Cross-validation chooses which.
 *
 * @property coefficients (p, 3) for X, Y, Z; each column sums to white's.
 * @property white (3) XYZ of a perfect white under the lamp.
 * @property residual (n, 3) XYZ of each surface in cross-validation minus the true one, divided by `level`.
 * @property signals (n, 3) of the surfaces.
 */
internal class Transform private constructor(
    val kind: Kind,
    val coefficients: DoubleArray,
    val white: DoubleArray,
    val residual: DoubleArray,
    val signals: DoubleArray,
) {
    companion object {
        private const val FOLDS = 5

        /**
         * Returns the transform of the kind with the smallest cross-validation error (mean ΔE00), or of `kind` if it
         * is given.
         *
         * @throws InvalidArgument a curve without a response to the lamp, or linearly dependent curves.
         */
        fun choose(power: DoubleArray, curves: Three, functions: Three, kind: Kind?): Transform {
            val seen = List(3) { dot(power, curves[it]) }
            if (!seen.all { it.isFinite() && it > 0 }) {
                throw InvalidArgument(
                    "A curve has no response to this lamp.",
                    "Check the lamp's spectrum, and the curves.",
                )
            }
            val learned = Learned.of(power, curves, functions)
            val kinds = if (kind == null) Kind.values().toList() else listOf(kind)
            val predicted = kinds.associateWith { leftOut(learned, it) }
            val lamp = learned.white
            val truth = labs(learned.xyz, lamp)
            // With equal errors the first kind wins; it has fewer coefficients.
            val best = if (kind != null) {
                kind
            } else {
                kinds.minByOrNull { each ->
                    val found = labs(predicted.getValue(each), lamp)
                    truth.indices.sumOf { Colour.difference(truth[it], found[it]) }
                }!!
            }
            val found = predicted.getValue(best)
            val residual = DoubleArray(found.size) {
                (found[it] - learned.xyz[it]) / level(learned.signals, it - it % 3)
            }
            return Transform(best, fit(learned, best) ?: throw alike(), lamp, residual, learned.signals)
        }

        private fun alike() =
            InvalidArgument("Two of the curves are alike.", "Check that they are red, green and blue.")

        private fun labs(xyz: DoubleArray, white: DoubleArray): List<DoubleArray> =
            List(xyz.size / 3) { Spaces.lab(doubleArrayOf(xyz[3 * it], xyz[3 * it + 1], xyz[3 * it + 2]), white) }

        /** Cross-validated XYZ (n, 3): each fold is predicted by a fit to the other folds. */
        private fun leftOut(learned: Learned, kind: Kind): DoubleArray {
            val found = DoubleArray(learned.xyz.size)
            for (fold in 0 until FOLDS) {
                val fitted = fit(learned, kind) { it % FOLDS != fold } ?: throw alike()
                for (i in fold until found.size / 3 step FOLDS) {
                    kind.apply(fitted, learned.signals, 3 * i, found, 3 * i)
                }
            }
            return found
        }

        /**
         * Coefficients (p, 3) by least squares in XYZ, subject to Σ coefficients = white, from the surfaces for which
         * `included` is true; null if the signals are linearly dependent.
         */
        inline fun fit(learned: Learned, kind: Kind, included: (Int) -> Boolean = { true }): DoubleArray? {
            val p = kind.terms
            val rows = (0 until learned.xyz.size / 3).filter { included(it) }
            val terms = DoubleArray(p)
            // The free directions of the coefficients, then the residual of X, Y, Z without the fixed part.
            val columns = Array(p + 2) { DoubleArray(rows.size) }
            rows.forEachIndexed { row, i ->
                kind.terms(learned.signals, 3 * i, terms)
                val middle = terms.sum() / p
                for (a in 0 until p - 1) columns[a][row] = dot(kind.free[a], terms)
                for (c in 0..2) columns[p - 1 + c][row] = learned.xyz[3 * i + c] - middle * learned.white[c]
            }
            val free = Columns.solve(columns, p - 1) ?: return null
            return DoubleArray(3 * p) { at ->
                learned.white[at % 3] / p + free.indices.sumOf { kind.free[it][at / 3] * free[it][at % 3] }
            }
        }

        /** Mean of the three signals from index `from` on; a surface's errors are proportional to it. */
        fun level(signals: DoubleArray, from: Int = 0): Double =
            max((signals[from] + signals[from + 1] + signals[from + 2]) / 3, 1e-9)
    }
}

/** Terms in r, g, b that a transform uses; the kind with the fewest terms comes first. */
public enum class Kind(
    /** Its name in results and in Python's options. */
    public val word: String,
    internal val terms: Int,
) {
    /** r, g, b. */
    MATRIX("matrix", 3),

    /** r, g, b, √(r g), √(g b), √(r b): a brighter light scales XYZ and changes no hue. */
    ROOT_POLYNOMIAL("root-polynomial", 6),
    ;

    /** (p - 1, p) orthonormal directions that do not change the sum of the coefficients. */
    internal val free: Array<DoubleArray> = Array(terms - 1) { a ->
        val size = sqrt((a + 1.0) * (a + 2.0))
        DoubleArray(terms) {
            if (it <= a) {
                1 / size
            } else if (it == a + 1) {
                -(a + 1) / size
            } else {
                0.0
            }
        }
    }

    /** Computes the terms of the three signals from index `from` on; negative signals count as 0. */
    internal fun terms(signals: DoubleArray, from: Int, into: DoubleArray) {
        val r = max(signals[from], 0.0)
        val g = max(signals[from + 1], 0.0)
        val b = max(signals[from + 2], 0.0)
        into[0] = r
        into[1] = g
        into[2] = b
        if (this == MATRIX) return
        into[3] = sqrt(r * g)
        into[4] = sqrt(g * b)
        into[5] = sqrt(r * b)
    }

    /** Computes XYZ (3) at index `to` of `into` from the three signals at index `from`. */
    internal fun apply(coefficients: DoubleArray, signals: DoubleArray, from: Int, into: DoubleArray, to: Int) {
        val terms = DoubleArray(terms)
        terms(signals, from, terms)
        for (c in 0..2) {
            var total = 0.0
            for (t in terms.indices) total += terms[t] * coefficients[3 * t + c]
            into[to + c] = total
        }
    }
}
