package org.camssf.fit

import org.camssf.InvalidArgument
import org.camssf.LeastSquares
import org.camssf.Rows
import org.camssf.Rules
import org.camssf.photo.Signals
import org.camssf.short
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import kotlin.math.sqrt

/**
 * How well the curves predict patches that the fit did not use ("unseen").
 *
 * Neither score detects a wrong lamp, which affects both of its sides.
 *
 * @property deltaE00 mean CIEDE2000 between measured and synthetic patch colours.
 * @property unseen how the unseen patches were chosen, in words.
 */
public class Scores internal constructor(
    internal val sharedRmsre: DoubleArray,
    public val deltaE00: Double,
    public val unseen: String,
    internal val measuredSrgb: DoubleArray = DoubleArray(0),
    internal val syntheticSrgb: DoubleArray = DoubleArray(0),
    /** (3) root mean square error against a known truth; null if there is none. */
    internal val rmse: Rows? = null,
) {
    /** (3) root mean square relative error of the signals (the paper's Eq. 13), %. */
    public val rmsrePercent: Rows get() = Rows(sharedRmsre, 3)

    override fun toString(): String =
        "Scores(rmsrePercent=${sharedRmsre.joinToString { short(it) }}, deltaE00=${short(deltaE00)})"

    internal companion object {
        /** A signal not above this share of the white has no relative error and is left out of RMSRE. */
        private val FAINTEST get() = Rules.shipped.number("calibration.faintest")

        /**
         * Scores predictions (k, n, 3) for the entries (k, n) that `counts` marks, as Python's `camssf.fit.scores`.
         *
         * @throws InvalidArgument no unseen patch is left.
         */
        fun of(
            signals: Signals,
            predicted: DoubleArray,
            table: ChartTable,
            lamps: List<Lamp>,
            counts: BooleanArray,
            how: String,
        ): Scores {
            val n = signals.patches
            val measured = DoubleArray(predicted.size)
            val synthetic = DoubleArray(predicted.size)
            val differences = ArrayList<Double>()
            for ((j, lamp) in lamps.withIndex()) {
                val matrix = matrix(signals, j, Colour.xyz(table.sharedValues, lamp.sharedValues))
                val white = Colour.white(lamp.sharedValues)
                fun seen(values: DoubleArray): DoubleArray = Colour.adapted(
                    DoubleArray(3 * n) { at ->
                        val i = 3 * j * n + at - at % 3
                        (0..2).sumOf { values[i + it] * matrix[it][at % 3] }
                    },
                    white,
                )
                val ours = seen(signals.sharedValues)
                val theirs = seen(predicted)
                Colour.srgb(ours).copyInto(measured, 3 * j * n)
                Colour.srgb(theirs).copyInto(synthetic, 3 * j * n)
                val a = Colour.lab(ours)
                val b = Colour.lab(theirs)
                for (i in 0 until n) {
                    if (!counts[j * n + i]) continue
                    differences += Colour.difference(a.copyOfRange(3 * i, 3 * i + 3), b.copyOfRange(3 * i, 3 * i + 3))
                }
            }
            val rmsre = rmsre(signals.sharedValues, predicted, counts)
            return Scores(rmsre, differences.average(), how, measured, synthetic)
        }

        private fun rmsre(measured: DoubleArray, predicted: DoubleArray, counts: BooleanArray): DoubleArray =
            DoubleArray(3) { c ->
                val valid = counts.indices.filter { counts[it] && measured[3 * it + c] > FAINTEST }
                if (valid.isEmpty()) {
                    throw InvalidArgument(
                        "No patch is left for validation.",
                        "Leave patches out of the fit, or use a brighter photo.",
                    )
                }
                val total = valid.sumOf { i ->
                    val error = predicted[3 * i + c] / measured[3 * i + c] - 1.0
                    error * error
                }
                100.0 * sqrt(total / valid.size)
            }

        /** The 3 × 3 matrix that converts a shot's signals to XYZ (n, 3), by least squares over its used patches. */
        private fun matrix(signals: Signals, shot: Int, target: DoubleArray): Array<DoubleArray> {
            val n = signals.patches
            val used = (0 until n).filter { signals.sharedUsed[shot * n + it] }
            val fit = if (used.size >= 3) used else (0 until n).toList()
            val rows = fit.map { i ->
                DoubleArray(3) { signals.sharedValues[3 * (shot * n + i) + it] }
            }.toTypedArray()
            val columns = List(3) { c -> LeastSquares.solve(rows, DoubleArray(fit.size) { target[3 * fit[it] + c] }) }
            // If the signals are linearly dependent there is no such matrix: all colours become grey.
            return Array(3) { a -> DoubleArray(3) { c -> columns[c]?.get(a) ?: 1.0 / 3 } }
        }
    }
}
