"""Each shot of a result as it is shown: what was measured, what the answer says of it, and colours for the eye."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camssf.documents.document import Answer, Document
from camssf.errors import CalibrationError
from camssf.fit.scores import PatchColours, patch_colours, reflectance_srgb
from camssf.grid import Floats
from camssf.photo.capture import Capture, MeasuredShot, Photo
from camssf.photo.find.pose import Pose
from camssf.photo.signals import normalise
from camssf.recovery.sensitivity import EstimatedLamp
from camssf.spectra import Called, Lamp, Light, read_lamp


@dataclass(frozen=True)
class ShownPatches:
    """The patches of a measured shot. Columns are red, green, blue; what is not known is NaN.

    Attributes:
        names: (n)
        reflectance_srgb: (n, 3) the table's colours, 0 to 1.
        signal, standard_error: (n, 3) Eq. (5); 0 where it could not be formed.
        chart, white, dark, clipped, dead, gradient: (n, 3) as measured.
        used: (n,) whether the fit used the patch.
        level: (n,) correction for uneven light.
        predicted, predicted_std, unseen, unseen_std: (n, 3) as in `Answer`.
        measured_srgb, synthetic_srgb: (n, 3) colours 0 to 1; None without an answer.
    """

    names: tuple[str, ...]
    reflectance_srgb: Floats
    signal: Floats
    standard_error: Floats
    chart: Floats
    white: Floats
    dark: Floats
    clipped: Floats
    dead: Floats
    gradient: Floats
    used: NDArray[np.bool_]
    level: Floats
    predicted: Floats
    predicted_std: Floats
    unseen: Floats
    unseen_std: Floats
    measured_srgb: Floats | None
    synthetic_srgb: Floats | None


@dataclass(frozen=True)
class ShownShot:
    """One shot.

    Attributes:
        number: from 1.
        lamp: its light as given.
        light: its light as estimated; None if it was named, or without an answer.
        photo: the chart photo.
        pose: None if the chart was not found.
        saturation: the white level, DN.
        measured: None of a shot at which measuring ended.
        patches: those of `measured`.
    """

    number: int
    lamp: Light
    light: EstimatedLamp | None
    photo: Photo
    pose: Pose | None
    saturation: float
    measured: MeasuredShot | None
    patches: ShownPatches | None


def shots_of(document: Document) -> tuple[ShownShot, ...]:
    """The shots of a result, and the one at which measuring ended if its photo was read."""
    capture, answer = document.capture, document.answer
    if capture is None:
        return ()
    lights = answer.lights if answer is not None and answer.lights else (None,) * len(capture.shots)
    colours = None if answer is None else _colours(capture, answer)
    shown = [
        ShownShot(
            j + 1, shot.lamp, lights[j], shot.photo, shot.pose, shot.means.saturation, shot,
            _patches(capture, shot, answer, colours, j),
        )
        for j, shot in enumerate(capture.shots)
    ]  # fmt: skip
    last = capture.unfinished
    if last is not None and last.photo is not None:
        shown.append(ShownShot(len(shown) + 1, last.lamp, None, last.photo, last.pose, last.saturation, None, None))
    return tuple(shown)


def _colours(capture: Capture, answer: Answer) -> tuple[PatchColours, PatchColours] | None:
    """Colours of measured and synthetic patches, under the named lamps and the estimated lights."""
    try:
        signals = normalise([shot.means for shot in capture.shots], capture.chart)
    except CalibrationError:  # no solver could take these signals of a foreign document
        return None
    seen = np.asarray(np.isfinite(answer.unseen).all(axis=2))[:, :, None]
    powers = []
    for j, shot in enumerate(capture.shots):
        light = answer.lights[j] if answer.lights else None
        if light is not None:
            powers.append(light.power)
        elif isinstance(shot.lamp, Lamp | Called):  # one that was called is its table where no lamps were weighed
            powers.append(read_lamp(shot.lamp.name).values if isinstance(shot.lamp, Called) else shot.lamp.values)
    return patch_colours(
        answer.level[:, :, None] * signals.values,
        np.where(seen, answer.unseen, answer.predicted),
        np.array(answer.used),
        capture.chart.faded(answer.chart_fading),
        np.stack(powers),
    )


def _patches(
    capture: Capture,
    shot: MeasuredShot,
    answer: Answer | None,
    colours: tuple[PatchColours, PatchColours] | None,
    j: int,
) -> ShownPatches:
    table, means = capture.chart, shot.means
    n = len(table.patches)
    try:
        signals = normalise([means], table)
        y, error, white, dark = signals.values[0], signals.standard_error[0], signals.white[0], signals.dark[0]
    except CalibrationError:  # the capture was refused; show what was measured
        y = error = np.zeros_like(means.chart.mean)
        white = means.white.mean if means.white else np.tile(means.chart.mean[table.white], (n, 1))
        dark = means.dark.mean if means.dark else np.tile(means.black, (n, 1))
    unknown = np.full((n, 3), np.nan)

    def of_answer(name: str) -> Floats:
        rows: Floats | None = getattr(answer, name, None)
        return unknown if rows is None else rows[j]

    return ShownPatches(
        names=table.patches,
        reflectance_srgb=reflectance_srgb(table),
        signal=y,
        standard_error=error,
        chart=means.chart.mean,
        white=white,
        dark=dark,
        clipped=means.chart.clipped,
        dead=means.chart.dead,
        gradient=means.chart.gradient,
        used=np.zeros(n, dtype=bool) if answer is None else np.array(answer.used[j]),
        level=np.ones(n) if answer is None else answer.level[j],
        predicted=of_answer("predicted"),
        predicted_std=of_answer("predicted_std"),
        unseen=of_answer("unseen"),
        unseen_std=of_answer("unseen_std"),
        measured_srgb=None if colours is None else colours[0].srgb[j],
        synthetic_srgb=None if colours is None else colours[1].srgb[j],
    )
