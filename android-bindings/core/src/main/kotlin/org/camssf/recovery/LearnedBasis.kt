package org.camssf.recovery

import org.camssf.Nodes

/**
 * A learned basis of camera curves on the grid.
 *
 * @property mean mean curves μ of R, G, B.
 * @property dictionary for each channel its r atoms (681).
 */
internal class LearnedBasis private constructor(
    val mean: Array<DoubleArray>,
    val dictionary: List<Array<DoubleArray>>,
) {
    val atoms: Int get() = dictionary[0].size

    companion object {
        private val made = HashMap<BasisConstants, LearnedBasis>()

        /** The bundled basis of this name and `basis_sha256`, cached; null if there is none. */
        fun of(name: String, sha256: String?): LearnedBasis? =
            BasisConstants.of(name)?.takeIf { it.roundedSha256 == sha256 }?.let { constants ->
                synchronized(made) { made.getOrPut(constants) { straight(constants) } }
            }

        private fun straight(nodes: BasisConstants): LearnedBasis {
            val r = nodes.atoms
            return LearnedBasis(
                Array(3) { c -> Nodes.straight { nodes.mean[c * Nodes.SIZE + it] } },
                List(3) { c ->
                    Array(r) { q -> Nodes.straight { nodes.dictionary[(c * Nodes.SIZE + it) * r + q] } }
                },
            )
        }
    }
}
