"""Simulated shots of a chart as samples of a sensor, measured, solved and judged as `camssf calibrate` does it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Any

import numpy as np

from benchmarks.captures import answer_to, makers_matrices
from benchmarks.devices import scored
from benchmarks.shared import TABLE, ripple, standing_in
from camssf.errors import CalibrationError
from camssf.grid import STEP, Floats
from camssf.photo.capture import Capture, MeasuredShot, photo_of
from camssf.photo.find.pose import Pose, find_chart
from camssf.photo.find.search import agreement, plain_signals
from camssf.photo.patches import measure_patches
from camssf.photo.read.dng import Mosaic
from camssf.recovery.basis import Basis, interpolate
from camssf.recovery.covariance import (
    ABSOLUTE,
    CHART_CORRELATION,
    EDGE,
    RELATIVE,
    TABLE_CORRELATION,
    smooth_errors,
)
from camssf.spectra import CameraCurves, ChartTable, read_chart, read_lamp
from camssf_lab.simulation.camera import Sensor
from camssf_lab.simulation.scene import Scene, true_pose
from camssf_lab.simulation.shot import take
from camssf_lab.simulation.shot_plan import ShotPlan

SIZE = (720, 540)
HARM = 0.03
"""RMSE by which a fault or a wrong name harms."""


@dataclass(frozen=True)
class Staged:
    """A capture before the fault, and its number."""

    setup: ShotPlan
    number: int


@dataclass(frozen=True)
class Outcome:
    """What became of one capture.

    Attributes:
        status: accepted, doubtful or refused. codes, words: of the reasons.
        rmse: of the curves, None where there were none.
        covered: share of wavelengths within the 95 % band, likewise.
        first: key of the first reason's message.
    """

    status: str
    codes: tuple[str, ...]
    rmse: float | None
    covered: float | None
    words: tuple[str, ...] = ()
    first: str = ""

    @property
    def caught(self) -> bool:
        """Whether the verdict warns at all."""
        return self.status != "accepted"


def stage(number: int, name: str, camera: Floats, lamp: str) -> Staged:
    """A good capture: all that may differ between good captures is drawn from its number."""
    rng = np.random.default_rng([77, number])
    light = read_lamp(lamp)
    smooth = ripple(rng)
    scene = Scene(
        size=SIZE, fill=0.55, rotation=float(rng.uniform(-6, 6)), tilt=float(rng.uniform(-8, 8)),
        vignetting=float(rng.uniform(0, 0.4)),
    )  # fmt: skip
    sensor = Sensor(exposure=float(rng.uniform(0.6, 0.85)), full_well=float(rng.choice([5000.0, 20000.0])))
    curves = camera * np.array([rng.uniform(0.4, 0.9), 1.0, rng.uniform(0.5, 0.9)])
    body = CameraCurves(name, curves, "measured")
    plan = ShotPlan(
        body, replace(light, values=light.values * smooth), real_chart(number, rng), scene, sensor, lamp, TABLE,
        white_level=float(np.exp(0.01 * rng.normal())),
    )  # fmt: skip
    return Staged(plan, number)


def real_chart(number: int, rng: np.random.Generator) -> ChartTable:
    """The chart in the photo: the table's own, Ohta's, or two drawn from the tolerance."""
    table = read_chart("classic24")
    if number % 4 == 0:
        return table
    if number % 4 == 1:
        return replace(read_chart("classic24:ohta"), name="classic24")
    long, short = (interpolate(smooth_errors(length)) for length in (CHART_CORRELATION, TABLE_CORRELATION))
    u, v, w = (rng.normal(size=(24, curves.shape[1])) @ curves.T for curves in (long, short, short))
    edge = EDGE * np.gradient(table.values, STEP, axis=1)
    off = table.tolerance[:, None] * (RELATIVE * table.values * u + ABSOLUTE * v + edge * w)
    return table.with_values(np.clip(table.values + off, 0.004, 1.1))


def mosaic(plan: ShotPlan, frames: dict[str, Any], role: str, frame: str, number: int) -> Mosaic:
    """A frame as `read_dng` would give it."""
    tags = plan.file_tags(frame)
    camera = plan.camera.values * np.array(plan.sensor.gains)
    return Mosaic(
        path=role, samples=frames[frame], cfa=tags.cfa, black=np.full((2, 2), tags.black),
        white=float(tags.white_level), make="", model=plan.camera.name, exposure=tags.exposure, iso=tags.iso,
        orientation=1, gain_maps=(), color_matrix1=None, color_matrix2=None, as_shot_neutral=None,
        sha256=sha256(frames[frame].tobytes()).hexdigest(),
        colour_matrices=makers_matrices(camera, number),
    )  # fmt: skip


def shoot(staged: Staged, plan: ShotPlan, *, search: bool = False) -> MeasuredShot:
    """Take it and measure it; refusals of the stages leave as errors."""
    taken = take(plan, (staged.number,))
    frames = {"chart": taken.chart, "white": taken.white, "dark": taken.dark}
    photos = {
        role: None if frame is None else mosaic(plan, frames, role, frame, staged.number)
        for role, frame in plan.handed_in.items()
    }
    chart, stated = photos["chart"], read_chart(plan.stated_chart)
    assert chart is not None
    if search:
        pose = find_chart(chart, stated)
    else:
        true = true_pose(plan.scene)
        pitch = np.ptp(true.corners[:, 0]) / 6
        off = np.random.default_rng([5, staged.number]).normal(0, 0.01 * pitch, 2)
        pose = Pose(true.layout, true.corners + off, true.patches + off, 0, "detected", 1.0, ())
    means = measure_patches(chart, pose, white=photos["white"], dark=photos["dark"])
    if not search:
        score = agreement(np.maximum(means.chart.mean - means.black, 0.0), plain_signals(stated))
        pose = replace(pose, score=max(score, 0.0))
    facts = {role: None if photo is None else photo_of(photo) for role, photo in photos.items()}
    assert facts["chart"] is not None
    lamp = read_lamp(plan.stated_lamp)
    return MeasuredShot(lamp, facts["chart"], facts["white"], facts["dark"], pose, means, None)


def solved(shots: Sequence[MeasuredShot], basis: Basis, camera: Floats) -> Outcome:
    """What becomes of a capture; the curves of a refused verdict are judged all the same."""
    with standing_in(basis):
        answer = answer_to(Capture(tuple(shots), read_chart(TABLE), None))
    if answer.ssf is None:
        assert answer.error is not None
        return refusal(answer.error)
    rmse, held = scored(answer.ssf.peak(), camera)
    words = tuple(reason.message for reason in answer.reasons)
    first = next((reason.key for reason in answer.reasons), "")
    return Outcome(answer.status, answer.codes, rmse, held, words, first)


def refusal(error: CalibrationError) -> Outcome:
    """By a stage before there were curves."""
    return Outcome("refused", (error.code,), None, None, (error.message,), error.key)


def tried(shoot_it: Callable[[], Sequence[MeasuredShot]], basis: Basis, camera: Floats) -> Outcome:
    """An outcome whatever stage refuses."""
    try:
        shots = shoot_it()
    except CalibrationError as error:
        return refusal(error)
    return solved(shots, basis, camera)
