"""Applies all rules to an answer and returns the verdict: accepted, doubtful or refused, with reasons.

Captures that cannot be solved at all were already refused by an earlier stage. RMSRE is not used: both of its sides
contain the same lamp, so it stays small when the lamp is wrong. docs/verdict.md states the rules for this package and
for Kotlin; data/rules.json holds the thresholds. `python -m benchmarks faults` counts what the
rules catch and what they miss.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from camssf.grid import Floats
from camssf.photo.find.search import agreement, plain_signals
from camssf.recovery.hypotheses import MAKER, MAKERS_OF
from camssf.recovery.sensitivity import Ssf
from camssf.recovery.unfamiliar_camera import code_length, longest_code
from camssf.rules import rules
from camssf.spectra import ChartTable
from camssf.spectra.lights import kind_of
from camssf.verdict.cause import BY_WHITE, NONE, blamed_shots, put_first
from camssf.verdict.exposure_and_noise import (
    exposure,
    few,
    samples,
)
from camssf.verdict.goodness_of_fit import (
    BLACK,
    FEWEST,
    GOODNESS_OF_FIT,
    Explanation,
    GoodnessOfFit,
    VerdictInputs,
    best_explanation,
    offset,
    shot_answer,
    strongest_explanation,
)
from camssf.verdict.lamp import (
    WHITE_BALANCE_MISMATCH,
    WHITE_BALANCE_MISMATCH_UNNAMED,
    Neutral,
    Rival,
    rival_lamp,
    white_balance_mismatch,
)
from camssf.verdict.processed import processed
from camssf.verdict.reasons import Checks, Fatal, Reason, Verdict, because

_NUMBER = rules().number
MISFIT_REFUSES = _NUMBER("verdict.misfit_refuses")
POOR_POSE, BAND_TOO_WIDE = _NUMBER("verdict.poor_pose"), _NUMBER("verdict.band_too_wide")
OTHER_MAKERS = _NUMBER("verdict.other_makers")
UNNAMED, UNNAMEABLE = _NUMBER("verdict.unnamed"), _NUMBER("verdict.unnameable")
FADING = _NUMBER("verdict.chart_fading")
BAND_RATIO, BAND_RATIO_TYPICAL = _NUMBER("verdict.band_ratio"), _NUMBER("verdict.band_ratio_typical")
UNIT_DRIFT, UNIT_DRIFT_UNNAMED = _NUMBER("verdict.unit_drift"), _NUMBER("verdict.unit_drift_unnamed")
PHONES = "phones"
"""The only cameras that are similar enough to each other to estimate an unnamed light."""


def judge(
    inputs: VerdictInputs,
    ssf: Ssf,
    *,
    rivals: Sequence[Rival] | Callable[[], Sequence[Rival]] = (),
    neutrals: Sequence[Sequence[Neutral]] = (),
    alone: Sequence[Ssf] = (),
    family: str | None = None,
    unnamed: Sequence[bool] = (),
    drift: float | None = None,
) -> Verdict:
    """Apply all rules to an answer.

    Args:
        inputs: the k shots.
        ssf: the answer, with its predictions (k, n, 3).
        rivals: other lamps, or a function that finds them; it is not called if the capture is already refused.
        neutrals: for each shot, the camera's white points from its file; empty if there are none.
        alone: for several shots, the answer to each alone, predictions (k, n, 3); not needed for one.
        family: the basis that the maker's name in the file suggests, if any.
        unnamed: for each shot, whether its light is unnamed; empty if all are named.
        drift: `drift_probability` of the new shots against those of a previous result; None if there is none.
    """
    signals, table, lamps, causes = inputs.signals, inputs.table, inputs.lamps, inputs.causes
    together = inputs.goodness_of_fit(ssf)
    answers = [shot_answer(answer, j) for j, answer in enumerate(alone or [ssf] * len(lamps))]
    by_shot = [inputs.goodness_of_fit_of_shot(j, answer) for j, answer in enumerate(answers)]
    checks = Checks()
    reasons = _unexplained(together, by_shot, table, checks)
    for j, means in enumerate(inputs.means):
        reasons += exposure(signals, j, means, checks)
        reasons += few(signals.used[j], j, means, checks)
        reasons += samples(means, signals.used[j], j, table, checks)
        reasons += processed(means, j, checks)
        reasons += _disagreeing(signals.values[j], j, table, answers[j], checks)
    limits = [WHITE_BALANCE_MISMATCH_UNNAMED if light else WHITE_BALANCE_MISMATCH for light in unnamed] or [
        WHITE_BALANCE_MISMATCH
    ] * len(lamps)
    whites = [
        white_balance_mismatch(lamp, neutrals[j] if neutrals else (), signals, j, answers[j], checks, limits[j])
        for j, lamp in enumerate(lamps)
    ]
    reasons += [reason for white in whites for reason in white]
    faded = _faded(ssf, checks)
    reasons += faded
    reasons += _band_too_wide(ssf, checks)
    reasons += _other_makers(ssf, family, checks)
    alone_in_unnamed = any(unnamed) and drift is None  # a previous result says what camera it is
    reasons += _unnamed(ssf, family, checks) if alone_in_unnamed else []
    reasons += _typical(ssf, checks) if alone_in_unnamed or (drift is None and _of_some_kind(ssf)) else []
    fatal = any(isinstance(reason, Fatal) for reason in reasons)
    tried: Sequence[Rival] = ()
    if not fatal or causes is not None:
        tried = rivals() if callable(rivals) else rivals
    if not fatal and (len(lamps) == 1 or not any(best_explanation(one) for one in by_shot)):
        reasons += rival_lamp(tried, lamps, [j for j, white in enumerate(whites) if white], checks)
    reasons += _unusual(ssf, unnamed, checks)
    reasons += [] if drift is None else _drifted(drift, any(unnamed) or bool(ssf.kinds), checks)
    if reasons and causes is not None:
        weighed = [
            causes(j, tried, (*(BY_WHITE if whites[j] else ()), *(["table"] if faded else [])))
            for j in blamed_shots(reasons, len(lamps))
            if int(signals.used[j].sum()) >= FEWEST
        ]
        if weighed:
            clearest = min(weighed, key=lambda each: each.probability[NONE])
            reasons = put_first(reasons, clearest, by_shot[clearest.shot], inputs)
    if any(isinstance(reason, Fatal) for reason in reasons):  # first those that refuse: the error is the first one's
        reasons.sort(key=lambda reason: not isinstance(reason, Fatal))
        return Verdict("refused", tuple(reasons), tuple(checks))
    return Verdict("doubtful" if reasons else "accepted", tuple(reasons), tuple(checks))


def _unexplained(
    together: GoodnessOfFit, by_shot: Sequence[GoodnessOfFit], table: ChartTable, checks: Checks
) -> list[Reason]:
    """Apply the thresholds of rules 2 and 3: report each shot's best explanation, or that there is none."""
    misfit_refuses = together.total > MISFIT_REFUSES * together.count
    over = together.total / together.count
    reasons = []
    for j, one in enumerate(by_shot):
        explanation = best_explanation(one)
        if explanation is not None:
            name, words = _reason_of(explanation, table)
            value, bound = over, None
            if not misfit_refuses:
                value, enough = explanation.gain, strongest_explanation(one)[1]
                bound = enough if value > enough else BLACK
            words["shot"] = j + 1
            reasons.append(because(name, value, words, fatal=misfit_refuses, threshold=bound))
        _note_explanations(one, j, checks)
    worst = max(one.z for one in by_shot)
    largest = max(together.z, worst)
    checks.note("goodness_of_fit", largest)
    checks.note("misfit_refuses", over)
    if not reasons and (misfit_refuses or largest > GOODNESS_OF_FIT):
        name = "contradiction" if len(by_shot) > 1 and worst <= GOODNESS_OF_FIT else "unexplained"
        value = over if misfit_refuses else largest
        reasons.append(because(name, value, {"size": float(np.sqrt(over))}, fatal=misfit_refuses))
    return reasons


