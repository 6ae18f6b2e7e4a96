"""Runs all stages in order, from photos and lamps to a calibration or a refusal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from camssf.errors import CalibrationError, InvalidArgument
from camssf.fit.capture_fit import prepare_fit
from camssf.fit.chart_table import likeliest_table
from camssf.fit.cross_validation import cross_validate, score
from camssf.fit.solutions import prediction_bands, recover_each_shot, recover_fit
from camssf.fit.uncertainty import uncertainty_budget
from camssf.options import DEFAULTS, Options
from camssf.photo.capture import Capture, Progress, Record, measure
from camssf.photo.shot import Shots
from camssf.result import Calibration, Refusal
from camssf.spectra import CameraLike, ChartLike, LightLike, read_camera
from camssf.verdict.assumptions import assume
from camssf.verdict.reasons import refusal
from camssf.verdict.rival_lamps import weigh

Product = TypeVar("Product")


def calibrate(
    shots: Shots,
    lamp: LightLike | None = None,
    *,
    chart: ChartLike = "classic24",
    options: Options = DEFAULTS,
    truth: CameraLike | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """Recover a camera's spectral sensitivities from RAW photos; like `attempt`, but a refusal is raised.

    Args:
        shots: the path of one RAW photo, a `Shot`, or several, each under a lamp of its own.
        lamp: the light of one photo given by its path, as in `Shot`; "auto" (or None) if it is unknown.
        chart: as for `read_chart`: a name, a file, spectra as objects or arrays, a ChartTable.
        options: all other settings.
        truth: measured curves of this camera, as for `read_camera`, to compare with.
        progress: called with the stage's name and the part done, 0 to 1.

    Raises:
        CalibrationError: refused; `attempt` returns the refusal with its document instead.
    """
    found = attempt(shots, lamp, chart=chart, options=options, truth=truth, progress=progress)
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
    progress: Progress | None = None,
) -> Calibration | Refusal:
    """Run `solve(measure(...))` and return a Refusal if one of them refuses; arguments as in `calibrate`.

    Raises:
        InvalidArgument: the call itself is wrong.
    """

    def stages(record: Record) -> Calibration:
        capture = measure(shots, lamp, chart=chart, options=options, progress=progress, record=record)
        return solve(capture, options=options, truth=truth, progress=progress, record=record)

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
    progress: Progress | None = None,
    record: Record | None = None,
) -> Calibration:
    """Compute curves, scores and verdict from measured patches.

    Args:
        capture: from `measure` or a patches document.
        options: those of solving.
        truth, progress: as in `calibrate`.
        record: receives the capture, so that the caller still has it if this raises.

    Raises:
        CalibrationError: a stage or the verdict refuses.
    """
    tell = progress or (lambda stage, part: None)
    if record is not None:
        record.note(capture)
    known = None if truth is None else read_camera(truth)
    tell("solving", 0.9)
    fit = prepare_fit(capture, options)
    signals = fit.signals
    ssf = recover_fit(fit, signals.used, options.gamma)
    table = likeliest_table(fit, ssf)
    if table is not capture.chart:
        other = replace(capture, chart=table)
        return solve(other, options=options, truth=truth, progress=progress, record=record)
    free_fit, fit = fit, fit.conditioned_on(ssf)
    tell("validating", 0.95)
    predicted_std = prediction_bands(fit, signals.used, ssf)
    unseen = cross_validate(fit, ssf, predicted_std)
    scores = score(fit, ssf, unseen, known)
    alone = recover_each_shot(fit)
    uncertainty = uncertainty_budget(fit, ssf, alone)
    verdict = weigh(free_fit, ssf, alone)
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
        truth=known,
        assumptions=signals.assumptions + assume(capture, ssf, level),
        uncertainty=uncertainty,
    )
