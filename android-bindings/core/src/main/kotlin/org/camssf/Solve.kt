package org.camssf

import org.camssf.curves.Engine
import org.camssf.curves.Evidence
import org.camssf.curves.Frames
import org.camssf.curves.OnnxEngine
import org.camssf.curves.Penalties
import org.camssf.curves.Recover
import org.camssf.curves.Ssf
import org.camssf.curves.Tensor
import org.camssf.evidence.Case
import org.camssf.evidence.Foretold
import org.camssf.evidence.Judge
import org.camssf.evidence.Rival
import org.camssf.evidence.Scores
import org.camssf.evidence.Told
import org.camssf.evidence.Verdict
import org.camssf.photo.Assumption
import org.camssf.photo.LensShading
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.MeasuredShot
import org.camssf.photo.Signals
import org.camssf.photo.Tell
import org.camssf.spectra.Lamp
import org.camssf.spectra.flatten

/** Everything one calibration found; `unseen` (k, n, 3) is NaN where every fit had seen the patch. */
internal class Solution(
    val capture: MeasuredCapture,
    val signals: Signals,
    val ssf: Ssf,
    val unseen: DoubleArray,
    val scores: Scores,
    val verdict: Verdict,
    val assumptions: List<Assumption>,
    val alone: List<Double>?,
)

