"""Runs all stages in order, from photos and lamps to a calibration or a refusal.

Each stage is imported when it runs, so that `from camssf import calibrate` is fast.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from camssf.errors import CalibrationError, InvalidArgument
from camssf.options import DEFAULTS, Options
from camssf.progress import Progress, part_of

if TYPE_CHECKING:
    from camssf.documents.previous import PreviousResult
    from camssf.photo.capture import Capture
    from camssf.photo.shot import Shots
    from camssf.result import Result
    from camssf.spectra import CameraLike, ChartLike, LightLike
    from camssf.verdict.reasons import Check, Reason

MEASURING, SOLVING = 0.35, 0.4
"""Parts of the time for progress: of a calibration for measuring, of the rest for solving before validation."""
PreviousLike: TypeAlias = "str | PathLike[str] | Result"
"""A previous result: its file, or the result itself."""
Product = TypeVar("Product")


def calibrate(
    shots: Shots,
    lamp: LightLike | None = None,
    *,
    chart: ChartLike = "classic24",
    options: Options = DEFAULTS,
    truth: CameraLike | None = None,
    previous: PreviousLike | None = None,
    progress: Progress | None = None,
) -> Result:
    """Recover a camera's spectral sensitivities from RAW photos; like `attempt`, but a refusal is raised.

    Args:
        shots: the path of one RAW photo, a `Shot`, or several, each under a lamp of its own.
        lamp: the light of one photo given by its path, as in `Shot`; "auto" (or None) if it is unknown.
        chart: as for `read_chart`: a name, a file, spectra as objects or arrays, a ChartTable.
        options: all other settings.
        truth: measured curves of this camera, as for `read_camera`, to compare with.
        previous: a stored result of this unit under a named lamp, or its file, to be solved together with the photos.
        progress: called with the stage's name and the part done, 0 to 1.

    Raises:
        CalibrationError: refused; `attempt` returns the refused result instead.
    """
    result = attempt(shots, lamp, chart=chart, options=options, truth=truth, previous=previous, progress=progress)
    if result.error is not None:
        raise result.error
    return result


def attempt(
    shots: Shots,
    lamp: LightLike | None = None,
    *,
    chart: ChartLike = "classic24",
    options: Options = DEFAULTS,
    truth: CameraLike | None = None,
    previous: PreviousLike | None = None,
    progress: Progress | None = None,
) -> Result:
    """Run `solve(measure(...))` and return the refused result if one of them refuses; arguments as in `calibrate`.

    Raises:
        InvalidArgument: the call itself is wrong.
    """
    from camssf.photo.capture import measure

    def stages() -> Result:
        begin, rest = part_of(progress, 0.0, MEASURING), part_of(progress, MEASURING, 1.0)
        capture = measure(shots, lamp, chart=chart, options=options, progress=begin)
        return solve(capture, options=options, truth=truth, previous=previous, progress=rest)

    return attempted(stages)


def attempted(stages: Callable[[], Product]) -> Product | Result:
    """Run the stages; if one of them refuses, return the refused result.

    Raises:
        InvalidArgument: the call itself is wrong.
    """
    try:
        return stages()
    except InvalidArgument:
        raise
    except CalibrationError as error:
        from camssf.result import refused

        return refused(error)


def solve(
    capture: Capture,
    *,
    options: Options = DEFAULTS,
    truth: CameraLike | None = None,
    previous: PreviousLike | None = None,
    progress: Progress | None = None,
) -> Result:
    """Compute curves, scores and verdict from measured patches.

    Args:
        capture: from `measure` or a document.
        options: those of solving.
        truth, previous, progress: as in `calibrate`.

    Raises:
        CalibrationError: a stage or the verdict refuses; its `capture` is this one.
        InvalidArgument: the capture was refused while it was measured.
    """
    from camssf.photo.capture import check_alike
    from camssf.spectra import read_camera

    tell = part_of(progress, 0.0, 1.0)
    tell("solving", 0.0)
    if capture.unfinished is not None or not capture.shots:
        raise InvalidArgument("The capture was refused before all its photos were measured.", "Measure it anew.")
    check_alike(capture.shots)
    known = None if truth is None else read_camera(truth)
    try:
        if previous is not None:
            result = _solve_with(read_previous(previous), capture, options, tell)
        else:
            result = _solve(capture, options, tell)
    except CalibrationError as error:
        error.capture = error.capture or capture
        raise
    tell("solved", 1.0)
    return result if known is None else result.with_truth(known)


def _solve(
    capture: Capture, options: Options, tell: Progress, new: int | None = None, left_out: int | None = None
) -> Result:
    """Compute curves, scores and verdict.

    If one patch is the likeliest cause of a misfit, the capture is solved without it; that answer is taken unless
    another patch is blamed in turn.

    Args:
        capture, options, tell: as in `solve`.
        new: number of new shots before those of a previous result.
        left_out: 0-based, the patch that is left out of the fit.
    """
    from camssf.documents.document import FORMAT, Answer, Curves, lower_triangle
    from camssf.fit.capture_fit import prepare_fit
    from camssf.fit.solutions import (
        cross_validate,
        likeliest_table,
        prediction_bands,
        recover_each_shot,
        recover_fit,
        score,
        uncertainty_budget,
    )
    from camssf.recovery.basis import basis_of
    from camssf.recovery.onnx_model import load_model
    from camssf.result import Result
    from camssf.verdict.assumptions import assume
    from camssf.verdict.cause import blamed_patch
    from camssf.verdict.reasons import refusal
    from camssf.verdict.rival_lamps import weigh
    from camssf.version import __version__

    tell("solving", 0.0)
    fit = prepare_fit(capture, options, left_out)
    signals = fit.signals
    ssf = recover_fit(fit, signals.used, options.gamma)
    table = likeliest_table(fit, ssf)
    if table is not capture.chart:
        return _solve(replace(capture, chart=table), options, tell, new, left_out)
    free_fit, fit = fit, fit.conditioned_on(ssf)
    tell("validating", SOLVING)
    predicted_std = prediction_bands(fit, signals.used, ssf)
    unseen = cross_validate(fit, ssf, predicted_std)
    scores = score(fit, ssf, unseen)
    alone = recover_each_shot(fit)
    uncertainty = uncertainty_budget(fit, ssf, alone)
    verdict = weigh(free_fit, ssf, alone, new)
    blamed = blamed_patch(verdict, capture.chart)
    if left_out is None and blamed is not None:
        with suppress(CalibrationError):
            rest = _solve(capture, options, tell, new, blamed)
            if blamed_patch(rest.verdict, capture.chart) is None:
                return rest
    if verdict.status == "refused":
        error = refusal(verdict)
        error.capture = capture
        raise error
    level = fit.level(ssf)
    curves, std = ssf.peak()
    answer = Answer(
        basis=ssf.basis,
        engine=ssf.engine,
        model=load_model(ssf.basis).sha256 if ssf.engine == "onnx" else None,
        basis_sha256=basis_of(fit.basis).sha256(),
        curves=Curves.of(curves),
        std=None if std is None else Curves.of(std),
        channel_gain=ssf.channel_gain,
        code_covariance=None if ssf.code_covariance is None else lower_triangle(ssf.code_covariance),
        evidence=ssf.log_evidence,
        prior_scale=ssf.prior_scale,
        chart_fading=ssf.chart_fading,
        choice=ssf.choice,
        gamma=ssf.gamma,
        l2=ssf.l2,
        proof=ssf.proof,
        used=tuple(tuple(row) for row in signals.used.tolist()),
        level=level,
        predicted=ssf.predicted,
        predicted_std=predicted_std,
        unseen=unseen.values,
        unseen_std=unseen.std,
        lights=ssf.lights,
        scores=scores,
        uncertainty=uncertainty,
    )
    return Result(
        format=FORMAT,
        version=__version__,
        capture=capture,
        answer=answer,
        verdict=verdict,
        assumptions=signals.assumptions + assume(capture, ssf, level, left_out),
        ssf=ssf,
    )


def read_previous(previous: PreviousLike) -> PreviousResult:
    """The previous result, from its file or as a result.

    Raises:
        InvalidArgument: the file cannot be read or is no result.
    """
    from camssf.documents.document import ADVICE, document_bytes, read_file
    from camssf.documents.forms import read
    from camssf.documents.previous import PreviousResult
    from camssf.result import Result

    if isinstance(previous, Result):
        return PreviousResult("(given)", hashlib.sha256(document_bytes(previous)).hexdigest(), previous)
    data = read_file(previous)
    result = read(data, Result, str(previous), ADVICE)
    return PreviousResult(Path(previous).name, hashlib.sha256(data).hexdigest(), result)


def _solve_with(previous: PreviousResult, capture: Capture, options: Options, tell: Progress) -> Result:
    """Solve together with the shots of a previous result; its own answer stays unless the common one is accepted.

    If all photos together contradict each other, the answer that stays is doubtful. If the common answer is doubtful
    for another reason, the new photos add nothing, and an assumption says why.

    Raises:
        InvalidArgument: options for which there is no previous result; else as `PreviousResult.joined`.
        CalibrationError: the new photos alone are refused.
    """
    from camssf.fit.capture_fit import prepare_fit
    from camssf.photo.signals import Assumption
    from camssf.verdict.reasons import reason_of
    from camssf.verdict.unit_drift import DRIFT, contradiction

    if options.light_per_patch is not None or prepare_fit(capture, options).exact:
        raise InvalidArgument(
            "A previous result cannot be used on a basis without a prior, or with `light_per_patch`.",
            "Leave one of the two out.",
        )
    capture = replace(capture, files=capture.files | {f"previous result: {previous.name}": previous.sha256})
    new, joint = len(capture.shots), previous.joined(capture)
    try:
        together = _solve(joint, options, part_of(tell, 0.0, 0.5), new)
    except InvalidArgument:
        raise
    except CalibrationError as error:
        checks, left_out = error.checks, reason_of(error)
    else:
        checks = together.verdict.checks
        if together.verdict.status == "accepted":
            used = Assumption(
                "previous_result",
                f"the shots after number {new} are those of {previous.name}: same unit, same chart.",
            )
            return replace(together, assumptions=(*together.assumptions, used))
        left_out = together.verdict.reasons[0]
    alone = _solve(capture, options, part_of(tell, 0.5, 1.0))
    why = contradiction(checks, alone.verdict.checks)
    return _kept(previous, capture, why, left_out, tuple(check for check in checks if check.name == DRIFT))


def _kept(
    previous: PreviousResult, new: Capture, why: Reason | None, left_out: Reason, drift: tuple[Check, ...]
) -> Result:
    """The previous result, with what was found about the new photos, which did not enter.

    Args:
        previous: the stored result.
        new: the new photos.
        why: the reason for which it is doubtful, if there is one.
        left_out: the first reason for which the new photos did not enter.
        drift: the checks of a drift.
    """
    from camssf.photo.signals import Assumption
    from camssf.result import Result
    from camssf.verdict.reasons import Verdict
    from camssf.verdict.unit_drift import DRIFT

    stored = previous.result
    assert isinstance(stored, Result)
    assert stored.verdict is not None
    assert stored.capture is not None
    photos = {f"not used: {shot.photo.name}, {shot.photo.sha256[:8]}": shot.photo.sha256 for shot in new.shots}
    names = ", ".join(f"shot {j}: {shot.photo.name}" for j, shot in enumerate(new.shots, 1))
    stays = Assumption(
        "previous_result",
        f"the answer is that of {previous.name}; the new photos ({names}) did not enter: {left_out.message}",
    )
    found = Verdict(
        "accepted" if why is None else "doubtful",
        () if why is None else (why,),
        (*(check for check in stored.verdict.checks if check.name != DRIFT), *drift),
    )
    source = {f"previous result: {previous.name}": previous.sha256}
    return replace(
        stored,
        capture=replace(stored.capture, files=stored.capture.files | source | photos),
        verdict=found,
        assumptions=(*stored.assumptions, stays),
        truth=None,
    )
