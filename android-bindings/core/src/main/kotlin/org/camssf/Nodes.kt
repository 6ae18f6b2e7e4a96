package org.camssf

/** The 69 nodes, 5 nm apart, between which bases are linear. */
internal object Nodes {
    const val SIZE = 69
    private const val EACH = 10

    /** Interpolates linearly from the nodes (69) to the grid (681). */
    inline fun straight(node: (Int) -> Double): DoubleArray = DoubleArray(Grid.SIZE) { m ->
        val share = (m % EACH) / EACH.toDouble()
        val left = node(m / EACH)
        if (share > 0) (1 - share) * left + share * node(m / EACH + 1) else left
    }
}
