package org.camssf.recovery

import org.camssf.Grid
import org.camssf.InvalidArgument
import org.camssf.LampUnfit
import org.camssf.NotConverged
import org.camssf.Refusal
import org.camssf.Rules
import org.camssf.spectra.faded
import kotlin.math.abs
import kotlin.math.exp
import kotlin.math.ln
import kotlin.math.max
import kotlin.math.roundToInt

/** Penalties and sign of a fit; null takes the default of the basis. */
internal class Penalties(val l2: Double?, val gamma: DoubleArray?, val nonnegative: Boolean?)

/** Chart, white and dark, (k, n, 3) DN each, behind the signals. */
internal class Frames(val chart: Tensor, val white: Tensor, val dark: Tensor)

/**
 * Gain modes φ (k, g, n) of the light on the patches, each of one standard deviation, and the size of each channel's
 * independent part relative to them. In even light the signals would be y (1 - Σ v φ).
 */
internal class Gains(val modes: Tensor, val own: Double) {
    /** Those of shot j. */
    fun only(j: Int): Gains {
        val (_, g, n) = modes.shape
        return Gains(Tensor(modes.values.copyOfRange(j * g * n, (j + 1) * g * n), 1, g, n), own)
    }

    /** Those of some patches. */
    fun of(patches: IntArray): Gains {
        val (k, g, n) = modes.shape
        val t = patches.size
        return Gains(Tensor(DoubleArray(k * g * t) { modes.values[it / t * n + patches[it % t]] }, k, g, t), own)
    }
}

/**
 * What is known besides the signals: reflectance (n, 681), chart tolerance (n), white reflectance (681) and its
 * tolerance, lamp (k, 681), its tolerance (k) and its modes (k, q, 681), and gain modes, null for none.
 */
internal class Known(
    val reflectance: Tensor,
    val chartTolerance: Tensor,
    val whiteReflectance: Tensor,
    val whiteTolerance: Double,
    val lamp: Tensor,
    val lampTolerance: Tensor,
    val lampModes: Tensor,
    val gains: Gains? = null,
) {
    /** Whether the lamps or the light on the patches have modes. */
    val hasModes: Boolean get() = listOfNotNull(lampModes, gains?.modes).any { modes ->
        modes.values.any { it != 0.0 }
    }

    /** The same with other tolerances (k) of the lamps. */
    fun withLampTolerance(tolerance: Tensor): Known =
        Known(reflectance, chartTolerance, whiteReflectance, whiteTolerance, lamp, tolerance, lampModes, gains)

    /** The same with a chart that has faded by `amount`; a white frame's flat target does not fade. */
    fun faded(amount: Double): Known {
        val (chart, white) = listOf(reflectance, whiteReflectance).map {
            Tensor(faded(it.values, amount), *it.shape)
        }
        return Known(chart, chartTolerance, white, whiteTolerance, lamp, lampTolerance, lampModes, gains)
    }
}

/** The input of a fit: signals (k, n, 3), their standard error, and what is known of chart, white and lamps. */
internal class Observation(val signals: Tensor, val standardError: Tensor, val known: Known) {
    /** The same with a chart that has faded by `amount`. */
    fun faded(amount: Double): Observation =
        if (amount == 0.0) this else Observation(signals, standardError, known.faded(amount))
}

/** What is solved: an observation on the basis of an engine, with the width of the prior relative to the learned one. */
internal class Problem(val engine: Engine, val observation: Observation, val priorScale: Double = 1.0)

/** Recovers curves from signals with the model, with the checks of the Python reference before and after it. */
internal object Recover {
    /**
     * Default penalty λ₂ on a learned basis: with [GAMMA], almost the Gaussian posterior mean, but a little sparser.
     */
    val L2 get() = Rules.shipped.number("calibration.l2")
    val GAMMA get() = Rules.shipped.number("calibration.gamma")

    /** Sources of the uncertainty budget, in the order of the model and of the result document. */
    val SOURCES = listOf("noise", "chart", "white", "lamp", "lamp modes", "uneven light", "unseen")

