package org.camssf.recovery

import org.camssf.Grid
import org.camssf.Nodes
import org.camssf.Rules
import kotlin.math.ceil
import kotlin.math.exp
import kotlin.math.max
import kotlin.math.sqrt

/** μ (3, 69) and Ψ (3, 69, r) of a learned basis, with the width and scale of an answer; `count` is r. */
internal class Atoms(val mean: DoubleArray, val dictionary: DoubleArray, val count: Int) {
    /** The basis with its scale fixed by a shot's white (681): no atom changes Σ white s dλ. */
    fun anchored(white: DoubleArray): Atoms {
        val folded = Nodes.fold(white)
        val found = dictionary.copyOf()
        for (c in 0..2) {
            val level = (0 until Nodes.SIZE).sumOf { mean[c * Nodes.SIZE + it] * folded[it] }
            for (q in 0 until count) {
                val share =
                    (0 until Nodes.SIZE).sumOf { folded[it] * dictionary[(c * Nodes.SIZE + it) * count + q] } / level
                for (v in 0 until Nodes.SIZE) {
                    found[(c * Nodes.SIZE + v) * count + q] -=
                        mean[c * Nodes.SIZE + v] * share
                }
            }
        }
        return Atoms(mean, found, count)
    }

    companion object {
        /** The basis of this name, widened by `priorScale`; null on a basis without a prior. */
        fun of(basis: String, priorScale: Double): Atoms? = BasisConstants.of(basis)?.let { constants ->
            Atoms(
                constants.mean,
                DoubleArray(constants.dictionary.size) {
                    priorScale * constants.dictionary[it]
                },
                constants.atoms,
            )
        }
    }
}

/**
 * Turns signals into the rows b = A x + error that the curves must satisfy on a learned basis, with the covariance of
 * their errors by source. The counterpart of Python's camssf.recovery.linear_model; the model computes the same, but
 * does not output it. N = 3 k n rows, channel by channel, shot by shot, patch by patch.
 */
internal class LinearModel(private val observation: Observation, given: Atoms) {
    private val known = observation.known
    private val k = observation.signals.shape[0]
    private val n = observation.signals.shape[1]
    private val v = Nodes.SIZE
    private val q = known.lampModes.shape[1]
    private val gainModes = known.gains?.modes?.takeIf { it.values.isNotEmpty() }
    private val g = gainModes?.let { it.shape[1] } ?: 0

    /** The basis with its scale fixed by the first shot's white. */
    val basis: Atoms = given.anchored(
        DoubleArray(Grid.SIZE) {
            known.whiteReflectance.values[it] *
                known.lamp.values[it]
        },
    )
    private val r = basis.count
    private val size = 3 * k * n

    // Every integral over the grid, folded onto the nodes.
    private val patches = Array(k * n) { at -> folded(at / n) { m -> reflectance(at % n, m) } }
    private val edges = Array(k * n) { at -> folded(at / n) { m -> number("edge") * slope(at % n, m) } }
    private val whites = Array(k) { folded(it) { m -> known.whiteReflectance.values[m] } }
    private val lights = Array(k) { folded(it) { 1.0 } }
    private val modes = Array(k * q) { at -> DoubleArray(v) { known.lampModes.values[at * Grid.SIZE + 10 * it] } }
    private val bends = BooleanArray(k) { j -> (0 until q).any { p -> modes[j * q + p].any { it != 0.0 } } }

    /**
     * The linearisation point of the rows: curves (3, 69), lamps (k, 69) and levels 1 - ĥ (k, n), with the
     * covariances of lamp modes, `ofU` (k q, k q), and of the code, `ofX` (3 r, 3 r). `offset` is û (k q), then v̂ (k
     * g).
     */
    private class Point(
        val curves: DoubleArray,
        val lamp: DoubleArray,
        val level: DoubleArray,
        val offset: DoubleArray,
        val ofU: Matrix,
        val ofX: Matrix,
    )

    private val point: Point = start().let { if (bends.any { bent -> bent } || uneven()) look(it) else it }
    private val rows = Rows(point)

    private fun uneven() = gainModes != null && gainModes.values.any { it != 0.0 }

    /** (N, 3 r) A. */
    val matrix: Matrix get() = rows.matrix

    /** (N) b. */
    val target: DoubleArray get() = rows.target

    /** (N, k g) D of the gain modes; D Dᵀ is included in `terms`. */
    val gains: Matrix = rows.modes.part(0 until size, k * q until k * (q + g))

