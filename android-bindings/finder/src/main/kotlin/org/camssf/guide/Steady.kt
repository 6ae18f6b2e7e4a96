package org.camssf.guide

/** One measure over time: the median of the last frames, and whether it is bad, with hysteresis. */
internal class Steady(private val limit: Limit) {
    private val last = DoubleArray(Limits.MEDIAN)
    private val sorted = DoubleArray(Limits.MEDIAN)
    private var count = 0

    /** Whether advice is due. */
    var bad = false
        private set

    /** The median of the frames that had a value; 0 where none had. */
    var value = 0.0
        private set

    fun forget() {
        count = 0
        bad = false
        value = 0.0
    }

    /** Takes a frame's value; an unknown one leaves all as it is. */
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
