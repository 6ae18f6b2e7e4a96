package org.camssf.evidence

import org.camssf.Grid
import org.camssf.LeastSquares
import org.camssf.curves.Ssf
import org.camssf.photo.ChartPose
import org.camssf.photo.Signals
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import kotlin.math.ceil
import kotlin.math.exp
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.pow
import kotlin.math.sqrt

/**
 * One way in which a capture may be wrong, and what it would explain of T.
 *
 * @property kind "veil", "white", "light", "tone" or "patch".
 * @property patch 0-based; null where it is of no patch.
 * @property gain of T.
 * @property amount its size where it has one direction, in units of that; 0 else.
 */
internal class Suspect(val kind: String, val patch: Int?, val gain: Double, val amount: Double)

/**
 * How ill the answer fits what was told: rules 1 to 3 of Python's `camssf.evidence.verdict`, whose letters are used here.
 *
 * @property residual part of T, summed over the channels.
 * @property prior the other part.
 * @property count N.
 * @property suspects in the order of rule 3, patches last.
 */
internal class Surprise(val residual: Double, val prior: Double, val count: Int, val suspects: List<Suspect>) {
    /** T. */
    val total: Double get() = residual + prior

    /** T₄. */
    val weighted: Double get() = residual + 4.0 * prior

    /** T as a standard normal number (Wilson and Hilferty 1931). */
    val z: Double
        get() {
            val u = 2.0 / (9.0 * count)
            return ((total / count).pow(1.0 / 3.0) - (1.0 - u)) / sqrt(u)
        }
}

