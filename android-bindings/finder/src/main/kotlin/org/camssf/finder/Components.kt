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
    var count = LongArray(1024)
        private set
    var x = LongArray(1024)
        private set
    var y = LongArray(1024)
        private set
    var xx = LongArray(1024)
        private set
    var xy = LongArray(1024)
        private set
    var yy = LongArray(1024)
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
        count[me] = n
        x[me] = sx
        y[me] = row * n
        xx[me] = squares(end.toLong()) - squares(start - 1L)
        xy[me] = row * sx
        yy[me] = row * row * n
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
            if (root == i) continue
            count[root] += count[i]
            x[root] += x[i]
            y[root] += y[i]
            xx[root] += xx[i]
            xy[root] += xy[i]
            yy[root] += yy[i]
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
        val size = 2 * runs
        parent = parent.copyOf(size)
        first = first.copyOf(size)
        last = last.copyOf(size)
        count = count.copyOf(size)
        x = x.copyOf(size)
        y = y.copyOf(size)
        xx = xx.copyOf(size)
        xy = xy.copyOf(size)
        yy = yy.copyOf(size)
    }

    private companion object {
        /** 0² + 1² + … + k². */
        fun squares(k: Long): Long = k * (k + 1) * (2 * k + 1) / 6
    }
}