def _note_explanations(one: GoodnessOfFit, j: int, checks: Checks) -> None:
    """Record the strongest explanation of shot j with its limit, and the offset, which has its own limit."""
    if not one.explanations:
        return
    strongest, enough = strongest_explanation(one)
    checks.note("explanation", strongest.gain, j, limit=enough)
    added = offset(one)
    if added is not None:
        checks.note("black", added.gain, j)


def _reason_of(explanation: Explanation, table: ChartTable) -> tuple[str, dict[str, str | float]]:
    """The reason's name for an explanation, and the values of its placeholders."""
    if explanation.kind == "patch":
        assert explanation.patch is not None
        return "patch", {"patch": table.patches[explanation.patch]}
    if explanation.kind == "veil":
        return "veil" if explanation.amount > 0 else "bright_dark", {"amount": abs(explanation.amount)}
    if explanation.kind == "black":
        return "black", {"amount": abs(explanation.amount)}
    return explanation.kind, {"exponent": 1 + explanation.amount} if explanation.kind == "tone" else {}


def _unusual(ssf: Ssf, unnamed: Sequence[bool], checks: Checks) -> list[Reason]:
    """Check rule 7: whether the camera is unlike those of its basis, by its code and by its lamp."""
    basis, test = ssf.basis, ssf.family_test
    length = code_length(ssf) if test is None else test.length
    if length is None:
        return []
    limit = longest_code(basis, named=not any(unnamed)) if test is None else test.longest
    checks.note("improbable_curves", length, limit=limit)
    words: dict[str, str | float] = {"size": length, "basis": basis}
    reasons = []
    if length > limit:
        reasons.append(because("improbable_curves", length, words, threshold=limit))
    if test is not None and test.lamp_residual is not None:
        checks.note("lamp_residual", test.lamp_residual, limit=test.largest)
        if test.lamp_residual > test.largest:
            reasons.append(because("lamp_residual", test.lamp_residual, words, threshold=test.largest))
    return reasons