    private val STACKS = listOf(24, 12)
    private const val STACK = 7

    /** Largest number of hypotheses of k shots in one call: more would not fit into the cache. */
    fun stackOf(k: Int): Int = STACKS.getOrElse(k - 1) { STACK }

    /** Relative duality gap above which [NotConverged] is thrown. */
    val LARGEST_GAP get() = Rules.shipped.number("calibration.largest_gap")

    /** The curves that explain the signals: [recover] of one problem. */
    fun recover(
        engine: Engine,
        observation: Observation,
        frames: Frames?,
        penalties: Penalties,
        priorScale: Double = 1.0,
    ): Ssf = recover(listOf(Problem(engine, observation, priorScale)), frames, penalties)[0]

    /**
     * The curves that explain the signals of each of several problems on one capture. Those of learned bases that have
     * the width of the prior in common, and have modes or have not, are solved in one call.
     *
     * If no γ is given on the paper's basis, it is chosen by the discrepancy principle ([Discrepancy]).
     *
     * @param frames behind the signals, for the ratio between the channels; null: the ratios are ones.
     * @throws InvalidArgument invalid shapes or values; γ that differ by channel on a basis with a prior; a width other
     *   than 1 on the paper's basis.
     * @throws LampUnfit a lamp with negative power, or none, on the grid.
     * @throws NotConverged a relative duality gap above 1e-9, or curves without a response to white.
     */
    fun recover(problems: List<Problem>, frames: Frames?, penalties: Penalties): List<Ssf> {
        val shown = frames ?: bare(problems[0].observation.signals)
        for (problem in problems) {
            val y = problem.observation.signals
            check(problem)
            for (frame in listOf(shown.chart, shown.white, shown.dark)) fits("frames", frame, *y.shape)
            checkPenalties(weight(penalties, problem.engine.basis), penalties.gamma, problem.engine.basis)
        }
        val answers = HashMap<Problem, Ssf>()
        for (stack in problems.groupBy { it.stack() }.values) {
            if (stack[0].engine.basis == OnnxEngine.PAPER) {
                stack.associateWithTo(answers) { onPaper(it, shown, penalties) }
                continue
            }
            val l2 = weight(penalties, stack[0].engine.basis)
            val gamma =
                penalties.gamma?.let { own -> DoubleArray(3) { own[it % own.size] } } ?: DoubleArray(3) { GAMMA }
            val positive = penalties.nonnegative ?: false
            val outputs = stack[0].engine.run(stack.map { it.inputs(shown, l2, gamma[0], positive) })
            stack.zip(outputs).forEach { (problem, output) ->
                answers[problem] = answer(problem, output, Penalties(l2, gamma, positive))
            }
        }
        return problems.map { answers.getValue(it) }
    }

    private fun weight(penalties: Penalties, basis: String) =
        penalties.l2 ?: if (basis == OnnxEngine.PAPER) 0.0 else L2

    /** What the problems of one call have in common besides the capture. */
    private fun Problem.stack(): List<Any> =
        listOf(engine.basis == OnnxEngine.PAPER, priorScale, observation.known.hasModes)

    private fun Problem.inputs(frames: Frames, l2: Double, gamma: Double, nonnegative: Boolean) = ModelInputs(
        engine.basis, frames, observation.standardError, observation.known, l2, gamma, nonnegative, priorScale,
    )

    /** The answer on the paper's basis: the model takes one γ a call, so each different γ is a call of its own. */
    private fun onPaper(problem: Problem, frames: Frames, penalties: Penalties): Ssf {
        val positive = penalties.nonnegative ?: true
        val l2 = weight(penalties, problem.engine.basis)
        fun run(gamma: Double): ModelOutputs =
            problem.engine.run(listOf(problem.inputs(frames, l2, gamma, positive)))[0]
        val gamma = penalties.gamma?.let { own -> DoubleArray(3) { own[it % own.size] } }
            ?: Discrepancy(problem.observation, positive, ::run).gammas()
        checkPenalties(l2, gamma, problem.engine.basis)
        val outputs = gamma.distinct().associateWith { run(it) }
        val byChannel = ModelOutputs.byChannel(gamma.map { outputs.getValue(it) })
        return answer(problem, byChannel, Penalties(l2, gamma, positive))
    }

