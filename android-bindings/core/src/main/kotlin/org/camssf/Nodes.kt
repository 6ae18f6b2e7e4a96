package org.camssf

/** The 5-nm nodes, between which surfaces and bases run straight. */
internal object Nodes {
    const val SIZE = 69
    private const val EACH = 10

    /** Onto the nodes (69) as the adjoint of [straight]: Σ f s over the grid is Σ fold(f) s over the nodes. */
    fun fold(values: DoubleArray): DoubleArray {
        val found = DoubleArray(SIZE)
        for (m in values.indices) {
            val share = (m % EACH) / EACH.toDouble()
            found[m / EACH] += (1 - share) * values[m]
            if (share > 0) found[m / EACH + 1] += share * values[m]
        }
        return found
    }

    /** On the grid what is known on the nodes. */
    inline fun straight(node: (Int) -> Double): DoubleArray = DoubleArray(Grid.SIZE) { m ->
        val share = (m % EACH) / EACH.toDouble()
        val left = node(m / EACH)
        if (share > 0) (1 - share) * left + share * node(m / EACH + 1) else left
    }
}
