"""The one document of camssf, "camssf/2": a capture, and with an answer and a verdict a result."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import numpy as np

from camssf.documents import forms
from camssf.documents.forms import BrokenError
from camssf.errors import InvalidArgument
from camssf.files import error_in_words, local
from camssf.fit.scores import Scores
from camssf.fit.solutions import Uncertainty
from camssf.grid import CHANNELS, Floats
from camssf.photo.capture import Capture, Photo, check_alike, check_target
from camssf.photo.signals import Assumption
from camssf.recovery.sensitivity import ENGINES, EstimatedLamp, Hypothesis, Proof
from camssf.shapes import (
    Bounds,
    Levels,
    Number,
    Rgb,
    RgbSizes,
    Sha256,
    Share,
    ShotRowGaps,
    ShotRows,
    Size,
    Spectrum,
    Text,
    Vector,
    Words,
)
from camssf.spectra import Lamp
from camssf.spectra.sampled import check_wavelengths
from camssf.verdict.reasons import Verdict

FORMAT: Literal["camssf/2"] = "camssf/2"
ADVICE = "Give the result.json that `camssf calibrate` wrote, what `camssf patches` printed, or what a phone saved."

AnyDocument = TypeVar("AnyDocument", bound="Document")


@dataclass(frozen=True, eq=False)
class Curves:
    """Three curves on the grid, 380 to 720 nm every 0.5 nm.

    Attributes:
        red, green, blue: one channel.
    """

    red: Spectrum
    green: Spectrum
    blue: Spectrum

    @staticmethod
    def of(values: Floats) -> Curves:
        """The curves of an array (681, 3)."""
        return Curves(*np.array(values.T, dtype=np.float64))

    @cached_property
    def values(self) -> Floats:
        """(681, 3)."""
        return np.stack([self.red, self.green, self.blue], axis=1)


@dataclass(frozen=True, eq=False)
class Answer:
    """The recovered curves, how sure they are, and how they were found. k shots of n patches.

    Attributes:
        basis: name of the basis.
        engine: what solved it.
        model: SHA-256 of the ONNX model.
        basis_sha256: SHA-256 of the basis at the nodes, rounded to 12 decimals.
        curves: each channel's peak = 1.
        std: one standard deviation of the curves; missing on a basis without a prior.
        channel_gain: raw white signal of each channel relative to green.
        code_covariance: covariance of the code x, red's r numbers first, then green's, then blue's: its lower
            triangle row by row.
        evidence: ln of the marginal likelihood of the signals, up to a constant.
        prior_scale: width of the prior relative to the learned one.
        chart_fading: part of its colour that the chart has lost.
        choice: the compared hypotheses.
        gamma: the l1 penalty of each channel's problem.
        l2: the quadratic penalty.
        proof: how near the code is to the optimum.
        used: (k, n) the patches that the fit used.
        level: (k, n) correction for uneven light: signals times `level` are the estimated signals in even light.
        predicted: (k, n, 3) predicted signals.
        predicted_std: (k, n, 3) standard deviation of the true signals minus `predicted`.
        unseen: (k, n, 3) predictions by fits that did not use the patch; null where every fit used it.
        unseen_std: (k, n, 3) as `predicted_std`, of `unseen`.
        lights: of each shot the estimated light, null where the lamp was named; empty if all were.
        scores: quality of the answer.
        uncertainty: width of the band and its sources.
    """

    basis: Text
    engine: Annotated[str, Words(ENGINES)]
    curves: Curves
    channel_gain: Rgb
    gamma: RgbSizes
    l2: Size
    proof: Proof
    used: tuple[tuple[bool, ...], ...]
    level: Levels
    predicted: ShotRows
    unseen: ShotRowGaps
    scores: Scores
    model: Sha256 | None = None
    basis_sha256: Sha256 | None = None
    std: Curves | None = None
    code_covariance: Vector | None = None
    evidence: Number | None = None
    prior_scale: Size = 1.0
    chart_fading: Share = 0.0
    choice: tuple[Hypothesis, ...] = ()
    predicted_std: ShotRowGaps | None = None
    unseen_std: ShotRowGaps | None = None
    lights: tuple[EstimatedLamp | None, ...] = ()
    uncertainty: Uncertainty | None = None

    def __post_init__(self) -> None:
        for channel, peak in zip(CHANNELS, self.curves.values.max(axis=0), strict=True):
            if abs(peak - 1) > 1e-6:
                raise BrokenError(f"curves.{channel}", f"must have peak 1, has {peak:.6g}")
        if len(self.proof.layers_gap) not in (1, 3) or len(self.proof.finish_steps) != len(self.proof.layers_gap):
            raise BrokenError("proof", "must hold one number a problem, 1 or 3 of them")
        if self.std is not None and self.std.values.min() < 0:
            raise BrokenError("std", "must not be negative")
        if self.code_covariance is not None:
            _check_triangle(self.code_covariance)

    @property
    def covariance(self) -> Floats | None:
        """(3 r, 3 r) covariance of the code, from its stored triangle."""
        if self.code_covariance is None:
            return None
        size = _rows_of(self.code_covariance)
        square = np.zeros((size, size))
        square[np.tril_indices(size)] = self.code_covariance
        return square + np.tril(square, -1).T


def lower_triangle(covariance: Floats) -> Floats:
    """The lower triangle of a symmetric matrix, row after row, to halve its size without loss of digits."""
    return np.asarray(covariance[np.tril_indices(len(covariance))])


def _rows_of(triangle: Floats) -> int:
    """Rows of the matrix whose lower triangle this is."""
    return (math.isqrt(8 * len(triangle) + 1) - 1) // 2


def _check_triangle(triangle: Floats) -> None:
    size = _rows_of(triangle)
    if size * (size + 1) // 2 != len(triangle) or size % 3:
        what = f"must be the triangle of a matrix of 3 r rows, holds {len(triangle)}"
        raise BrokenError("code_covariance", what)
    for i in range(size):
        if triangle[i * (i + 3) // 2] < 0:
            raise BrokenError(f"code_covariance[{i * (i + 3) // 2}]", "must not be negative, it is a variance")


@dataclass(frozen=True, eq=False)
class Truth:
    """Measured curves of the camera to compare with.

    Attributes:
        name: of the camera.
        curves: each channel's peak = 1.
    """

    name: Text
    curves: Curves


@dataclass(frozen=True, kw_only=True, eq=False)
class Document:
    """A capture; with an answer and a verdict, a result.

    Attributes:
        format: name and version of this form.
        version: of the camssf that wrote it.
        capture: what was measured; missing if a calibration was refused before its chart was read.
        answer: the curves; missing when refused.
        verdict: the judgement; missing for a capture that was not solved.
        assumptions: fallbacks and choices on which the result relies.
        truth: measured curves to compare with.
        sha256: of the content (docs/formats.md); a document without it is taken unchecked.
    """

    format: Literal["camssf/2"]
    version: Text
    capture: Capture | None = None
    answer: Answer | None = None
    verdict: Verdict | None = None
    assumptions: Annotated[tuple[Assumption, ...], Bounds(0, 10_000)] = ()
    truth: Truth | None = None
    sha256: Sha256 | None = None

    def __post_init__(self) -> None:
        if self.capture is not None:
            check_capture(self.capture)
        elif self.verdict is None or self.answer is not None:
            raise BrokenError("", "lacks capture")
        status = None if self.verdict is None else self.verdict.status
        if (self.answer is None) != (status in (None, "refused")):
            verdict = "there is no verdict" if status is None else f"the verdict is {status}"
            raise BrokenError("answer", f"is {'missing' if self.answer is None else 'there'}, but {verdict}")
        if self.capture is not None and status != "refused":
            if self.capture.unfinished is not None or not self.capture.shots:
                raise BrokenError("capture", "must hold all its shots unless it was refused")
            check_alike(self.capture.shots)
            check_target(self.capture.white_reflectance, any(shot.white for shot in self.capture.shots))
        if self.answer is not None and self.capture is not None:
            _check_sizes(self.answer, self.capture)


def answer_in(document: Document) -> Answer:
    """The answer of a result.

    Raises:
        InvalidArgument: it was refused, is a capture that was not solved, or no document.
    """
    if not isinstance(document, Document):
        raise InvalidArgument(f"A {type(document).__name__} is no result.", "Read a file by `Result.load`.")
    if document.answer is not None:
        return document.answer
    if document.verdict is None:
        raise InvalidArgument("This capture was not solved: it has no curves.", "Solve it: `camssf solve`.")
    reason = document.verdict.reasons[0]
    raise InvalidArgument(f"This result was refused ({reason.code}): it has no curves.", reason.advice)


def read_document(path: str | PathLike[str], kind: type[AnyDocument]) -> AnyDocument:
    """The document of a file.

    Raises:
        InvalidArgument: unreadable, too large, or no such document; the message names the place of the first fault.
    """
    return forms.read(read_file(path), kind, str(path), ADVICE)


def read_file(path: str | PathLike[str]) -> bytes:
    """The bytes of a document's file, at most one more than a document may have.

    Raises:
        InvalidArgument: it cannot be read.
    """
    try:
        with open(local(path), "rb") as file:
            return file.read(forms.LARGEST + 1)
    except (OSError, ValueError) as error:
        raise InvalidArgument(f"{path}: cannot be read ({error_in_words(error)}).", ADVICE) from error


def document_bytes(document: Document) -> bytes:
    """The document for a file, `shareable`."""
    return forms.write(shareable(document))


def shareable(document: AnyDocument) -> AnyDocument:
    """The document without its bodies' serial numbers and the photos' times, because documents are shared."""
    capture = document.capture
    if capture is None:
        return document

    def without(photo: Photo) -> Photo:
        return replace(photo, unit=replace(photo.unit, serial=""), time="")

    def frame(photo: Photo | None) -> Photo | None:
        return None if photo is None else without(photo)

    shots = tuple(
        replace(shot, photo=without(shot.photo), white=frame(shot.white), dark=frame(shot.dark))
        for shot in capture.shots
    )
    last = capture.unfinished
    if last is not None:
        last = replace(last, photo=frame(last.photo))
    return replace(document, capture=replace(capture, shots=shots, unfinished=last))


def check_capture(capture: Capture) -> None:
    """Check what one field says against another.

    Raises:
        BrokenError: numbers of patches differ, a frame lacks its photo, or the white level lies below black.
    """
    table, n = capture.chart, len(capture.chart.patches)
    layout = table.layout

    def need(right: bool, place: str, what: str) -> None:
        if not right:
            raise BrokenError(f"capture.{place}", what)

    count = layout.columns * layout.rows
    need(n == count, "chart.patches", f"must hold the {count} of its layout, holds {n}")
    rows, columns = table.reflectance.shape
    size = table.wavelengths.size
    words = f"must hold {n} rows of {size}, as chart.patches and chart.wavelengths"
    need((rows, columns) == (n, size), "chart.reflectance", words)
    need(table.tolerance.size == n, "chart.tolerance", f"must hold {n} entries, one a patch")
    need(table.white < n, "chart.white", f"must be a number from 0 to {n - 1}")
    need(bool(table.reflectance[table.white].min() > 0), "chart.reflectance", "must be above 0 for the white patch")
    try:
        check_wavelengths(table.wavelengths, Path("it"), "invalid_argument")
    except InvalidArgument as error:
        raise BrokenError("capture.chart.wavelengths", f"does not fit: {error.message.rstrip('.')}") from None
    for i, shot in enumerate(capture.shots):
        at, means, pose = f"shots[{i}]", shot.means, shot.pose
        if isinstance(shot.lamp, Lamp):
            need(bool(shot.lamp.values.max() > 0), f"{at}.lamp.values", "must not be 0 at all wavelengths")
        need(pose.layout == layout.name, f"{at}.pose.layout", "must be the chart's")
        need(len(pose.patches) == n, f"{at}.pose.patches", f"must hold {n} entries, one a patch")
        for role in ("chart", "white", "dark"):
            frame = getattr(means, role)
            for name, values in vars(frame).items() if frame else ():
                need(len(values) == n, f"{at}.means.{role}.{name}", f"must hold {n} rows, one a patch")
        for role in ("white", "dark"):
            both = (getattr(means, role) is None) == (getattr(shot, role) is None)
            need(both or means.evened, f"{at}.{role}", "must be there as a photo and as means, or not at all")
        need(bool((means.saturation > means.black).all()), f"{at}.means.saturation", "must lie above black")


def _check_sizes(answer: Answer, capture: Capture) -> None:
    k, n = len(capture.shots), len(capture.chart.patches)
    for name in ("used", "level", "predicted", "unseen", "predicted_std", "unseen_std"):
        rows = getattr(answer, name)
        if rows is not None and (len(rows) != k or any(len(row) != n for row in rows)):
            raise BrokenError(f"answer.{name}", f"must hold {n} patches of {k} shots")
    if answer.lights and len(answer.lights) != k:
        raise BrokenError("answer.lights", f"must hold {k} entries, one a shot")
