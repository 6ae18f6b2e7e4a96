package org.camssf

import org.camssf.curves.Ssf
import org.camssf.evidence.Light
import org.camssf.evidence.Rival
import org.camssf.spectra.Lamp

/** Other lamps in the place of those that were named: what rule 4 of the verdict weighs. */
internal object Rivals {
    /** Lamps by name, which every verdict asks for. */
    private val known = HashMap<String, Lamp>()

    fun lamp(name: String): Lamp = synchronized(known) { known.getOrPut(name) { Lamp.read(name) } }

    /**
     * How much better the same signals fit with other lamps, one shot at a time; none where the basis has no prior, or of
     * many shots. Where the signals choose the basis, every lamp has the same choice.
     *
     * @param fit as it was asked, not settled on the basis that gave the answer.
     * @param used (k, n) patches that entered it.
     * @param tell called before each run of the model.
     */
    fun of(fit: Fit, ssf: Ssf, used: BooleanArray, tell: () -> Unit): List<Rival> {
        if (ssf.sharedStd == null || fit.lamps.size > Light.MOST_RIVALLED) return emptyList()
        fun evidence(lamps: List<Lamp>): Double {
            tell()
            return fit.logEvidence(used, lamps, Light.NARROW * ssf.priorScale)
        }
        val named = evidence(fit.lamps)
        return fit.lamps.indices.flatMap { j ->
            Light.RIVALS.map { name ->
                val others = fit.lamps.toMutableList().also { it[j] = lamp(name) }
                Rival(j, name, evidence(others) - named)
            }
        }
    }
}
