package org.camssf.photo

import org.camssf.Rules
import kotlin.math.abs
import kotlin.math.max
import kotlin.math.sqrt

/**
 * Combines the statistics of the CFA cell's positions into colours: lens shading is applied and the two greens are
 * averaged. Rules 6 and 7 of docs/patches.md.
 *
 * @param n number of patches.
 * @param black (4) level of R, the green on R's rows, the green on B's rows, B, DN.
 * @param white level, DN.
 */
internal class JoinedPositions(private val n: Int, private val black: DoubleArray, private val white: Double) {
    private val samples = arrayOfNulls<PatchSample>(4 * n)
    private val gains = DoubleArray(4 * n)

    fun put(patch: Int, position: Int, sample: PatchSample, gain: Double) {
        samples[4 * patch + position] = sample
        gains[4 * patch + position] = gain
    }

    private fun sample(i: Int): PatchSample = samples[i]!!

    private fun mean(i: Int): Double {
        val plain = sample(i).mean
        return if (gains[i] != 1.0) black[i % 4] + gains[i] * (plain - black[i % 4]) else plain
    }

    private fun gradient(i: Int): Double {
        val least = Rules.shipped.number("patches.least_signal") * (white - black[i % 4])
        return sample(i).change / max(abs(sample(i).mean - black[i % 4]), least)
    }

    private fun error(i: Int): Double = gains[i] * sample(i).error

    private fun colours(of: (Int) -> Double, green: (Double, Double) -> Double): DoubleArray = DoubleArray(3 * n) {
        val patch = 4 * (it / 3)
        when (it % 3) {
            0 -> of(patch)
            1 -> green(of(patch + 1), of(patch + 2))
            else -> of(patch + 3)
        }
    }

    private fun average(of: (Int) -> Double): DoubleArray = colours(of) { a, b -> (a + b) / 2 }

    private fun total(of: (PatchSample) -> Int): DoubleArray =
        colours({ of(sample(it)).toDouble() }) { a, b -> a + b }

    fun means(): FrameMeans {
        val all = total { it.all }
        fun share(of: (PatchSample) -> Int) = total(of).also { for (i in it.indices) it[i] /= all[i] }
        val count = total { it.count }
        return FrameMeans(
            average(::mean),
            colours(::error) { a, b -> sqrt(a * a + b * b) / 2 },
            LongArray(3 * n) { count[it].toLong() },
            share { it.clipped },
            share { it.rejected },
            average(::gradient),
            DoubleArray(2 * n) { mean(4 * (it / 2) + 1 + it % 2) },
        )
    }
}