    private fun answer(problem: Problem, outputs: ModelOutputs, penalties: Penalties): Ssf {
        checkConverged(outputs["gap"])
        checkRespondsToWhite(outputs["ssf"])
        val answer = curves(outputs, penalties, problem.engine.basis, problem.priorScale)
        return if (problem.observation.known.gains == null) answer.gaining(DoubleArray(0)) else answer
    }

    /**
     * ln of the marginal likelihood of the signals, nats, up to a constant, under each hypothesis, on a basis with a
     * prior. It is a closed form: independent of the penalties, and without a convergence check.
     *
     * @param observations of one capture with one chart tolerance: they differ in reflectances, lamps and lamp modes.
     * @throws InvalidArgument invalid shapes or values.
     * @throws LampUnfit a lamp with negative power, or none, on the grid.
     */
    fun logEvidences(engine: Engine, observations: List<Observation>, priorScale: Double): DoubleArray {
        val problems = observations.map { Problem(engine, it, priorScale).also(::check) }
        val evidences = DoubleArray(problems.size)
        // The model expands all or none of its hypotheses about their modes.
        for (alike in problems.indices.groupBy { observations[it].known.hasModes }.values) {
            for (some in alike.chunked(stackOf(observations[0].signals.shape[0]))) {
                val nats = engine.logEvidences(some.map { plain(problems[it], false) })
                some.forEachIndexed { i, at -> evidences[at] = nats[i] }
            }
        }
        return evidences
    }

    /** [logEvidences] of one observation. */
    fun logEvidence(engine: Engine, observation: Observation, priorScale: Double): Double =
        logEvidences(engine, listOf(observation), priorScale)[0]

    /**
     * Posterior mean (k q) and covariance (k q, k q) of the lamp modes of each problem.
     *
     * @throws InvalidArgument invalid shapes or values.
     * @throws LampUnfit a lamp with negative power, or none, on the grid.
     */
    fun modes(problems: List<Problem>): List<Pair<DoubleArray, DoubleArray>> =
        plain(problems, explain = false).map { it["mode_estimate"] to it["mode_covariance"] }

    /**
     * What the model says besides the curves, on a basis with a prior.
     *
     * @property predictedStd (k, n, 3) one standard deviation of each true signal minus its prediction by the answer.
     * @property budget for each source the share (3) in the variance of each channel's curve of peak 1; the shares add
     *   up to 1.
     */
    class Explained(val predictedStd: DoubleArray, val budget: Map<String, DoubleArray>)

    /**
     * [Explained] of answers to observations of one capture.
     *
     * @param problems of the answers, with all n patches; a masked signal has its predicted value and a standard error
     *   too large to matter.
     * @throws InvalidArgument invalid shapes or values.
     * @throws LampUnfit a lamp with negative power, or none, on the grid.
     */
    fun explain(problems: List<Problem>, answers: List<Ssf>): List<Explained> =
        plain(problems, explain = true).mapIndexed { i, outputs ->
            val observation = problems[i].observation
            // The model divides by the white signal of its own curves; the answer may be a mixture, or have other penalties.
            val white = observation.known.whiteReflectance.values
            val model = whiteSignals(outputs["ssf"], outputs["lamp_estimate"], white)
            val answer = whiteSignals(answers[i].sharedValues, answers[i].sharedLamp, white)
            val n = observation.signals.shape[1]
            val std = outputs["predicted_std"]
            val shares = outputs["budget"]
            Explained(
                DoubleArray(std.size) {
                    val at = it / (3 * n) * 3 + it % 3
                    std[it] * model[at] / answer[at]
                },
                SOURCES.withIndex().associate { (at, source) -> source to shares.copyOfRange(3 * at, 3 * at + 3) },
            )
        }

