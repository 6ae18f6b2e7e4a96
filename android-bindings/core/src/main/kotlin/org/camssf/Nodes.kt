package org.camssf

/** The 69 nodes, 5 nm apart, between which surfaces and bases are linear. */
internal object Nodes {
    const val SIZE = 69
    private const val EACH = 10

    /** Applies the adjoint of [straight], 681 → 69: Σ f s over the grid equals Σ fold(f) s over the nodes. */
    fun fold(values: DoubleArray): DoubleArray {
        val found = DoubleArray(SIZE)
        for (m in values.indices) {
            val share = (m % EACH) / EACH.toDouble()
            found[m / EACH] += (1 - share) * values[m]
            if (share > 0) found[m / EACH + 1] += share * values[m]
        }
        return found
    }

    /** Interpolates linearly from the nodes (69) to the grid (681). */
    inline fun straight(node: (Int) -> Double): DoubleArray = DoubleArray(Grid.SIZE) { m ->
        val share = (m % EACH) / EACH.toDouble()
        val left = node(m / EACH)
        if (share > 0) (1 - share) * left + share * node(m / EACH + 1) else left
    }
}
