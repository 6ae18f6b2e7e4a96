package org.camssf

import org.camssf.recovery.Ssf
import org.camssf.spectra.Lamp
import org.camssf.verdict.Light
import org.camssf.verdict.Rival

/** Other lamps in the place of those that were named: what rule 4 of the verdict weighs. */
internal object Rivals {
    /** Lamps by name, which every verdict asks for. */
    private val known = HashMap<String, Lamp>()

    fun lamp(name: String): Lamp = synchronized(known) { known.getOrPut(name) { Lamp.read(name) } }

    /**
     * How much better the same signals fit with other lamps, one shot at a time; none where the basis has no prior, or of
     * many shots. Where the signals choose the basis, every lamp has the same choice. A light that nobody named has no
     * rivals: all kinds were weighed; beside it stands what the answer takes it for.
     *
     * @param fit as it was asked, not settled on the basis that gave the answer.
     * @param used (k, n) patches that entered it.
     * @param tell called before each run of the model.
     */
    fun of(fit: CaptureFit, ssf: Ssf, used: BooleanArray, tell: () -> Unit): List<Rival> {
        if (ssf.sharedStd == null || fit.lamps.size > Light.MOST_RIVALLED) return emptyList()
        fun observation(lamps: List<Lamp>): Double {
            tell()
            return fit.logEvidence(used, lamps, Light.NARROW * ssf.priorScale)
        }
        val named = fit.lamps.indices.filterNot { fit.lamps[it].unnamed }
        if (named.isEmpty()) return emptyList()
        val lamps = if (named.size < fit.lamps.size) fit.under(ssf.kinds).lamps else fit.lamps
        val given = observation(lamps)
        return named.flatMap { j ->
            Light.RIVALS.map { name ->
                val others = lamps.toMutableList().also { it[j] = lamp(name) }
                Rival(j, name, observation(others) - given)
            }
        }
    }
}
