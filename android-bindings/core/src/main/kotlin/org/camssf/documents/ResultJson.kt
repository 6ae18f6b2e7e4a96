package org.camssf.documents

import org.camssf.Camssf
import org.camssf.flatten
import org.camssf.forms.Forms
import org.camssf.forms.Numbers
import org.camssf.photo.Assumption
import org.camssf.photo.CaptureForm
import org.camssf.photo.PartialCapture
import org.camssf.recovery.EstimatedLamp
import org.camssf.recovery.Ssf
import org.camssf.verdict.Verdict
import kotlin.math.roundToInt
import kotlin.math.sqrt

/** Writes results as documents, "camssf/2". It computes no results. */
internal object ResultJson {
    /**
     * Writes a result with curves.
     *
     * @param model SHA-256 of the model file.
     * @param basis SHA-256 of the basis.
     */
    fun of(solution: Solution, model: String, basis: String?): String {
        val answer = answer(solution, model, basis)
        return write(PartialCapture(solution.capture), solution.verdict, answer, solution.assumptions)
    }

    /** Writes a refused result. */
    fun of(partial: PartialCapture, verdict: Verdict): String = write(partial, verdict, null, emptyList())

    private fun write(
        capture: PartialCapture,
        verdict: Verdict,
        answer: Map<String, Any?>?,
        assumptions: List<Assumption>,
    ): String = Forms.write(
        Forms.plain(
            "Document",
            "format" to Forms.FORMAT,
            "version" to Camssf.VERSION,
            "capture" to CaptureForm.plain(capture),
            "answer" to answer,
            "verdict" to plain(verdict),
            "assumptions" to assumptions.map {
                Forms.plain("Assumption", "code" to it.code, "message" to it.message)
            },
        ),
    )

    private fun plain(verdict: Verdict) = Forms.plain(
        "Verdict",
        "status" to verdict.outcome.word,
        "reasons" to verdict.reasons.map {
            Forms.plain(
                "Reason", "code" to it.code, "message" to it.message, "advice" to it.advice, "value" to it.value,
                "threshold" to it.threshold, "key" to it.key, "arguments" to it.arguments,
            )
        },
        "checks" to verdict.checks.map {
            Forms.plain(
                "Check", "name" to it.name, "shot" to it.shot, "value" to it.value, "limit" to it.limit,
                "refuses" to it.refuses, "beyond" to it.beyond,
            )
        },
    )

    private fun answer(solution: Solution, model: String, basis: String?): Map<String, Any?> {
        val ssf = solution.ssf
        val predictions = solution.predictions
        val k = solution.capture.shots.size
        val n = solution.signals.patches
        fun rows(values: DoubleArray) = Numbers(values, k, n, 3)
        return Forms.plain(
            "Answer",
            "basis" to ssf.basis,
            "engine" to "onnx",
            "model" to model,
            "basis_sha256" to basis,
            "curves" to curves { ssf.curve(it) },
            "std" to if (ssf.sharedStd == null) null else curves { ssf.deviation(it)!! },
            "channel_gain" to ssf.sharedGain,
            "code_covariance" to ssf.sharedCodeCovariance?.let { triangle(it) },
            "evidence" to ssf.logEvidence,
            "prior_scale" to ssf.priorScale,
            "chart_fading" to ssf.chartFading,
            "choice" to choice(ssf),
            "gamma" to ssf.sharedGamma,
            "l2" to ssf.l2,
            "proof" to Forms.plain(
                "Proof", "gap" to ssf.sharedGap, "layers_gap" to ssf.sharedLayersGap,
                "finish_steps" to ssf.sharedFinishSteps,
            ),
            "used" to List(k) { j -> List(n) { solution.signals.sharedUsed[j * n + it] } },
            "level" to Numbers(predictions.level, k, n),
            "predicted" to rows(ssf.sharedPredicted),
            "predicted_std" to predictions.std?.let(::rows),
            "unseen" to rows(predictions.unseen),
            "unseen_std" to predictions.unseenStd?.let(::rows),
            "lights" to ssf.lights.map { light -> light?.let { plain(it) } },
            "scores" to Forms.plain(
                "Scores", "rmsre_percent" to solution.scores.sharedRmsre, "unseen" to solution.scores.unseen,
                "rmse" to null, "delta_e00" to solution.scores.deltaE00,
            ),
            "uncertainty" to solution.uncertainty?.let { plain(it) },
        )
    }

    private fun curves(channel: (Int) -> DoubleArray) =
        Forms.plain("Curves", "red" to channel(0), "green" to channel(1), "blue" to channel(2))

    private fun choice(ssf: Ssf) = ssf.choice.map {
        Forms.plain(
            "Hypothesis", "basis" to it.basis, "log_evidence" to it.logEvidence, "probability" to it.probability,
            "kinds" to it.kinds,
        )
    }

    private fun plain(light: EstimatedLamp) = Forms.plain(
        "EstimatedLamp", "kinds" to light.kinds, "power" to light.sharedPower, "std" to light.sharedStd,
        "kelvin" to light.kelvin, "kelvin_std" to light.kelvinStd,
    )

    private fun plain(known: Uncertainty) = Forms.plain(
        "Uncertainty",
        "half_width" to known.halfWidth,
        "half_width_without_photo" to known.halfWidthWithoutPhoto,
        "alone" to known.alone,
        "budget" to known.budget.map {
            Forms.plain("UncertaintySource", "source" to it.source, "size" to it.size, "share" to it.share)
        },
    )

    /** The lower triangle of a symmetric matrix, including its diagonal, row by row. */
    private fun triangle(matrix: DoubleArray): DoubleArray {
        val size = sqrt(matrix.size.toDouble()).roundToInt()
        return List(size) { matrix.copyOfRange(it * size, it * size + it + 1) }.flatten()
    }
}
