package org.camssf

import org.camssf.fit.GainModes
import org.camssf.photo.MeasuredCapture
import org.camssf.photo.PatchMask
import org.camssf.photo.PatchTable
import org.camssf.photo.Signals
import org.camssf.recovery.AnyLight
import org.camssf.recovery.Choice
import org.camssf.recovery.Engine
import org.camssf.recovery.Frames
import org.camssf.recovery.Gains
import org.camssf.recovery.Known
import org.camssf.recovery.LampGuess
import org.camssf.recovery.Observation
import org.camssf.recovery.OnnxEngine
import org.camssf.recovery.Penalties
import org.camssf.recovery.Problem
import org.camssf.recovery.RawWhite
import org.camssf.recovery.Recover
import org.camssf.recovery.Ssf
import org.camssf.recovery.Tensor
import org.camssf.recovery.lampModes
import org.camssf.recovery.predictSignals
import org.camssf.spectra.ChartTable
import org.camssf.spectra.Lamp
import kotlin.math.ln

/**
 * Fits curves to a capture and to parts of it: without some patches, with other lamps, or to one shot alone.
 *
 * @param engines the models to choose from, or the model of the named basis alone.
 * @param priorScale width of the prior relative to the learned one, for a single basis.
 */
internal class CaptureFit(
    private val engines: List<Engine>,
    private val capture: MeasuredCapture,
    private val signals: Signals,
    private val settings: CalibrationOptions,
    private val priorScale: Double = 1.0,
) {
    /** The chart's table, as faded as an answer found it. */
    val table: ChartTable = capture.chart
    private val n = table.patches.size
    private val k = capture.shots.size

    private val values = PatchTable(k, n, signals.sharedValues)

    /** Whether the basis is the paper's, which has no prior and no error of the chart. */
    val paper: Boolean = engines[0].basis == OnnxEngine.PAPER

    /** Prior odds by basis, from maker and model in the photo's metadata. */
    val priorOdds: Map<String, Double> = capture.shots[0].photo.let { Choice.priorOdds(it.make, it.model) }

    /** Gain modes of the light on the patches; none on the paper's basis. */
    val gains: Gains = if (paper) GainModes.none(capture) else GainModes.of(capture, settings.lightPerPatch)

    /** Whether the shots have white frames. */
    val framed: Boolean = capture.shots[0].means.white != null

    /** Each shot's lamp, as given. */
    val lamps: List<Lamp> = capture.shots.map { it.lamp }

    /**
     * ρ_w (681): reflectance of the white frame's target, or of the chart's own white patch without a white frame.
     */
    val white: DoubleArray

    /** One standard deviation of the relative error of [white], 1. */
    val whiteTolerance: Double

    init {
        val share = capture.whiteReflectance ?: 1.0
        white = if (framed) DoubleArray(Grid.SIZE) { share } else table.reflectance(table.white)
        whiteTolerance = if (framed) WHITE_TOLERANCE else table.sharedTolerance[table.white]
    }

    /**
     * This fit with the basis, prior width, kinds of light and chart that `ssf` found, for fits to parts of the
     * capture. If `ssf` was not chosen among hypotheses, it is this fit itself.
     */
    fun conditionedOn(ssf: Ssf): CaptureFit {
        if (ssf.choice.isEmpty()) return this
        val posed = (if (ssf.kinds.isEmpty()) this else under(ssf.kinds)).withChartOf(ssf)
        val engine = engines.filter { it.basis == ssf.basis }
        return CaptureFit(engine, posed.capture, signals, settings, ssf.priorScale)
    }

    /** This fit with the chart as faded as `ssf` found it. */
    fun withChartOf(ssf: Ssf): CaptureFit = if (ssf.chartFading == 0.0) this else of(table.faded(ssf.chartFading))

    private fun of(chart: ChartTable): CaptureFit {
        val other = capture.with(chart = chart)
        return CaptureFit(engines, other, signals, settings, priorScale)
    }

    /**
     * The table of the chart in the photo: this fit's own, unless the posterior odds of another public table of the
     * chart reach [Choice.CLEAR]. The evidence of each table is computed on the basis, the kinds of light and the
     * fading that `ssf` found; a basis without a prior has none.
     *
     * @param used the patches that entered the fit.
     */
    fun likeliestTable(ssf: Ssf, used: PatchMask): ChartTable {
        val others = if (paper) emptyList() else table.otherTables()
        if (others.isEmpty()) return table
        val posed = conditionedOn(ssf)
        fun evidence(of: ChartTable): Double =
            posed.of(of.faded(ssf.chartFading))
                .logEvidences(used, listOf(posed.lamps), emptySet(), posed.priorScale)[0]
        val own = evidence(table)
        val nats = others.map { evidence(it) }
        val best = nats.indices.maxByOrNull { nats[it] }!!
        val odds = nats[best] - own + ln(Rules.shipped.number("choice.other_table"))
        return if (odds >= ln(Choice.CLEAR)) others[best] else table
    }

    /** 1 - ĥ (k, n): the factor that corrects the signals to even light, by the gains of `ssf`. */
    fun level(ssf: Ssf): DoubleArray = GainModes.level(gains, ssf.sharedGainCode)

    /**
     * This fit with each light's possible lamps narrowed by the raw white and the file's colour matrices; on the paper's
     * basis, which weighs none, with the lamps as they were called.
     */
    fun withRawWhite(): CaptureFit {
        if (lamps.none { it.uncertain }) return this
        if (paper) return asSaid()
        val shots = capture.shots.mapIndexed { j, shot ->
            val raw = signals.rawWhite(j)
            if (!shot.lamp.uncertain || raw.any { it.isNaN() }) return@mapIndexed shot
            val matrices = shot.photo.colourMatrices.map { it.kelvin to it.sharedValues }
            shot.under(RawWhite.given(shot.lamp, raw, matrices, white))
        }
        val other = capture.with(shots)
        return CaptureFit(engines, other, signals, settings, priorScale)
    }

    /** The fit of shot j alone, as if its lamp had not been named. */
    fun unnamed(j: Int): CaptureFit {
        val own = capture.with(listOf(capture.shots[j].under(Lamp.auto())))
        return CaptureFit(engines, own, signals.only(j), settings, priorScale).withRawWhite()
    }

    private fun asSaid(): CaptureFit {
        val shots = capture.shots.map { if (it.lamp.unnamed) it else it.under(it.lamp.asSaid()) }
        return CaptureFit(engines, capture.with(shots), signals, settings, priorScale)
    }

    /** The fit of shot j alone. */
    private fun only(j: Int): CaptureFit {
        val own = capture.with(listOf(capture.shots[j]))
        return CaptureFit(engines, own, signals.only(j), settings, priorScale)
    }

    /** This fit with these kinds of light, one a shot; "" keeps the shot's lamp. */
    fun under(kinds: List<String>): CaptureFit = CaptureFit(engines, ofKinds(kinds), signals, settings, priorScale)

    private fun ofKinds(kinds: List<String>): MeasuredCapture {
        val shots = capture.shots.mapIndexed { j, shot -> shot.under(light(shot.lamp, kinds[j])) }
        return capture.with(shots)
    }

    private fun light(lamp: Lamp, kind: String): Lamp = lamp.lamps.firstOrNull { it.name == kind } ?: lamp

    /**
     * The curves from the `used` patches; the result predicts all n patches.
     *
     * @param gamma (1) or (3) the l1 penalty; null takes that of the settings or of the basis.
     * @param onRun called before each run of a model if a light is unnamed, because there are many runs.
     * @throws InvalidArgument too many shots have an unnamed light, or the basis cannot estimate one.
     * @throws LampUnfit a lamp without power on the grid.
     * @throws NotConverged the duality gap is too large.
     */
    fun curves(used: PatchMask, gamma: DoubleArray?, onRun: () -> Unit = {}): Ssf {
        val shown = frames(used.selected)
        val penalties = Penalties(settings.l2, gamma, settings.nonnegative)
        if (lamps.any { it.uncertain }) {
            return AnyLight(families(), shown, penalties, onRun)
                .recover(guesses(used, onRun), table.sharedValues)
        }
        val observation = observations(used, listOf(lamps))[0]
        val answer = engines.singleOrNull()?.let { Recover.recover(it, observation, shown, penalties, priorScale) }
            ?: Choice.recover(engines, observation, shown, penalties, priorOdds)
        return predicting(answer, withChartOf(answer).table)
    }

    /** The answer with its predictions of all patches of a chart. */
    private fun predicting(answer: Ssf, table: ChartTable): Ssf =
        answer.predicting(predictSignals(answer.sharedValues, table.sharedValues, answer.sharedLamp, white))

    private fun families(): List<Choice.Family> =
        engines.singleOrNull()?.let { listOf(Choice.Family(it, priorScale, 0.0)) }
            ?: Choice.families(engines, priorOdds)

    /** The combinations of the possible lamps of the shots. */
    private fun guesses(used: PatchMask, onRun: () -> Unit): List<LampGuess> {
        val unnamed = lamps.count { it.unnamed }
        if (unnamed > AnyLight.MOST) {
            throw InvalidArgument(
                "The light of $unnamed shots was not named; at most ${AnyLight.MOST} can be estimated at once.",
                "Name the lamp of the others, at least its kind: daylight, bulb, white-led or fluorescent.",
            )
        }
        val uncertain = lamps.count { it.uncertain }
        return guesses(used, AnyLight.combined(lamps.indices.map { kinds(used, it, uncertain, onRun) }))
    }

    /**
     * The lamps of shot j's light that are combined with those of the other shots, with their probabilities by the shot
     * alone; "" if it is certain.
     */
    private fun kinds(used: PatchMask, j: Int, uncertain: Int, onRun: () -> Unit): List<Pair<String, Double>> {
        if (!lamps[j].uncertain) return listOf("" to 1.0)
        val kinds = lamps[j].lamps.map { it.name }
        if (uncertain == 1) return kinds.map { it to 1.0 }
        val alone = only(j)
        val own = PatchMask(1, n) { _, i -> used[j, i] }
        return AnyLight.likelyKinds(alone.families(), alone.guesses(own, kinds.map { listOf(it) }), onRun)
    }

    private fun guesses(used: PatchMask, kinds: List<List<String>>): List<LampGuess> {
        val observations =
            observations(used, kinds.map { own -> lamps.mapIndexed { j, lamp -> light(lamp, own[j]) } })
        return kinds.mapIndexed { i, own ->
            val belief = lamps.indices.filter { lamps[it].uncertain }.sumOf { j ->
                lamps[j].logPrior[lamps[j].lamps.indexOfFirst { it.name == own[j] }]
            }
            LampGuess(own, observations[i], belief, own.any { Lamp.kindOf(it) == null })
        }
    }

    /**
     * ln of the marginal likelihood of the `used` patches under each of several sets of lamps, one lamp a shot, with
     * each basis's prior `scale` times as wide. With several bases, of which only those named by `bases` count, it is
     * that of their mixture by prior odds, up to the ln of the sum of these odds.
     */
    fun logEvidences(used: PatchMask, lamps: List<List<Lamp>>, bases: Set<String>, scale: Double): DoubleArray {
        val given = observations(used, lamps)
        if (engines.size == 1) return Recover.logEvidences(engines[0], given, scale)
        val nats = engines.filter { it.basis in bases }.map { engine ->
            val odds = ln(priorOdds[Choice.MAKERS_OF[engine.basis]] ?: 1.0)
            Recover.logEvidences(engine, given, scale) to odds
        }
        return DoubleArray(lamps.size) { i -> Choice.logSum(nats.map { (own, odds) -> own[i] + odds }) }
    }

    /**
     * The model's bands of the signals, and its uncertainty budget, of answers to these patches; null without a prior.
     *
     * @param masks for each answer the patches that it came from.
     */
    fun explain(masks: List<PatchMask>, answers: List<Ssf>): List<Recover.Explained>? {
        if (answers[0].sharedStd == null) return null
        val known = known(IntArray(n) { it }, lamps)
        val problems = masks.zip(answers) { used, ssf ->
            val level = level(ssf)
            val predicted = PatchTable(k, n, ssf.sharedPredicted)
            // A masked signal is replaced by its prediction, in the uneven light of its shot.
            val shown = PatchTable(k, n) { j, i, c ->
                if (used[j, i]) values[j, i, c] else predicted[j, i, c] / level[j * n + i]
            }
            val observation = Observation(Tensor(shown.values, k, n, 3), Tensor(hiding(used).values, k, n, 3), known)
            Problem(engines.single(), observation, ssf.priorScale)
        }
        return Recover.explain(problems, answers)
    }

    /**
     * The uncertainty budget of an answer to these patches: that of [explain] where none is left out, else of a problem
     * of these patches alone, since a masked one would still weigh 1e-12; null without a prior.
     */
    fun budget(used: PatchMask, ssf: Ssf, explained: Recover.Explained?): Map<String, DoubleArray>? {
        if (explained == null || used.selected.size == n) return explained?.budget
        val problem = Problem(engines.single(), observations(used, listOf(lamps))[0], ssf.priorScale)
        return Recover.explain(listOf(problem), listOf(ssf)).single().budget
    }

    /**
     * [curves] from each of several masks of one capture. On a basis with a prior under named lamps all are solved
     * together: what a mask leaves out is masked.
     *
     * @param onRun called before each run of a model where there are several.
     */
    fun folds(masks: List<PatchMask>, gamma: DoubleArray, onRun: () -> Unit): List<Ssf> {
        if (paper || lamps.any { it.uncertain }) {
            return masks.map {
                onRun()
                curves(it, gamma, onRun)
            }
        }
        val selected = PatchMask(k, n) { j, i -> masks.any { it[j, i] } }.selected
        val known = known(selected, lamps)
        val signals = rows(values, selected)
        val problems = masks.map { used ->
            Problem(engines.single(), Observation(signals, rows(hiding(used), selected), known), priorScale)
        }
        return Recover.recover(problems, frames(selected), Penalties(settings.l2, gamma, settings.nonnegative))
            .map { predicting(it, table) }
    }

    /** The standard errors, of a masked signal [HIDDEN]. */
    private fun hiding(used: PatchMask): PatchTable {
        val errors = PatchTable(k, n, signals.sharedError)
        val hidden = HIDDEN
        return PatchTable(k, n) { j, i, c -> if (used[j, i]) errors[j, i, c] else hidden }
    }

    private fun rows(of: PatchTable, selected: IntArray) = Tensor(of.rows(selected), k, selected.size, 3)

    private fun frames(selected: IntArray): Frames {
        fun rows(of: DoubleArray) = rows(PatchTable(k, n, of), selected)
        return Frames(rows(signals.sharedChart), rows(signals.sharedWhite), rows(signals.sharedDark))
    }

    /** Observations of the same signals and the same chart under several sets of lamps. */
    private fun observations(used: PatchMask, lamps: List<List<Lamp>>): List<Observation> {
        val selected = used.selected
        val signals = rows(values, selected)
        val errors = rows(hiding(used), selected)
        val first = known(selected, lamps[0])
        return lamps.map { Observation(signals, errors, first.under(it)) }
    }

    /** What is known of some patches under these lamps. */
    private fun known(selected: IntArray, lamps: List<Lamp>): Known {
        val t = selected.size
        return Known(
            Tensor(selected.map { table.reflectance(it) }.flatten(), t, Grid.SIZE),
            Tensor(DoubleArray(t) { if (paper) 0.0 else table.sharedTolerance[selected[it]] }, t),
            Tensor(white, Grid.SIZE), whiteTolerance, power(lamps), tolerance(lamps), lampModes(lamps),
            gains.takeUnless { it.modes.values.isEmpty() }?.of(selected),
        )
    }

    private fun Known.under(lamps: List<Lamp>) = Known(
        reflectance, chartTolerance, whiteReflectance, whiteTolerance, power(lamps), tolerance(lamps),
        lampModes(lamps), gains,
    )

    private fun power(lamps: List<Lamp>) = Tensor(lamps.map { it.sharedValues }.flatten(), k, Grid.SIZE)

    private fun tolerance(lamps: List<Lamp>) = Tensor(DoubleArray(k) { lamps[it].tolerance }, k)

    private companion object {
        /** Standard error of a masked signal, too large for it to change a curve: the model has no mask input. */
        val HIDDEN get() = Rules.shipped.number("calibration.hidden")
        val WHITE_TOLERANCE get() = Rules.shipped.number("calibration.white_tolerance")
    }
}
