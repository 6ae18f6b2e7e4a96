package org.camssf.finder

/**
 * Finds connected components (four neighbours) from the runs of pixels in each row, and sums their moments.
 *
 * All sums are whole numbers. The index of a component is that of its first run in reading order. Call [clear], then
 * [row] and [run] from top to bottom, then [each] once.
 */
internal class Components {
    private var runs = 0
    private var parent = IntArray(1024)
    private var first = IntArray(1024)
    private var last = IntArray(1024)

    /** (runs, 6) number of pixels, Σx, Σy, Σx², Σxy, Σy² of each run, and after [each] of each component. */
    var moments = LongArray(6 * 1024)
        private set
    private var row = 0L
    private var above = 0
    private var here = 0

    fun clear() {
        runs = 0
        above = 0
        here = 0
    }

    /** Begins a row: the runs that follow belong to it. */
    fun row(number: Int) {
        row = number.toLong()
        above = here
        here = runs
    }

    /** Adds a run of pixels from column `start` to `end`, both included; runs are added from left to right. */
    fun run(start: Int, end: Int) {
        if (runs == parent.size) grow()
        val me = runs++
        parent[me] = me
        first[me] = start
        last[me] = end
        val n = (end - start + 1).toLong()
        val sx = n * (start + end) / 2
        moments[6 * me] = n
        moments[6 * me + 1] = sx
        moments[6 * me + 2] = row * n
        moments[6 * me + 3] = squares(end.toLong()) - squares(start - 1L)
        moments[6 * me + 4] = row * sx
        moments[6 * me + 5] = row * row * n
        while (above < here && last[above] < start) above++
        var other = above
        while (other < here && first[other] <= end) join(other++, me)
    }

    /** Calls `take` with the index of every component, in the order of their first runs. */
    inline fun each(take: (Int) -> Unit) {
        for (i in 0 until gather()) if (isRoot(i)) take(i)
    }

    fun isRoot(i: Int): Boolean = parent[i] == i

    /** Adds the sums of every run to the first run of its component; returns the number of runs. */
    fun gather(): Int {
        for (i in 0 until runs) {
            val root = root(i)
            if (root != i) for (k in 0..5) moments[6 * root + k] += moments[6 * i + k]
        }
        return runs
    }

    private fun join(a: Int, b: Int) {
        val p = root(a)
        val q = root(b)
        if (p < q) parent[q] = p else parent[p] = q
    }

    private fun root(of: Int): Int {
        var i = of
        while (parent[i] != i) {
            parent[i] = parent[parent[i]]
            i = parent[i]
        }
        return i
    }

    private fun grow() {
        parent = parent.copyOf(2 * runs)
        first = first.copyOf(2 * runs)
        last = last.copyOf(2 * runs)
        moments = moments.copyOf(12 * runs)
    }

    private companion object {
        /** 0² + 1² + … + k². */
        fun squares(k: Long): Long = k * (k + 1) * (2 * k + 1) / 6
    }
}
