package org.camssf.photo

import kotlin.math.ln
import kotlin.math.max
import kotlin.math.sqrt

/** Correlation of measured patch colours with those that a chart table predicts. */
internal object Agreement {
    /** The rule `pose.chroma`, which a test holds to it: the first frame of a preview reads no rules, to save memory. */
    const val CHROMA: Double = 2.0

    /** The rule `pose.darkest`, likewise. */
    const val DARKEST: Double = 0.002

    /**
     * Correlation of patch colours with the table's prediction, -1 to 1, independent of colour cast and exposure.
     *
     * Each channel's mean over the patches is subtracted from ln c (a free gain per channel). The rest is split into
     * lightness, the mean over channels, and chroma, the difference from it; chroma counts double.
     *
     * @param measured (n, 3) DN above black; values below [DARKEST] of the largest are raised to that.
     * @param expected (n, 3) predicted signals, any scale.
     */
    fun of(measured: DoubleArray, expected: DoubleArray): Double {
        val x = features(measured)
        val y = features(expected)
        val size = sqrt(x.sumOf { it * it }) * sqrt(y.sumOf { it * it })
        return if (size > 0) x.indices.sumOf { x[it] * y[it] } / size else 0.0
    }

    /**
     * (n, 4) lightness and doubled chroma of ln c, each channel from its mean, of colours (n, 3); values below
     * [DARKEST] of the largest are raised to that.
     */
    fun features(colours: DoubleArray): DoubleArray {
        val least = max(DARKEST * colours.max(), 1e-12)
        val logs = DoubleArray(colours.size) { ln(max(colours[it], least)) }
        val n = logs.size / 3
        for (c in 0..2) {
            val middle = (0 until n).sumOf { logs[3 * it + c] } / n
            for (i in 0 until n) logs[3 * i + c] -= middle
        }
        return DoubleArray(4 * n) {
            val i = it / 4
            val lightness = (logs[3 * i] + logs[3 * i + 1] + logs[3 * i + 2]) / 3
            if (it % 4 == 0) lightness else CHROMA * (logs[3 * i + it % 4 - 1] - lightness)
        }
    }
}