def _faded(ssf: Ssf, checks: Checks) -> list[Reason]:
    """Check whether the signals were explained by a faded chart only; it is weighed if the family test fails."""
    amount = ssf.chart_fading
    if ssf.family_test is None or (ssf.family_test.passed and not amount):
        return []
    checks.note("chart_fading", amount)
    return [because("faded", amount, {"amount": amount})] if amount > FADING else []


def _other_makers(ssf: Ssf, family: str | None, checks: Checks) -> list[Reason]:
    """Check rule 7: whether the camera belongs to another family than those of its maker."""
    if not ssf.choice:
        return []
    other = 0.0
    if family is not None:
        other = sum(hypothesis.probability for hypothesis in ssf.choice if MAKERS_OF.get(hypothesis.basis) != family)
    checks.note("other_makers", other)
    if other <= OTHER_MAKERS:
        return []
    return [because("other_makers", other, {"basis": ssf.basis})]


def _unnamed(ssf: Ssf, family: str | None, checks: Checks) -> list[Reason]:
    """Check rule 8: an unnamed light can be estimated only if the signals say that the camera is a phone.

    For other cameras, the curves and the light cannot be separated well. The maker's name does not count: it may be
    missing, unknown, or wrong.
    """
    phone, other = (
        sum(weight.probability for weight in ssf.choice if (MAKERS_OF.get(weight.basis) == PHONES) == same)
        for same in (True, False)
    )
    if family is not None:  # its odds are in the probabilities
        other *= MAKER if family == PHONES else 1.0 / MAKER
    phone /= phone + other
    checks.note("unnamed", phone)
    if phone >= UNNAMED:
        return []
    return [because("unnamed", phone, {}, fatal=phone < UNNAMEABLE)]


def _of_some_kind(ssf: Ssf) -> bool:
    """Whether a light is likeliest some lamp of a kind: it was not named, or by its kind, or by a wrong name."""
    return any(kind_of(kind) is not None for kind in ssf.kinds)


def _typical(ssf: Ssf, checks: Checks) -> list[Reason]:
    """Check rule 8: whether a photo in unnamed light says more than what is known of any phone without it."""
    ratio = ssf.band_ratio
    if ratio is None or (ssf.family_test is not None and not ssf.family_test.passed):
        return []
    checks.note("band_ratio", ratio)
    if ratio <= BAND_RATIO:
        return []
    if ratio <= BAND_RATIO_TYPICAL:
        return [because("one_light", ratio, {"ratio": ratio, "limit": BAND_RATIO})]
    return [because("typical", ratio, {"ratio": ratio, "limit": BAND_RATIO_TYPICAL})]


def _drifted(drift: float, uncertain: bool, checks: Checks) -> list[Reason]:
    """Check rule 10: whether the unit has changed since its previous result."""
    limit = UNIT_DRIFT_UNNAMED if uncertain else UNIT_DRIFT
    checks.note("unit_drift", drift, limit=limit)
    return [because("drift", drift, {"probability": drift}, threshold=limit)] if drift > limit else []


def _disagreeing(values: Floats, j: int, table: ChartTable, answer: Ssf, checks: Checks) -> list[Reason]:
    """Check rule 9: the patches' colours against the chart's, for a simple camera model under the answer's lamp."""
    score = agreement(values, plain_signals(table, answer.lamp[0]))
    checks.note("poor_pose", score, j)
    return [because("pose", score, {"shot": j + 1, "score": score})] if score < POOR_POSE else []


def _band_too_wide(ssf: Ssf, checks: Checks) -> list[Reason]:
    """Check that the 95 % band is narrow enough to tell cameras apart; an unfamiliar camera is doubtful anyway."""
    if ssf.std is None or (ssf.family_test is not None and not ssf.family_test.passed):
        return []
    width = ssf.half_width
    assert width is not None
    checks.note("band_too_wide", width)
    return [because("band_too_wide", width, {"width": width})] if width > BAND_TOO_WIDE else []
