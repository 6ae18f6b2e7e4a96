package org.camssf

import org.camssf.photo.PatchMask
import org.camssf.recovery.Choice
import org.camssf.recovery.Recover
import org.camssf.recovery.Ssf
import org.camssf.spectra.Lamp
import org.camssf.verdict.Light
import org.camssf.verdict.Rival

/** Computes how well other lamps fit in place of the named ones (rule 4 of docs/verdict.md). */
internal object Rivals {
    /** Lamps by name, read once, because every verdict needs the same ones. */
    private val known = HashMap<String, Lamp>()

    fun lamp(name: String): Lamp = synchronized(known) { known.getOrPut(name) { Lamp.read(name) } }

    /**
     * Gain in ln marginal likelihood of other lamps, one shot at a time; empty on a basis without a prior, or with
     * more than [Light.MOST_SHOTS_COMPARED] shots.
     *
     * If the signals choose the basis, they choose between phones, cameras and the answer's basis again for every
     * lamp. An unnamed light has no rivals, because all its kinds were already compared, and one that was called by a
     * name none of its own kind. Such lights keep the lamp that the answer found.
     *
     * @param fit before it is conditioned on the answer.
     * @param used the patches that entered the fit.
     * @param new number of new shots; the lamps of a previous result, behind them, are not doubted again.
     * @param onRun called before each stack of lamps.
     */
    fun of(fit: CaptureFit, ssf: Ssf, used: PatchMask, new: Int = fit.lamps.size, onRun: () -> Unit): List<Rival> {
        if (ssf.sharedStd == null || fit.lamps.size > Light.MOST_SHOTS_COMPARED) return emptyList()
        val scale = if (ssf.priorScale == 1.0) Light.NARROW else 1.0 // the learned width if the wider one is likelier
        val bases = Choice.MAKERS_OF.values.toSet() + ssf.basis
        val named = (0 until new).filterNot { fit.lamps[it].unnamed }
        if (named.isEmpty()) return emptyList()
        val lamps = if (fit.lamps.any { it.uncertain }) fit.under(ssf.kinds).lamps else fit.lamps
        val rivals = named.flatMap { j ->
            val kind = fit.lamps[j].takeIf { it.uncertain }?.let { Lamp.plainKind(it.name) }
            Light.RIVALS.filter { kind == null || Lamp.plainKind(it) != kind }.map { j to it }
        }
        val others = rivals.map { (j, name) -> lamps.toMutableList().also { it[j] = lamp(name) } }
        val nats = (listOf(lamps) + others).chunked(Recover.stackOf(lamps.size)).flatMap { some ->
            onRun()
            fit.logEvidences(used, some, bases, scale).toList()
        }
        return rivals.mapIndexed { i, (j, name) -> Rival(j, name, nats[i + 1] - nats[0]) }
    }
}
