"""Runs all stages in order, from photos and lamps to a calibration or a refusal."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TypeAlias, TypeVar

from camssf.documents.previous import PreviousResult
from camssf.documents.result_json import document_bytes, read_document
from camssf.errors import CalibrationError, InvalidArgument
from camssf.files import local
from camssf.fit.capture_fit import prepare_fit
from camssf.fit.chart_table import likeliest_table
from camssf.fit.cross_validation import cross_validate, score
from camssf.fit.solutions import prediction_bands, recover_each_shot, recover_fit
from camssf.fit.uncertainty import uncertainty_budget
from camssf.options import DEFAULTS, Options
from camssf.photo.capture import Capture, Progress, Record, measure
from camssf.photo.shot import Shots
from camssf.photo.signals import Assumption
from camssf.result import Calibration, Refusal, Result
from camssf.spectra import CameraCurves, CameraLike, ChartLike, LightLike, read_camera
from camssf.verdict.assumptions import assume
from camssf.verdict.reasons import Reason, Verdict, refusal
from camssf.verdict.rival_lamps import weigh
from camssf.verdict.unit_drift import DRIFT, contradiction

Product = TypeVar("Product")
PreviousLike: TypeAlias = str | PathLike[str] | Result
"""A previous result: its file, or the result itself."""


def calibrate(
    shots: Shots,
    lamp: LightLike | None = None,
    *,
    chart: ChartLike = "classic24",
    options: Options = DEFAULTS,
    truth: CameraLike | None = None,
    previous: PreviousLike | None = None,
    progress: Progress | None = None,
) -> Calibration:
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
        CalibrationError: refused; `attempt` returns the refusal with its document instead.
    """
    found = attempt(shots, lamp, chart=chart, options=options, truth=truth, previous=previous, progress=progress)
    if isinstance(found, Refusal):
        raise found.error
    return found


def attempt(
    shots: Shots,
    lamp: LightLike | None = None,
    *,
    chart: ChartLike = "classic24",
    options: Options = DEFAULTS,
    truth: CameraLike | None = None,
    previous: PreviousLike | None = None,
    progress: Progress | None = None,
) -> Calibration | Refusal:
    """Run `solve(measure(...))` and return a Refusal if one of them refuses; arguments as in `calibrate`.

    Raises:
        InvalidArgument: the call itself is wrong.
    """

    def stages(record: Record) -> Calibration:
        capture = measure(shots, lamp, chart=chart, options=options, progress=progress, record=record)
        return solve(capture, options=options, truth=truth, previous=previous, progress=progress, record=record)

    return recorded(stages)


def recorded(stages: Callable[[Record], Product]) -> Product | Refusal:
    """Run the stages; if one of them refuses, return a Refusal with the error and the record so far.

    Raises:
        InvalidArgument: the call itself is wrong.
    """
    record = Record()
    try:
        return stages(record)
    except InvalidArgument:
        raise
    except CalibrationError as error:
        return Refusal(error, record)


def solve(
    capture: Capture,
    *,
    options: Options = DEFAULTS,
    truth: CameraLike | None = None,
    previous: PreviousLike | None = None,
    progress: Progress | None = None,
    record: Record | None = None,
) -> Calibration:
    """Compute curves, scores and verdict from measured patches.

    Args:
        capture: from `measure` or a patches document.
        options: those of solving.
        truth, previous, progress: as in `calibrate`.
        record: receives the capture, so that the caller still has it if this raises.

    Raises:
        CalibrationError: a stage or the verdict refuses.
    """
    tell = progress or (lambda stage, part: None)
    if record is not None:
        record.note(capture)
    known = None if truth is None else read_camera(truth)
    if previous is not None:
        return _solve_with(read_previous(previous), capture, options, known, tell)
    return _solve(capture, options, known, tell, record=record)


def _solve(
    capture: Capture,
    options: Options,
    truth: CameraCurves | None,
    tell: Progress,
    new: int | None = None,
    record: Record | None = None,
) -> Calibration:
    """Compute curves, scores and verdict; `new` is the number of new shots before those of a previous result."""
    if record is not None:
        record.note(capture)
    tell("solving", 0.9)
    fit = prepare_fit(capture, options)
    signals = fit.signals
    ssf = recover_fit(fit, signals.used, options.gamma)
    table = likeliest_table(fit, ssf)
    if table is not capture.chart:
        return _solve(replace(capture, chart=table), options, truth, tell, new, record)
    free_fit, fit = fit, fit.conditioned_on(ssf)
    tell("validating", 0.95)
    predicted_std = prediction_bands(fit, signals.used, ssf)
    unseen = cross_validate(fit, ssf, predicted_std)
    scores = score(fit, ssf, unseen, truth)
    alone = recover_each_shot(fit)
    uncertainty = uncertainty_budget(fit, ssf, alone)
    verdict = weigh(free_fit, ssf, alone, new)
    if verdict.status == "refused":
        raise refusal(verdict)
    level = fit.level(ssf)
    return Calibration(
        capture=capture,
        signals=signals,
        ssf=ssf,
        level=level,
        predicted_std=predicted_std,
        unseen=unseen.values,
        unseen_std=unseen.std,
        scores=scores,
        verdict=verdict,
        truth=truth,
        assumptions=signals.assumptions + assume(capture, ssf, level),
        uncertainty=uncertainty,
    )


def read_previous(given: PreviousLike) -> PreviousResult:
    """The previous result, from its file or as a result.

    Raises:
        InvalidArgument: the file cannot be read or is no result.
    """
    if isinstance(given, Result):
        document = given.document()
        return PreviousResult("(given)", hashlib.sha256(document_bytes(document)).hexdigest(), document)
    document = read_document(Path(given))
    return PreviousResult(Path(given).name, hashlib.sha256(local(given).read_bytes()).hexdigest(), document)


def _solve_with(
    previous: PreviousResult, capture: Capture, options: Options, truth: CameraCurves | None, tell: Progress
) -> Calibration:
    """Solve together with the shots of a previous result; if they contradict the new ones, the new ones alone.

    Raises:
        InvalidArgument: options for which there is no previous result; else as `PreviousResult.joined`.
    """
    if options.light_per_patch is not None or prepare_fit(capture, options).exact:
        raise InvalidArgument(
            "A previous result cannot be used on a basis without a prior, or with `light_per_patch`.",
            "Leave one of the two out.",
        )
    capture = replace(capture, files=capture.files | {f"previous result: {previous.name}": previous.sha256})
    new, joint = len(capture.shots), previous.joined(capture)
    refused = None
    try:
        found = _solve(joint, options, truth, tell, new)
    except InvalidArgument:
        raise
    except CalibrationError as error:
        checks = error.checks
        refused = Reason(error.code, error.message, error.advice, error.value, error.threshold)
    else:
        checks = found.verdict.checks
        if contradiction(checks, ()) is None:
            used = Assumption(
                "previous_result",
                f"the shots after number {new} are those of {previous.name}: same unit, same chart.",
            )
            return replace(found, assumptions=(*found.assumptions, used))
    alone = _solve(capture, options, truth, tell)
    why = contradiction(checks, alone.verdict.checks) or refused
    if why is None:  # the new photos alone do not fit either, and their verdict says so
        return alone
    verdict = alone.verdict
    drift = tuple(check for check in checks if check.name == DRIFT)
    return replace(alone, verdict=Verdict("doubtful", (why, *verdict.reasons), (*verdict.checks, *drift)))
