"""The only place where the stages meet: photos and lamps in, calibration or refusal out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from camssf.documents.result import Calibration, Refusal
from camssf.errors import CalibrationError, InvalidArgument
from camssf.evidence.assumptions import assume
from camssf.evidence.budget import budget
from camssf.evidence.problem import pose_problem
from camssf.evidence.reasons import refusal
from camssf.evidence.rivals import weigh
from camssf.evidence.unseen import foretell, score
from camssf.options import DEFAULTS, Options
from camssf.photo.capture import Capture, PathLike, Progress, Record, measure
from camssf.spectra import CameraLike, ChartLike, LightLike, read_camera

Product = TypeVar("Product")


def calibrate(
    photos: PathLike | Sequence[PathLike],
    lamps: LightLike | Sequence[LightLike] | None = None,
    *,
    white: PathLike | Sequence[PathLike | None] | None = None,
    dark: PathLike | Sequence[PathLike | None] | None = None,
    chart: ChartLike = "classic24",
    options: Options = DEFAULTS,
    truth: CameraLike | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """From RAW photos to the camera's spectral sensitivity: `attempt`, with a refusal raised.

    Args:
        photos: RAW file of each shot (`camssf.photo.raw.read_raw`).
        lamps: the light of each shot, as `read_lamp` takes it: a name, a file, a SpectralDistribution, a pair of
            arrays, a Lamp; "auto", or None for all shots, where nobody knows it: the signals then tell its kind, on
            phones.
        white, dark: RAW file of each shot's white and dark frame; None where there is none.
        chart: as `read_chart` takes it: a name, a file, spectra as objects or arrays, a ChartTable.
        options: all else that can be said.
        truth: measured curves of this camera, as `read_camera` takes them, to compare with.
        progress: called with a stage in words and the part done, 0 to 1.

    Raises:
        CalibrationError: refused; `attempt` gives the refusal with its document instead.
    """
    found = attempt(
        photos, lamps, white=white, dark=dark, chart=chart, options=options, truth=truth, progress=progress
    )
    if isinstance(found, Refusal):
        raise found.error
    return found


def attempt(
    photos: PathLike | Sequence[PathLike],
    lamps: LightLike | Sequence[LightLike] | None = None,
    *,
    white: PathLike | Sequence[PathLike | None] | None = None,
    dark: PathLike | Sequence[PathLike | None] | None = None,
    chart: ChartLike = "classic24",
    options: Options = DEFAULTS,
    truth: CameraLike | None = None,
    progress: Progress | None = None,
) -> Calibration | Refusal:
    """`solve(measure(...))`, or what is known where one of them refuses; arguments as in `calibrate`.

    Raises:
        InvalidArgument: the call itself is wrong.
    """

    def stages(record: Record) -> Calibration:
        capture = measure(
            photos, lamps, white=white, dark=dark, chart=chart, options=options, progress=progress, record=record
        )
        return solve(capture, options=options, truth=truth, progress=progress, record=record)

    return recorded(stages)


def recorded(stages: Callable[[Record], Product]) -> Product | Refusal:
    """What the stages give, or, where one of them refuses, why and what they wrote into the record until then.

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
    """From measured patches to curves, scores and verdict.

    Args:
        capture: of `measure` or of a patches document.
        options: those of solving.
        truth, progress: as in `calibrate`.
        record: told of the capture; stays behind when this raises.

    Raises:
        CalibrationError: a stage or the verdict refuses.
    """
    tell = progress or (lambda stage, part: None)
    if record is not None:
        record.note(capture)
    known = None if truth is None else read_camera(truth)
    tell("solving", 0.9)
    problem = pose_problem(capture, options)
    signals = problem.signals
    ssf = problem.solve(signals.used, options.gamma)
    asked, problem = problem, problem.settled(ssf)
    tell("validating", 0.95)
    predicted_std = problem.bands(signals.used, ssf)
    unseen = foretell(problem, ssf, predicted_std)
    scores = score(problem, ssf, unseen, known)
    alone = problem.solve_alone()
    uncertainty = budget(problem, ssf, alone)
    verdict = weigh(asked, ssf, alone)
    if verdict.status == "refused":
        raise refusal(verdict)
    level = problem.level(ssf)
    return Calibration(
        capture, signals, ssf, level, predicted_std, unseen.values, unseen.std, scores, verdict, known,
        signals.assumptions + assume(capture, ssf, level), uncertainty,
    )  # fmt: skip