    /** The summands of the covariance by source, (N, N) each. */
    val terms: Map<String, Matrix> = rows.modes.part(0 until size, 0 until k * q).let { modes ->
        rows.terms + mapOf(
            "lamp modes" to modes.timesTransposed(modes).plus(rows.terms.getValue("lamp modes")),
            "uneven light" to gains.timesTransposed(gains).plus(rows.terms.getValue("uneven light")),
        )
    }

    /** (N, N) Σ. */
    val covariance: Matrix get() = terms.values.reduce { all, term -> all.plus(term) }

    /** (3, k) W, the white signals that the rows are divided by. */
    val white: DoubleArray = whites(point)

    private fun whites(at: Point) = DoubleArray(3 * k) { i ->
        val j = i % k
        (0 until v).sumOf { at.curves[i / k * v + it] * whites[j][it] * at.lamp[j * v + it] }
    }

    private fun folded(shot: Int, value: (Int) -> Double): DoubleArray =
        Nodes.fold(DoubleArray(Grid.SIZE) { known.lamp.values[shot * Grid.SIZE + it] * Grid.STEP * value(it) })

    private fun reflectance(patch: Int, at: Int) = known.reflectance.values[patch * Grid.SIZE + at]

    private fun slope(patch: Int, at: Int): Double {
        val after = minOf(at + 1, Grid.SIZE - 1)
        val before = max(at - 1, 0)
        return (reflectance(patch, after) - reflectance(patch, before)) / (Grid.STEP * (after - before))
    }

    private fun start() = Point(
        basis.mean, DoubleArray(k * v) { 1.0 }, DoubleArray(k * n) { 1.0 },
        DoubleArray(k * (q + g)), Matrix.unit(k * q), Matrix.unit(3 * r),
    )

    /** Gaussian posterior of lamps, gains and curves, from rows linearised at `from`: Python's `_first_pass`. */
    private fun look(from: Point): Point {
        val rows = Rows(from)
        val spread = rows.terms.values.reduce { all, term ->
            all.plus(term)
        }.plus(rows.matrix.timesTransposed(rows.matrix))
        val whitened = spread.whiten(Matrix.beside(rows.matrix, Matrix(size, 1, rows.target), rows.modes))
        val all = 0 until size
        val matrix = whitened.part(all, 0 until 3 * r)
        val target = whitened.part(all, 3 * r..3 * r)
        val many = k * (q + g)
        val modes = whitened.part(all, 3 * r + 1..3 * r + many)
        val unit = Matrix.unit(many)
        val turned = modes.transposed()
        val root = unit.plus(turned * modes).whiten(Matrix.beside(unit, turned * target))
        val back = root.part(0 until many, 0 until many)
        val offset = (back.transposed() * root.part(0 until many, many..many)).values
        val seen = (modes * Matrix(many, 1, offset)).values
        val left = Matrix(size, 1, DoubleArray(size) { target[it, 0] - seen[it] })
        val code = (matrix.transposed() * left).values
        val curves = DoubleArray(3 * v) { at ->
            basis.mean[at] + (0 until r).sumOf { basis.dictionary[at * r + it] * code[at / v * r + it] }
        }
        val lamp = DoubleArray(k * v) { at ->
            max(1.0 + (0 until q).sumOf { offset[at / v * q + it] * modes(at / v, it)[at % v] }, DARKEST)
        }
        val level = DoubleArray(k * n) { at ->
            max(1.0 - (0 until g).sumOf { offset[k * q + at / n * g + it] * gain(at / n, it, at % n) }, DARKEST)
        }
        val gram = matrix.transposed() * matrix
        val ofX = Matrix.of(3 * r, 3 * r) { i, j -> (if (i == j) 1.0 else 0.0) - gram[i, j] }
        val ofLamps = back.part(0 until many, 0 until k * q)
        return Point(curves, lamp, level, offset, ofLamps.transposed() * ofLamps, ofX)
    }

    private fun gain(shot: Int, mode: Int, patch: Int) = gainModes!!.values[(shot * g + mode) * n + patch]

    private fun modes(shot: Int, mode: Int) = modes[shot * q + mode]

