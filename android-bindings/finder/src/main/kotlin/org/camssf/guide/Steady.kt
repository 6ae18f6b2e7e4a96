package org.camssf.guide

/** Smooths one measure over time: the median of the latest frames, and with hysteresis whether it is bad. */
internal class Steady(private val limit: Limit) {
    private val last = DoubleArray(Limits.MEDIAN)
    private val sorted = DoubleArray(Limits.MEDIAN)
    private var count = 0

    /** True if advice is needed. */
    var bad = false
        private set

    /** Median of the latest frames that had a value; 0 if none had one. */
    var value = 0.0
        private set

    fun forget() {
        count = 0
        bad = false
        value = 0.0
    }

    /** Adds a frame's value; null, NaN and infinity change nothing. */
    fun take(found: Double?) {
        if (found == null || !found.isFinite()) return
        last[count++ % last.size] = found
        val held = minOf(count, last.size)
        System.arraycopy(last, 0, sorted, 0, held)
        sorted.sort(0, held)
        value = if (held % 2 == 1) sorted[held / 2] else (sorted[held / 2 - 1] + sorted[held / 2]) / 2
        bad = limit.bad(value, bad)
    }
}