/** What a surprise is about: an answer, and what it was told. */
internal class Told(
    val signals: Signals,
    val table: ChartTable,
    val lamps: List<Lamp>,
    val ssf: Ssf,
    val whiteReflectance: DoubleArray,
    val whiteTolerance: Double,
) {
    private val n = signals.patches

    /** Used signals, shot by shot: index into (k, n). */
    private val rows = signals.used.indices.filter { signals.used[it] }.toIntArray()

    /** The parts of the answer to shot j alone that concern that shot. */
    fun only(j: Int, answer: Ssf): Told = Told(
        signals.only(j),
        table,
        listOf(lamps[j]),
        answer.only(j, n),
        whiteReflectance,
        whiteTolerance,
    )

    /** Suspects are questioned where the pose of one shot is given. */
    fun surprise(pose: ChartPose? = null, whiteIsPatch: Boolean = false): Surprise {
        val off = List(3) { c -> column(c) { signals.values[it] - ssf.predicted[it] } }
        val inverse = List(3) { c -> Symmetric.inverse(covariance(c)) }
        val e = List(3) { c -> times(inverse[c], off[c]) }
        val residual = (0..2).sumOf { c -> dot(off[c], e[c]) }
        val prior = if (ssf.std != null) ssf.code.sumOf { it * it } else 0.0
        val suspects = if (pose == null) emptyList() else suspects(pose, whiteIsPatch, inverse, e)
        return Surprise(residual, prior, 3 * rows.size, suspects)
    }

    private fun column(c: Int, value: (Int) -> Double): DoubleArray = DoubleArray(rows.size) {
        value(3 * rows[it] + c)
    }

    /** Rule 1, (rows, rows). */
    private fun covariance(c: Int): Array<DoubleArray> {
        val y = column(c) { signals.values[it] }
        val se = column(c) { signals.standardError[it] }
        val predicted = column(c) { ssf.predicted[it] }
        val rho = whiteReflectance
        val light = lamps.indices.map { j ->
            // v_j
            val seen = DoubleArray(Grid.SIZE) {
                ssf.sharedLamp[j * Grid.SIZE + it] * ssf.sharedValues[3 * it + c] * Grid.STEP
            }
            val white = (0 until Grid.SIZE).sumOf { seen[it] * rho[it] }
            DoubleArray(Grid.SIZE) { seen[it] / white }
        }
        val absolute = light.map { v -> Directions.SHORT.along { v[it] } }
        val white = light.map { v -> Directions.LONG.along { v[it] * rho[it] } }
        val relative = rows.map { row -> Directions.LONG.along { light[row / n][it] * reflectance(row % n, it) } }
        val edges = rows.map { row -> Directions.SHORT.along { light[row / n][it] * slope(row % n, it) } }
        val offs = Array(rows.size) { a ->
            val v = light[rows[a] / n]
            DoubleArray(Grid.SIZE) { v[it] * (reflectance(rows[a] % n, it) - predicted[a] * rho[it]) }
        }
        val smooth = offs.map { off -> Directions.LAMP.along { off[it] } }
        val modes = offs.mapIndexed { a, off ->
            val known = lamps[rows[a] / n].modes
            DoubleArray(known.size) { q -> (0 until Grid.SIZE).sumOf { off[it] * known[q][it] } }
        }
        val sigma = Array(rows.size) { DoubleArray(rows.size) }
        for (a in rows.indices) {
            val i = rows[a] % n
            val j = rows[a] / n
            for (b in 0..a) {
                val other = rows[b] / n
                val both = predicted[a] * predicted[b]
                var value = whiteTolerance * whiteTolerance * both * dot(white[j], white[other])
                if (rows[b] % n == i) {
                    value += table.tolerance[i] * table.tolerance[i] * (
                        RELATIVE * RELATIVE * dot(relative[a], relative[b]) +
                            ABSOLUTE * ABSOLUTE * dot(absolute[j], absolute[other]) +
                            EDGE * EDGE * dot(edges[a], edges[b])
                        )
                }
                if (j == other) {
                    value += lamps[j].tolerance * lamps[j].tolerance * dot(smooth[a], smooth[b])
                    value += dot(modes[a], modes[b])
                    value += DRIFT * DRIFT * both
                }
                sigma[a][b] = value
                sigma[b][a] = value
            }
            val table = INDEPENDENT * table.tolerance[i] * y[a]
            sigma[a][a] += max(se[a] * se[a], FLOOR * FLOOR) + table * table
        }
        return sigma
    }

    private fun reflectance(i: Int, m: Int): Double = table.sharedValues[i * Grid.SIZE + m]

    /** Central difference of R per nm, one-sided at the ends. */
    private fun slope(i: Int, m: Int): Double {
        val after = minOf(m + 1, Grid.SIZE - 1)
        val before = max(m - 1, 0)
        return (reflectance(i, after) - reflectance(i, before)) / (Grid.STEP * (after - before))
    }

    /** Rule 3. */
    private fun suspects(
        pose: ChartPose,
        whiteIsPatch: Boolean,
        inverse: List<Array<DoubleArray>>,
        e: List<DoubleArray>,
    ): List<Suspect> {
        val y = List(3) { c -> column(c) { signals.values[it] } }
        val (x, z) = places(pose)
        fun way(value: (Int, Int) -> Double) = List(3) { c -> DoubleArray(rows.size) { value(c, it) } }
        val ways = LinkedHashMap<String, List<List<DoubleArray>>>()
        ways["veil"] = listOf(way { c, a -> 1.0 - y[c][a] })
        if (!whiteIsPatch) ways["white"] = List(3) { own -> way { c, a -> if (c == own) y[c][a] else 0.0 } }
        ways["light"] = listOfNotNull(
            way { c, a -> y[c][a] * x[a] },
            way { c, a -> y[c][a] * z[a] },
            way { c, a -> y[c][a] * (x[a] * x[a] + z[a] * z[a]) },
            if (whiteIsPatch) y else null,
        )
        ways["tone"] = listOf(way { c, a -> y[c][a] * ln(max(y[c][a], 1e-3)) })
        return ways.map { (kind, directions) ->
            val (gain, amount) = gain(directions, inverse, e)
            Suspect(kind, null, gain, amount)
        } + rows.indices.map { a ->
            Suspect("patch", rows[a] % n, (0..2).sumOf { c -> e[c][a] * e[c][a] / inverse[c][a][a] }, 0.0)
        }
    }

    /** X, Y of the used patches. */
    private fun places(pose: ChartPose): List<DoubleArray> {
        val centres = List(2) { axis ->
            DoubleArray(rows.size) { a -> (0..3).sumOf { pose.quads[8 * (rows[a] % n) + 2 * it + axis] } / 4 }
        }
        val size = max(centres.maxOf { it.max() - it.min() }, 1.0)
        return centres.map { axis ->
            val middle = axis.average()
            DoubleArray(axis.size) { (axis[it] - middle) / size }
        }
    }

    /** What a suspect explains, and its amount. */
    private fun gain(
        ways: List<List<DoubleArray>>,
        inverse: List<Array<DoubleArray>>,
        e: List<DoubleArray>,
    ): Pair<Double, Double> {
        val g = DoubleArray(ways.size) { d -> (0..2).sumOf { c -> dot(ways[d][c], e[c]) } }
        val solved = ways.map { way -> List(3) { c -> times(inverse[c], way[c]) } }
        val matrix = Array(ways.size) { a ->
            DoubleArray(ways.size) { b -> (0..2).sumOf { c -> dot(ways[a][c], solved[b][c]) } }
        }
        val ridge = 1e-12 * ways.indices.sumOf { matrix[it][it] } + 1e-300
        for (d in ways.indices) matrix[d][d] += ridge
        val amounts = LeastSquares.solve(matrix, g) ?: return 0.0 to 0.0
        return dot(g, amounts) to if (ways.size == 1) amounts[0] else 0.0
    }

    private companion object {
        const val RELATIVE = 0.6
        const val ABSOLUTE = 1.0 / 3.0
        const val EDGE = 70.0
        const val INDEPENDENT = 0.05
        const val FLOOR = 1e-4

        /** Relative change of a lamp between chart and white frame that is nobody's fault. */
        const val DRIFT = 0.01
    }
}