    /** The linear model at a point; its terms do not include D Dᵀ. */
    private inner class Rows(private val at: Point) {
        private val whiteSignals = whites(at)
        private val predicted = DoubleArray(size)
        val matrix = Matrix(size, 3 * r)
        val target = DoubleArray(size)

        /** (N, k (q + g)) D: derivatives by the lamp modes (k q), then by the gain modes (k g). */
        val modes = Matrix(size, k * (q + g))

        /** ∂²y / ∂u ∂x of each row, by mode and atom of its own shot and channel. */
        private val bent = arrayOfNulls<Array<DoubleArray>>(size)
        private val chart = arrayOfNulls<DoubleArray>(size)
        private val over = arrayOfNulls<DoubleArray>(size)
        private val lamp = arrayOfNulls<DoubleArray>(size)

        init {
            for (row in 0 until size) fill(row)
        }

        private fun fill(row: Int) {
            val c = row / (k * n)
            val j = row / n % k
            val i = row % n
            val measured = observation.signals.values[3 * (j * n + i) + c]
            val y = measured * at.level[j * n + i]
            val perWhite = DoubleArray(v) { at.lamp[j * v + it] / whiteSignals[c * k + j] }
            val curve = DoubleArray(v) { at.curves[c * v + it] }
            val patch = DoubleArray(v) { patches[j * n + i][it] * perWhite[it] }
            val seen = DoubleArray(v) { whites[j][it] * perWhite[it] }
            val expected = dot(patch, curve)
            predicted[row] = expected
            val about = if (bends[j]) expected else y
            val a = DoubleArray(v) { patch[it] - about * seen[it] }
            for (p in 0 until r) matrix[row, c * r + p] = alongAtom(a, c, p)
            target[row] = (y - about) - (0 until v).sumOf { a[it] * basis.mean[c * v + it] }
            val difference = DoubleArray(v) { patch[it] - expected * seen[it] }
            for (p in 0 until q) bend(row, c, j, p, curve, difference, seen)
            for (p in 0 until g) modes[row, k * q + j * g + p] = measured * gain(j, p, i)
            for (p in 0 until q) target[row] += modes[row, j * q + p] * at.offset[j * q + p]
            for (p in k * q + j * g until k * q + (j + 1) * g) target[row] += modes[row, p] * at.offset[p]
            errors(row, i, j, curve, perWhite, patch, seen, difference)
        }

        private fun errors(
            row: Int, i: Int, j: Int, s: DoubleArray, perWhite: DoubleArray,
            patch: DoubleArray, seen: DoubleArray, difference: DoubleArray,
        ) {
            val wide = along(LONG, DoubleArray(v) { patch[it] * s[it] })
            val flat = along(SHORT, DoubleArray(v) { lights[j][it] * perWhite[it] * s[it] })
            val steep = along(SHORT, DoubleArray(v) { edges[j * n + i][it] * perWhite[it] * s[it] })
            val tolerance = known.chartTolerance.values[i]
            chart[row] = DoubleArray(wide.size + flat.size + steep.size) {
                tolerance * when {
                    it < wide.size -> number("relative") * wide[it]
                    it < wide.size + flat.size -> number("absolute") * flat[it - wide.size]
                    else -> steep[it - wide.size - flat.size]
                }
            }
            val white = along(LONG, DoubleArray(v) { seen[it] * s[it] })
            over[row] = DoubleArray(white.size) { known.whiteTolerance * predicted[row] * white[it] }
            val light = along(SMOOTH, DoubleArray(v) { difference[it] * s[it] })
            lamp[row] = DoubleArray(light.size + 1) {
                if (it < light.size) known.lampTolerance.values[j] * light[it] else number("drift") * predicted[row]
            }
        }

        /** Derivative of the signal by a mode of its lamp, and the derivative of that by the code. */
        private fun bend(row: Int, c: Int, j: Int, p: Int, s: DoubleArray, a: DoubleArray, seen: DoubleArray) {
            val mode = modes(j, p)
            val relative = DoubleArray(v) { a[it] / at.lamp[j * v + it] * mode[it] }
            val step = dot(relative, s)
            modes[row, j * q + p] = step
            val off = (0 until v).sumOf { seen[it] / at.lamp[j * v + it] * s[it] * mode[it] }
            val own = bent[row] ?: Array(q) { DoubleArray(r) }.also { bent[row] = it }
            for (atom in 0 until r) {
                own[p][atom] =
                    alongAtom(relative, c, atom) - off * alongAtom(a, c, atom) - step * alongAtom(seen, c, atom)
            }
        }

        private fun alongAtom(weight: DoubleArray, c: Int, atom: Int): Double {
            var total = 0.0
            for (it in 0 until v) total += weight[it] * basis.dictionary[(c * v + it) * r + atom]
            return total
        }

        val terms: Map<String, Matrix> by lazy {
            val floor = number("floor") * number("floor")
            val noise = Matrix(size, size)
            val table = Matrix(size, size)
            for (row in 0 until size) {
                val at = 3 * (row % (k * n)) + row / (k * n)
                val level = this.at.level[at / 3]
                val error = level * observation.standardError.values[at]
                val signal = level * observation.signals.values[at]
                val own = number("independent_share") * known.chartTolerance.values[row % n] * signal
                noise[row, row] = max(error * error, floor)
                table[row, row] = max(error * error + own * own, floor) - noise[row, row]
            }
            val share = number("channel_share")
            for (a in 0 until size) {
                for (b in a % n until size step n) { // of the same patch
                    table[a, b] += (if (a / (k * n) == b / (k * n)) 1.0 else share) * dot(chart[a]!!, chart[b]!!)
                }
            }
            val same = Matrix.of(size, size) { a, b ->
                if (a / n % k ==
                    b / n % k
                ) {
                    dot(lamp[a]!!, lamp[b]!!)
                } else {
                    0.0
                }
            }
            mapOf(
                "noise" to noise,
                "chart" to table,
                "white" to Matrix.of(size, size) { a, b -> dot(over[a]!!, over[b]!!) },
                "lamp" to same,
                "lamp modes" to curvature(),
                "uneven light" to own(),
            )
        }

        /** κ² D Dᵀ within a channel: the part of the gains that is independent by channel. */
        private fun own(): Matrix {
            val share = known.gains?.own ?: 0.0
            if (g == 0 || share == 0.0) return Matrix(size, size)
            val all = modes.part(0 until size, k * q until k * (q + g))
            val spread = all.timesTransposed(all)
            return Matrix.of(size, size) { a, b ->
                if (a / (k * n) == b / (k * n)) share * share * spread[a, b] else 0.0
            }
        }

        /** Σ B_qr C_qp X_rs B_ps over the modes of both rows' shots and the atoms of both rows' channels. */
        private fun curvature(): Matrix {
            val found = Matrix(size, size)
            if (q == 0) return found
            for (a in 0 until size) {
                val own = bent[a]!!
                val c = a / (k * n)
                val j = a / n % k
                val byCode = Array(q) { p ->
                    DoubleArray(3 * r) { to -> (0 until r).sumOf { own[p][it] * at.ofX[c * r + it, to] } }
                }
                val spread = Array(k * q) { to ->
                    DoubleArray(3 * r) { x -> (0 until q).sumOf { byCode[it][x] * at.ofU[j * q + it, to] } }
                }
                for (b in 0 until size) {
                    val other = bent[b]!!
                    val channel = b / (k * n) * r
                    val shot = b / n % k * q
                    var total = 0.0
                    for (p in 0 until q) for (x in 0 until r) total += spread[shot + p][channel + x] * other[p][x]
                    found[a, b] = total
                }
            }
            return found
        }
    }