/** Measured patches → curves, scores and verdict, arranged as Python's `camssf.calibration.solve` does it. */
internal class Solve(
    private val engine: Engine,
    private val capture: MeasuredCapture,
    private val settings: Settings,
    private val tell: Tell,
) {
    private val table = capture.chart
    private val n = table.patches.size
    private val k = capture.shots.size
    private val lamps = capture.shots.map { it.lamp }
    private val paper = engine.basis == OnnxEngine.PAPER
    private val framed = capture.shots[0].means.white != null
    private val asked = asked()
    private val signals: Signals by lazy {
        val found = Signals.normalise(capture.shots.map { it.means }, table.patches, table.white)
        for (i in found.used.indices) found.used[i] = found.used[i] && asked[i % n]
        found
    }

    private var stage = "solving" to 0.9

    fun run(): Solution {
        val taken = taken(signals.used)
        if (taken.size < 3) {
            throw InvalidArgument(
                "only ${taken.size} patches are left for the fit.",
                "Name more patches to fit, or leave that out.",
            )
        }
        val gamma = settings.gamma?.let { doubleArrayOf(it) }
        val ssf = fit(signals.used, gamma)
        stage = "validating" to 0.95
        val unseen = DoubleArray(3 * k * n) { Double.NaN }
        val how = predictUnseen(ssf, unseen)
        val counts = BooleanArray(k * n) { i -> (0..2).all { unseen[3 * i + it].isFinite() } }
        val predicted = DoubleArray(unseen.size) { if (counts[it / 3]) unseen[it] else ssf.predicted[it] }
        val scores = Scores.of(signals, predicted, table, lamps, counts, how)
        val alone = capture.shots.indices.filter { k > 1 && ssf.std != null }.map { shot ->
            fit(BooleanArray(k * n) { signals.used[it] && it / n == shot }, gamma)
        }
        val (rho, tolerance) = whiteReference()
        val told = Told(signals, table, lamps, ssf, rho, tolerance)
        val foretold = capture.shots.map { shot ->
            shot.photo.neutrals.map { Foretold(lamp(it.light).values, it.white) }
        }
        stage = "judging" to 0.98
        val verdict = Judge.judge(Case(told, capture.shots, alone, rivals(ssf, gamma), foretold))
        val widths = alone.map { halfWidth(it) }.takeIf { ssf.std != null }
        return Solution(capture, signals, ssf, unseen, scores, verdict, signals.assumptions + assumptions(), widths)
    }

    /** How well the same signals fit with other lamps, one shot at a time: rule 4 of the verdict. */
    private fun rivals(ssf: Ssf, gamma: DoubleArray?): List<Rival> {
        if (ssf.std == null || k > Judge.MOST_RIVALLED) return emptyList()
        val (rho, tolerance) = whiteReference()
        return capture.shots.indices.flatMap { j ->
            Judge.RIVALS.mapNotNull { name ->
                val others = lamps.toMutableList().also { it[j] = lamp(name) }
                val answer = try {
                    fit(signals.used, gamma, others)
                } catch (_: LampUnfit) {
                    return@mapNotNull null // then it is no rival
                } catch (_: NotConverged) {
                    return@mapNotNull null
                }
                Rival(j, name, Told(signals, table, others, answer, rho, tolerance).surprise().weighted)
            }
        }
    }

    private fun asked(): BooleanArray {
        val numbers = settings.fit ?: return BooleanArray(n) { true }
        if (numbers.isEmpty() || numbers.any { it !in 1..n }) {
            throw InvalidArgument(
                "the patches of this chart are numbered 1 to $n; got ${numbers.take(30).joinToString()}.",
                "Write 7 to 18.",
            )
        }
        return BooleanArray(n) { it + 1 in numbers }
    }

    /** Patches that enter the fit of some shot. */
    private fun taken(used: BooleanArray): IntArray =
        (0 until n).filter { i -> (0 until k).any { used[it * n + i] } }.toIntArray()

    /** The curves of the used patches; they predict all of them. */
    private fun fit(used: BooleanArray, gamma: DoubleArray?, lamps: List<Lamp> = this.lamps): Ssf {
        tell(stage.first, stage.second) // a chance to cancel
        val taken = taken(used)
        val t = taken.size
        fun rows(values: DoubleArray) = Tensor(
            DoubleArray(3 * k * t) { at -> values[3 * (at / (3 * t) * n + taken[at / 3 % t]) + at % 3] },
            k,
            t,
            3,
        )
        val hidden = DoubleArray(3 * k * n) { if (used[it / 3]) signals.standardError[it] else HIDDEN }
        val q = lamps.maxOf { it.modes.size }
        val modes = DoubleArray(k * q * Grid.SIZE)
        for ((j, lamp) in lamps.withIndex()) {
            lamp.modes.forEachIndexed { i, mode -> mode.copyInto(modes, (j * q + i) * Grid.SIZE) }
        }
        val (rho, whiteTolerance) = whiteReference()
        val evidence = Evidence(
            rows(signals.values),
            rows(hidden),
            Tensor(taken.map { table.reflectance(it) }.flatten(), t, Grid.SIZE),
            // The paper knows of no error in the chart.
            Tensor(DoubleArray(t) { if (paper) 0.0 else table.tolerance[taken[it]] }, t),
            Tensor(rho, Grid.SIZE),
            whiteTolerance,
            Tensor(lamps.map { it.values }.flatten(), k, Grid.SIZE),
            Tensor(DoubleArray(k) { lamps[it].tolerance }, k),
            Tensor(modes, k, q, Grid.SIZE),
        )
        val frames = Frames(rows(signals.chart), rows(signals.white), rows(signals.dark))
        val found = Recover.recover(engine, evidence, frames, Penalties(settings.l2, gamma, settings.nonnegative))
        return found.predicting(predict(found, rho))
    }

    /** Signals (k, n, 3) of all patches. */
    private fun predict(ssf: Ssf, rho: DoubleArray): DoubleArray {
        val predicted = DoubleArray(3 * k * n)
        for (j in 0 until k) {
            for (c in 0..2) {
                val seen = DoubleArray(Grid.SIZE) { ssf.lamp[j * Grid.SIZE + it] * ssf.values[3 * it + c] }
                val white = (0 until Grid.SIZE).sumOf { rho[it] * seen[it] }
                for (i in 0 until n) {
                    val from = i * Grid.SIZE
                    predicted[3 * (j * n + i) + c] =
                        (0 until Grid.SIZE).sumOf { table.values[from + it] * seen[it] } / white
                }
            }
        }
        return predicted
    }

    /** ρ_w (681) and its tolerance: the white frame's card, or the chart's own white patch. */
    private fun whiteReference(): Pair<DoubleArray, Double> {
        if (!framed) return table.reflectance(table.white) to table.tolerance[table.white]
        val share = capture.whiteReflectance ?: 1.0
        return DoubleArray(Grid.SIZE) { share } to WHITE_TOLERANCE
    }

    /** Fills in predictions of fits that had not seen the patch; says how that was done. */
    private fun predictUnseen(ssf: Ssf, unseen: DoubleArray): String {
        // The white patch's signal is 1 whatever the curves, where it stood in for the white frame.
        val rest = (0 until n).filter { !asked[it] && (framed || it != table.white) }
        if (rest.isNotEmpty()) {
            for (j in 0 until k) {
                for (i in rest) {
                    val from = 3 * (j * n + i)
                    ssf.predicted.copyInto(unseen, from, from, from + 3)
                }
            }
            return "${rest.size} patches that did not enter the fit"
        }
        val taken = taken(signals.used)
        for (fold in 0 until FOLDS) {
            val out = taken.filterIndexed { at, _ -> at % FOLDS == fold }
            val without = fit(BooleanArray(k * n) { signals.used[it] && it % n !in out }, ssf.gamma)
            for (j in 0 until k) {
                for (i in out.filter { signals.used[j * n + it] }) {
                    val from = 3 * (j * n + i)
                    without.predicted.copyInto(unseen, from, from, from + 3)
                }
            }
        }
        return "each of ${taken.size} patches, by a fit that left its quarter of the chart out"
    }

    /** What the answer takes for granted beyond the fallbacks of Eq. (5). */
    private fun assumptions(): List<Assumption> {
        val found = ArrayList<Assumption>()
        found += Assumption(
            "chart_table",
            "the chart's reflectances are ${table.source} (${table.table}), not this very chart's.",
        )
        for ((j, shot) in capture.shots.withIndex()) {
            val where = if (k > 1) "shot ${j + 1}: " else ""
            val lamp = shot.lamp
            found += Assumption(
                "lamp",
                "${where}the light was ${lamp.name} (${lamp.source}), smooth relative tolerance " +
                    "${percent(lamp.tolerance, 1)}, ${lamp.modes.size} mode(s).",
            )
            if (shot.photo.gainMap) found += Assumption("lens_shading", where + shading(shot))
        }
        if (framed && capture.whiteReflectance == null) {
            found += Assumption("white_reference", "the white frame shows a perfect diffuser (reflectance 1).")
        }
        if (paper) {
            found += Assumption(
                "no_band",
                "the paper's basis has no prior, so this answer carries no error band.",
            )
        }
        return found
    }

    private fun shading(shot: MeasuredShot): String {
        val map = "${shot.photo.name} holds a lens-shading map;"
        if (shot.lensShading == LensShading.APPLY) {
            val frames = if (shot.white !=
                null
            ) {
                " of every frame, so that it cancels against the white frame."
            } else {
                "."
            }
            return "$map it was applied to the patches' signals$frames"
        }
        val rest = if (shot.white !=
            null
        ) {
            ", the white frame corrects the shading."
        } else {
            " and no white frame corrects it."
        }
        return "$map it was not applied$rest"
    }

    companion object {
        /** All patches enter the fit; each is predicted by a fit that left its quarter of the chart out. */
        private const val FOLDS = 4

        /** Standard error of a signal that is used in another shot but not in this one: it then weighs nothing. */
        private const val HIDDEN = 1e3
        private const val WHITE_TOLERANCE = 0.01

        /** Lamps by name, which every verdict asks for. */
        private val known = HashMap<String, Lamp>()

        private fun lamp(name: String): Lamp = synchronized(known) { known.getOrPut(name) { Lamp.read(name) } }

        /** Mean half-width of the 95 % band, 400 to 700 nm, in parts of the peak. */
        fun halfWidth(ssf: Ssf): Double {
            val bands = List(3) { ssf.band(it) ?: return 0.0 }
            return (40..640).sumOf { m -> bands.sumOf { it[m] } } / (3 * 601)
        }
    }
}