    /** Outputs for the default penalties. */
    private fun plain(problems: List<Problem>, explain: Boolean): List<ModelOutputs> {
        problems.forEach(::check)
        val outputs = HashMap<Problem, ModelOutputs>()
        for (stack in problems.groupBy { it.stack() + it.observation.known.lampModes.shape[1] }.values) {
            outputs += stack.zip(stack[0].engine.run(stack.map { plain(it, explain) }))
        }
        return problems.map { outputs.getValue(it) }
    }

    private fun plain(problem: Problem, explain: Boolean): ModelInputs = ModelInputs(
        problem.engine.basis, bare(problem.observation.signals), problem.observation.standardError,
        problem.observation.known, L2, GAMMA, false, problem.priorScale, explain,
    )

    /** Frames with black level 0 and white 1. */
    private fun bare(y: Tensor) = Frames(y, Tensor.full(1.0, *y.shape), Tensor.full(0.0, *y.shape))

    private fun check(problem: Problem) {
        check(problem.observation, problem.engine.basis)
        checkScale(problem.priorScale, problem.engine.basis)
    }

    private fun checkScale(scale: Double, basis: String) {
        if (scale == 1.0 || (scale > 0 && scale.isFinite() && basis != OnnxEngine.PAPER)) return
        throw InvalidArgument(
            "a prior cannot be $scale times as wide on the $basis basis.",
            "Give a number above 0, and 1 on a basis without a prior.",
        )
    }

    private fun curves(found: ModelOutputs, penalties: Penalties, basis: String, priorScale: Double): Ssf {
        val prior = basis != OnnxEngine.PAPER
        val curves = Ssf.Curves(
            found["ssf"],
            found["ssf_std"].takeIf { prior },
            found["code"],
            found["code_covariance"].takeIf { prior },
            found["predicted"],
            found["lamp_estimate"],
            found["gain_code"],
        )
        val steps = found["finish_steps"]
        val proof = Ssf.Proof(
            found["gap"],
            found["layers_gap"],
            IntArray(steps.size) { steps[it].roundToInt() },
            found["evidence"][0].takeIf { prior },
        )
        val family = Ssf.Family(priorScale)
        return Ssf(curves, proof, found["channel_gain"], penalties.gamma!!, penalties.l2!!, basis, family)
    }

    private fun checkPenalties(l2: Double, gamma: DoubleArray?, basis: String) {
        if (gamma != null && gamma.size != 1 && gamma.size != 3) {
            throw InvalidArgument("gamma has ${gamma.size} values.", "Give one number, or one a channel.")
        }
        if (gamma != null && basis != OnnxEngine.PAPER && gamma.max() - gamma.min() > 0) {
            throw InvalidArgument(
                "`gamma` is ${gamma.toList()}, but on the $basis basis the three channels are one problem.",
                "Give one number.",
            )
        }
        val values = gamma ?: doubleArrayOf(1.0)
        if (!(l2 >= 0 && l2.isFinite() && values.all { it >= 0 && it.isFinite() })) {
            throw InvalidArgument(
                "the penalties l2 = $l2 and gamma = ${values.joinToString()} must be finite and not negative.",
                "Leave them out to take the defaults.",
            )
        }
        if (l2 == 0.0 && values.any { it == 0.0 }) {
            throw InvalidArgument(
                "gamma = 0 and l2 = 0 leave the problem without a unique answer.",
                "Give one of them a positive value, or leave them out to take the defaults.",
            )
        }
    }

    /** Throws unless every gap is a number of at most [LARGEST_GAP]. */
    private fun checkConverged(gap: DoubleArray) {
        if (gap.all { it <= LARGEST_GAP }) return
        val worst = gap.max()
        throw Refusal.of(
            "not_converged.gap", "gap" to worst, value = worst.takeIf { it.isFinite() }, threshold = LARGEST_GAP,
        )
    }