    private companion object {
        /** Lower limit of the factors by which lamp modes and gain modes change the light. */
        const val DARKEST = 0.02

        fun number(word: String): Double = Rules.shipped.number("covariance.$word")

        val LONG by lazy { smooth(number("chart_correlation")) }
        val SHORT by lazy { smooth(number("table_correlation")) }
        val SMOOTH by lazy { smooth(number("lamp_correlation")) }

        /** Directions, on the nodes, of an error with this correlation length in nm: Python's `smooth_errors`. */
        fun smooth(length: Double): List<DoubleArray> {
            val step = length / 2.0
            val weight = sqrt(step / (length * sqrt(Math.PI / 2.0)))
            return List(ceil((340.0 + 4.0 * length + step) / step).toInt()) { p ->
                val place = 380.0 - 2.0 * length + step * p
                DoubleArray(Nodes.SIZE) {
                    val u = (380.0 + 5.0 * it - place) / length
                    weight * exp(-u * u)
                }
            }
        }

        fun along(directions: List<DoubleArray>, weight: DoubleArray) = DoubleArray(directions.size) {
            dot(directions[it], weight)
        }

        fun dot(a: DoubleArray, b: DoubleArray): Double {
            var total = 0.0
            for (i in a.indices) total += a[i] * b[i]
            return total
        }
    }
}
