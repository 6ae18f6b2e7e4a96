package org.camssf.documents

import org.camssf.Reason
import org.camssf.Rows
import org.camssf.fit.Predictions
import org.camssf.fit.Scores
import org.camssf.fit.Uncertainty
import org.camssf.fit.UncertaintySource
import org.camssf.forms.Fields
import org.camssf.forms.Forms
import org.camssf.photo.Assumption
import org.camssf.photo.CaptureForm
import org.camssf.photo.PartialCapture
import org.camssf.recovery.EstimatedLamp
import org.camssf.recovery.Hypothesis
import org.camssf.verdict.Check
import org.camssf.verdict.Status
import org.camssf.verdict.Verdict

/** A result in a document, "camssf/2": the table of its parts (Python's types) beside Kotlin's classes. */
internal object ResultForm {
    /** @param answer null if the capture was refused. */
    fun write(
        capture: PartialCapture?,
        answer: Answer?,
        verdict: Verdict,
        assumptions: List<Assumption>,
        provenance: Provenance,
    ): String = Forms.write(
        Forms.plain(
            "Document", "format" to Forms.FORMAT, "version" to provenance.version,
            "capture" to capture?.let { CaptureForm.plain(it) }, "answer" to answer?.let { plain(it, provenance) },
            "verdict" to plain(verdict),
            "assumptions" to assumptions.map {
                Forms.plain("Assumption", "code" to it.code, "message" to it.message)
            },
        ),
    )

    private fun plain(verdict: Verdict) = Forms.plain(
        "Verdict", "status" to verdict.outcome.word,
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

    private fun plain(answer: Answer, provenance: Provenance): Map<String, Any?> {
        val predictions = answer.predictions
        val (shots, patches) = predictions.level.sides.asList()
        return Forms.plain(
            "Answer", "basis" to answer.basis.name, "engine" to provenance.engine, "model" to provenance.model,
            "basis_sha256" to provenance.basis, "curves" to plain(answer.curves.values),
            "std" to answer.curves.std?.let { plain(it) }, "channel_gain" to answer.curves.channelGain,
            "code_covariance" to answer.curves.codeCovariance, "evidence" to answer.basis.logEvidence,
            "prior_scale" to answer.basis.priorScale, "chart_fading" to answer.basis.chartFading,
            "choice" to answer.basis.hypotheses.map {
                Forms.plain(
                    "Hypothesis", "basis" to it.basis, "log_evidence" to it.logEvidence,
                    "probability" to it.probability, "kinds" to it.kinds,
                )
            },
            "gamma" to answer.convergence.gamma, "l2" to answer.convergence.l2,
            "proof" to Forms.plain(
                "Proof", "gap" to answer.convergence.gap, "layers_gap" to answer.convergence.layersGap,
                "finish_steps" to answer.convergence.finishSteps.toIntArray(),
            ),
            "used" to List(shots) { j -> List(patches) { predictions.isUsed(j, it) } }, "level" to predictions.level,
            "predicted" to predictions.values, "predicted_std" to predictions.std, "unseen" to predictions.unseen,
            "unseen_std" to predictions.unseenStd,
            "lights" to answer.lights.map { light ->
                light?.let {
                    Forms.plain(
                        "EstimatedLamp", "kinds" to it.kinds, "power" to it.sharedPower, "std" to it.sharedStd,
                        "kelvin" to it.kelvin, "kelvin_std" to it.kelvinStd,
                    )
                }
            },
            "scores" to Forms.plain(
                "Scores", "rmsre_percent" to answer.scores.sharedRmsre, "unseen" to answer.scores.unseen,
                "rmse" to answer.scores.rmse, "delta_e00" to answer.scores.deltaE00,
            ),
            "uncertainty" to answer.uncertainty?.let { plain(it) },
        )
    }

    private fun plain(curves: List<DoubleArray>) = Forms.plain("Curves", *COLOURS.zip(curves).toTypedArray())

    private fun plain(known: Uncertainty) = Forms.plain(
        "Uncertainty", "half_width" to known.halfWidth, "half_width_without_photo" to known.halfWidthWithoutPhoto,
        "alone" to known.alone,
        "budget" to known.budget.map {
            Forms.plain("UncertaintySource", "source" to it.source, "size" to it.size, "share" to it.sharedShare)
        },
    )

    // Reading

    fun verdict(part: Fields) = Verdict(
        Status.values().single { it.word == part.text("status") },
        part.list<Fields>("reasons").map {
            Reason(
                it.text("code"), it.text("message"), it.text("advice"), it.maybeNumber("value"),
                it.maybeNumber("threshold"), key = it.text("key"), arguments = it.map("arguments"),
            )
        },
        part.list<Fields>("checks").map {
            Check(
                it.text("name"), (it["shot"] as Long?)?.toInt(), it.number("value"), it.number("limit"),
                it.maybeNumber("refuses"), it.text("beyond"),
            )
        },
    )

    fun assumptions(parts: List<Fields>) = parts.map { Assumption(it.text("code"), it.text("message")) }

    fun provenance(version: String, answer: Fields?, capture: PartialCapture?) = Provenance(
        version, answer?.text("engine"), answer?.get("model") as String?, answer?.get("basis_sha256") as String?,
        capture?.files.orEmpty(),
    )

    fun answer(part: Fields): Answer {
        val proof = part.part("proof")
        fun rows(name: String) = part[name] as Rows
        return Answer(
            Curves(
                curves(part.part("curves")), part.maybe("std")?.let { curves(it) }, part.array("channel_gain"),
                (part["code_covariance"] as Rows?)?.values,
            ),
            BasisChoice(
                part.text("basis"), part.number("prior_scale"), part.number("chart_fading"),
                part.maybeNumber("evidence"),
                part.list<Fields>("choice").map {
                    Hypothesis(
                        it.text("basis"), it.number("log_evidence"), it.number("probability"), it.list("kinds"),
                    )
                },
            ),
            Convergence(
                proof["gap"] as Rows, proof["layers_gap"] as Rows, proof.array("finish_steps").map { it.toInt() },
                rows("gamma"), part.number("l2"),
            ),
            Predictions(
                part.list<List<Boolean>>("used").flatten().toBooleanArray(), rows("level"), rows("predicted"),
                part["predicted_std"] as Rows?, rows("unseen"), part["unseen_std"] as Rows?,
            ),
            part.list<Fields?>("lights").map { light -> light?.let { light(it) } },
            part.part("scores").let {
                Scores(
                    it.array("rmsre_percent"), it.number("delta_e00"), it.text("unseen"), rmse = it["rmse"] as Rows?,
                )
            },
            part.maybe("uncertainty")?.let { uncertainty(it) },
        )
    }

    private fun curves(part: Fields) = COLOURS.map { part.array(it) }

    private fun light(part: Fields) = EstimatedLamp(
        part.map("kinds"), part.array("power"), part.array("std"), part.number("kelvin"), part.number("kelvin_std"),
    )

    private fun uncertainty(part: Fields) = Uncertainty(
        part.number("half_width"), part.maybeNumber("half_width_without_photo"), part.list("alone"),
        part.list<Fields>("budget").map {
            UncertaintySource(it.text("source"), it.text("size"), it.array("share"))
        },
    )

    private val COLOURS = listOf("red", "green", "blue")
}
