package org.camssf.recovery

import org.camssf.Grid
import org.camssf.Nodes
import kotlin.math.hypot
import kotlin.math.sqrt

/** The band of the curves of peak 1 before any photo. */
internal object PriorBand {
    private val known = HashMap<String, Double?>()

    /**
     * Mean half-width of the 95 % band about the mean curves of a basis, 400 to 700 nm, in parts of the peak; null for a
     * basis without a prior.
     *
     * An error d s changes the curve of peak 1, ŝ = s / s_p, by (d s - ŝ d s_p) / s_p, p where s peaks; s = μ + Ψ x, and
     * x is N(0, I). What every basis misses is added in squares.
     */
    fun halfWidth(basis: String): Double? = synchronized(known) { known.getOrPut(basis) { of(basis) } }

    private fun of(basis: String): Double? {
        val nodes = BasisConstants.of(basis) ?: return null
        val total = (0..2).sumOf { c ->
            val mean = Nodes.straight { nodes.mean[c * Nodes.SIZE + it] }
            val top = mean.indices.maxByOrNull { mean[it] }!!
            val atoms = List(nodes.atoms) { q ->
                Nodes.straight { nodes.dictionary[(c * Nodes.SIZE + it) * nodes.atoms + q] }
            }
            val missed = Nodes.straight { BasisConstants.misfit[c * Nodes.SIZE + it] }
            (FIRST..LAST).sumOf { m ->
                val own = atoms.sumOf { atom -> (atom[m] - mean[m] / mean[top] * atom[top]).let { it * it } }
                hypot(sqrt(own) / mean[top], missed[m])
            }
        }
        return BAND * total / (3 * (LAST - FIRST + 1))
    }

    /** 400 and 700 nm on [Grid]. */
    private const val FIRST = 40
    private const val LAST = 640
}