/**
 * Φ of an error that is smooth over a length: column q is √(h / (ℓ √(π/2))) exp(-((λ - t_q) / ℓ)²), with h = ℓ / 2 and
 * t_q = 380 - 2 ℓ + q h up to the first at or beyond 720 + 2 ℓ.
 */
internal class Directions private constructor(length: Double) {
    private val columns: Array<DoubleArray>

    init {
        val step = length / 2.0
        val weight = sqrt(step / (length * sqrt(Math.PI / 2.0)))
        val grid = Grid.WAVELENGTHS
        columns = Array(ceil((340.0 + 4.0 * length) / step).toInt() + 1) { q ->
            val place = 380.0 - 2.0 * length + step * q
            DoubleArray(Grid.SIZE) {
                val u = (grid[it] - place) / length
                weight * exp(-u * u)
            }
        }
    }

    /** Φᵀ f. */
    inline fun along(f: (Int) -> Double): DoubleArray {
        val values = DoubleArray(Grid.SIZE) { f(it) }
        return project(values)
    }

    fun project(values: DoubleArray): DoubleArray = DoubleArray(columns.size) { dot(columns[it], values) }

    companion object {
        /** Of the relative part of a chart's error, and of a white's. */
        val LONG by lazy { Directions(100.0) }

        /** Of the other parts of a chart's error. */
        val SHORT by lazy { Directions(25.0) }
        val LAMP by lazy { Directions(60.0) }
    }
}

/** Symmetric positive definite matrices. */
internal object Symmetric {
    /** The inverse by Cholesky's factor. */
    fun inverse(matrix: Array<DoubleArray>): Array<DoubleArray> {
        val n = matrix.size
        val root = Array(n) { DoubleArray(n) }
        for (i in 0 until n) {
            for (j in 0..i) {
                var value = matrix[i][j]
                for (p in 0 until j) value -= root[i][p] * root[j][p]
                root[i][j] = if (i == j) sqrt(value) else value / root[j][j]
            }
        }
        val back = Array(n) { DoubleArray(n) } // root⁻¹, lower
        for (j in 0 until n) {
            back[j][j] = 1.0 / root[j][j]
            for (i in j + 1 until n) {
                var value = 0.0
                for (p in j until i) value -= root[i][p] * back[p][j]
                back[i][j] = value / root[i][i]
            }
        }
        val inverse = Array(n) { DoubleArray(n) }
        for (i in 0 until n) {
            for (j in 0..i) {
                var value = 0.0
                for (p in i until n) value += back[p][i] * back[p][j]
                inverse[i][j] = value
                inverse[j][i] = value
            }
        }
        return inverse
    }
}

internal fun dot(a: DoubleArray, b: DoubleArray): Double {
    var total = 0.0
    for (i in a.indices) total += a[i] * b[i]
    return total
}

private fun times(matrix: Array<DoubleArray>, vector: DoubleArray): DoubleArray =
    DoubleArray(matrix.size) { dot(matrix[it], vector) }