    /** Throws unless every curve responds to white. */
    private fun checkRespondsToWhite(ssf: DoubleArray) {
        for (c in 0..2) {
            val peak = (0 until Grid.SIZE).maxOf { ssf[3 * it + c] }
            if (!peak.isFinite() || peak <= 0) {
                throw Refusal.of("not_converged.no_response")
            }
        }
    }

    private fun check(observation: Observation, basis: String) {
        val y = observation.signals
        val known = observation.known
        if (y.rank != 3 || y.shape[2] != 3 || 0 in y.shape) {
            throw InvalidArgument("signals have shape $y; (k, n, 3) is needed.", "Give every shot the same patches.")
        }
        finite("signals", y)
        val (k, n) = y.shape
        fits("reflectance", known.reflectance, n, Grid.SIZE)
        val lamp = known.lamp
        fits("lamp", lamp, k, Grid.SIZE)
        for (j in 0 until k) {
            val power = lamp.values.copyOfRange(j * Grid.SIZE, (j + 1) * Grid.SIZE)
            if (power.any { it < 0 } || power.max() <= 0) {
                throw Refusal.of("lamp_unfit.unlit")
            }
        }
        fits("standard_error", observation.standardError, k, n, 3)
        val rho = known.whiteReflectance
        fits("white_reflectance", rho, Grid.SIZE)
        val seen = (0 until k).map { j ->
            (0 until Grid.SIZE).sumOf { rho.values[it] * lamp.values[j * Grid.SIZE + it] }
        }
        if (rho.values.any { it < 0 } || seen.any { !(it > 0) }) {
            throw InvalidArgument(
                "the white reference reflects nothing under the lamp.",
                "Give its reflectance on the grid, 0 to 1.",
            )
        }
        val modes = known.lampModes
        if (modes.rank != 3 || modes.shape[0] != k || modes.shape[2] != Grid.SIZE) {
            throw InvalidArgument(
                "lamp_modes have shape $modes; ($k, q, ${Grid.SIZE}) is needed.",
                "Give q modes a shot.",
            )
        }
        finite("lamp_modes", modes)
        known.gains?.let { gains(it, k, n) }
        tolerance("chart_tolerance", known.chartTolerance, n)
        tolerance("white_tolerance", Tensor(doubleArrayOf(known.whiteTolerance), 1), 1)
        tolerance("lamp_tolerance", known.lampTolerance, k)
        if (observation.standardError.values.any { it < 0 }) {
            throw InvalidArgument("a standard error is negative.", "Give standard errors ≥ 0.")
        }
        if (basis == OnnxEngine.PAPER && k > 1) {
            throw InvalidArgument(
                "the $basis basis takes one shot, not $k: each shot's exposure would be a further unknown.",
                "Give one photo, or take the basis cameras, whose rows are free of exposure.",
            )
        }
    }

    private fun gains(gains: Gains, k: Int, n: Int) {
        val modes = gains.modes
        if (modes.rank != 3 || modes.shape[0] != k || modes.shape[2] != n) {
            throw InvalidArgument("gain_modes have shape $modes; ($k, g, $n) is needed.", "Give g modes a shot.")
        }
        finite("gain_modes", modes)
        tolerance("gain_own", Tensor(doubleArrayOf(gains.own), 1), 1)
    }

    private fun fits(name: String, value: Tensor, vararg shape: Int) {
        if (!value.hasShape(*shape)) {
            throw InvalidArgument(
                "$name has shape $value; ${shape.joinToString(", ", "(", ")")} is needed.",
                "Put it on the 681-point grid, and give every shot the same patches.",
            )
        }
        finite(name, value)
    }

    private fun finite(name: String, value: Tensor) {
        if (!value.values.all { it.isFinite() }) {
            throw InvalidArgument("$name holds NaN or infinity.", "Leave out what could not be measured.")
        }
    }

    private fun tolerance(name: String, value: Tensor, size: Int) {
        fits(name, value, size)
        if (value.values.any { it < 0 }) {
            throw InvalidArgument("$name must not be negative.", "Write 3 % as 0.03.")
        }
    }
}
