"""Results like those of a calibration, from tables and formulas: doubtful, refused, of an unnamed light."""

from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from typing import Any

import numpy as np

from camssf.documents.document import FORMAT, Answer, Curves, Truth, lower_triangle
from camssf.fit.scores import Scores
from camssf.fit.solutions import Uncertainty, UncertaintySource
from camssf.grid import WAVELENGTHS
from camssf.photo.capture import Capture, MeasuredShot, Photo, UnfinishedShot
from camssf.photo.find.pose import Pose
from camssf.photo.patches import FrameMeans, PatchMeans
from camssf.photo.read.unit import Unit
from camssf.photo.signals import Assumption
from camssf.recovery.sensitivity import EstimatedLamp, Hypothesis, Proof
from camssf.report.provenance import Provenance, Signature
from camssf.result import Result
from camssf.rules import rules
from camssf.spectra import read_camera, read_chart, read_lamp
from camssf.spectra.lights import unnamed_light
from camssf.verdict.reasons import Check, Reason, Verdict
from camssf_fleet.passport.document import Passport
from camssf_fleet.passport.excerpt import excerpt_of

WIDTH, HEIGHT = 4032, 3024
CHANNELS = ("red", "green", "blue")


def quadrangles() -> tuple[np.ndarray, np.ndarray]:
    """Corners (4, 2) and patches (24, 4, 2) of a tilted chart; the camera was held upright: orientation 6."""
    tilt = np.array([[20.0, 385.0, 1180.0], [-372.0, 40.0, 2560.0], [0.012, 0.022, 1.0]])
    square, i = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), np.arange(24)[:, None]
    outer, flat = 0.08 + square * [5.84, 3.84], 0.08 + np.stack([i % 6, i // 6], axis=-1) + 0.84 * square

    def project(p: np.ndarray) -> np.ndarray:
        q = np.concatenate([p, np.ones((*p.shape[:-1], 1))], axis=-1) @ tilt.T
        return q[..., :2] / q[..., 2:]

    return project(outer), project(flat)


def frame(mean: np.ndarray, error: np.ndarray, *, clipped: bool = False) -> FrameMeans:
    """Statistics of a frame (24, 3); of the chart's own, the white patch is a little clipped."""
    still = np.zeros_like(mean)
    share, dead, gradient = still.copy(), still.copy(), still.copy()
    if clipped:
        share[18, 1], dead[:] = 0.012, (0.0004, 0.0, 0.0011)
        gradient = 0.01 * np.sin(np.arange(24.0)[:, None] + np.arange(3.0))
    count = np.full(mean.shape, 900, dtype=np.int64)
    return FrameMeans(mean, error, count, share, dead, gradient, mean[:, [1, 1]])


def photo(name: str, sha256: str) -> Photo:
    return Photo(
        name=name, width=WIDTH, height=HEIGHT, orientation=6, exposure=0.008, iso=100.0, gain_map=True,
        make="NIKON CORPORATION", model="NIKON D850", sha256=sha256,
    )  # fmt: skip


@cache
def _document(lamps: tuple[str, ...]) -> Result:
    truth, reflectance = read_camera("Nikon D850").values, read_chart("classic24").values
    u = (WAVELENGTHS - 380) / 340
    wobble = 1 + 0.05 * np.cos(np.outer(u, [9, 13, 11]) * np.pi) + 0.02 * np.sin(np.outer(u, [23, 19, 29]))
    found = truth * wobble + 0.006 * np.cos(np.outer(u, [31, 37, 41])) ** 2
    found /= found.max(axis=0)
    std = 0.008 + 0.035 * np.sqrt(found) * (0.6 + np.abs(np.outer(u - 0.5, [1, 1, 1])))
    corners, patches = quadrangles()
    notes = ("Two charts are in view; the one with the better agreement was taken.",)
    pose = Pose("classic24", corners, patches, 1, "detected", 0.987, notes)
    shots, squares, predictions, unseens = [], [], [], []
    for j, lamp in enumerate(lamps):
        light = read_lamp(lamp).values[:, None]
        signal = reflectance @ (light * truth) / (light * truth).sum(axis=0)
        signal *= 1 + 0.004 * np.sin(np.arange(72).reshape(24, 3) * 2.3 + j)
        predicted = reflectance @ (light * found) / (light * found).sum(axis=0)
        unseen = predicted * (1 + 0.006 * np.cos(np.arange(72).reshape(24, 3) * 1.7))
        squares.append(((unseen - signal) / signal) ** 2)
        predictions.append(predicted)
        unseens.append(np.where(np.arange(24)[:, None] == 18, np.nan, unseen))
        dark = np.tile([512.0, 512.25, 511.5] if j == 0 else [512.0] * 3, (24, 1))
        white = np.tile([12312.0, 14712.0, 9612.0], (24, 1))
        b, still = white - dark, np.zeros((24, 3))
        means = PatchMeans(
            frame(dark + b * signal, b * (0.0004 + 0.004 * signal), clipped=True), frame(white, still),
            frame(dark, still) if j == 0 else None, np.full(3, 512.0), 15520.0,
        )  # fmt: skip
        shots.append(
            MeasuredShot(
                replace(read_lamp(lamp), source=f"CIE illuminant {lamp}, colour-science."),
                photo(f"IMG_20261103_1204{j}.dng", f"{j}a" * 32), photo(f"white_{j}.dng", f"{j}b" * 32),
                photo("dark_0.dng", "0c" * 32) if j == 0 else None, pose, means,
            )
        )  # fmt: skip
    chart = replace(read_chart("classic24"), source="Mean of 30 charts measured by BabelColor, from colour-science.")
    seen = (WAVELENGTHS >= 400) & (WAVELENGTHS <= 700)
    used = tuple(tuple(i != 18 for i in range(24)) for _ in lamps)
    budget = (
        UncertaintySource("noise", "standard errors, median 0.10%", np.array([0.08, 0.06, 0.11])),
        UncertaintySource("chart", "3.0% a patch, smooth over 100 nm", np.array([0.41, 0.38, 0.3])),
        UncertaintySource("white", "1.0%, smooth over 100 nm", np.array([0.01, 0.01, 0.02])),
        UncertaintySource("lamp", "2.0%, smooth over 60 nm", np.array([0.1, 0.15, 0.17])),
        UncertaintySource("unseen", "what no patch has seen", np.array([0.4, 0.4, 0.4])),
    )
    choice = (("phones", 205.5, 0.02), ("cameras", 212.375, 0.9797), ("ryyb", 202.5, 0.0003))
    answer = Answer(
        basis="cameras", engine="onnx", model="0d" * 32, curves=Curves.of(found), std=Curves.of(std),
        channel_gain=np.array([0.8310, 1.0, 0.6408]), code_covariance=lower_triangle(covariance()), evidence=212.375,
        choice=tuple(Hypothesis(*each) for each in choice), gamma=np.full(3, 0.05), l2=1.0,
        proof=Proof(np.full(3, 3.1e-18), np.array([4.2e-18]), np.array([0])), used=used,
        level=np.ones((len(lamps), 24)), predicted=np.stack(predictions), unseen=np.stack(unseens),
        scores=Scores(
            rmsre_percent=100 * np.sqrt(np.mean(squares, axis=(0, 1))),
            unseen="leave one out: each patch predicted by a fit to the others",
            rmse=np.sqrt(np.mean((found - truth)[seen] ** 2, axis=0)), delta_e00=0.93,
        ),
        uncertainty=Uncertainty(
            half_width=0.036, half_width_without_photo=None,
            alone=(0.05, 0.06)[: len(lamps)] if len(lamps) > 1 else (), budget=budget,
        ),
    )  # fmt: skip
    clipped = Reason(
        "overexposed", "IMG_20261103_12040.dng: 1.2 % of the green samples of the white patch are clipped.",
        "Halve the exposure time and take the photo again.", 0.012, 0.01,
    )  # fmt: skip
    return Result(
        format=FORMAT, version="0.1.0", capture=Capture(tuple(shots), chart), answer=answer,
        verdict=Verdict("doubtful", (clipped,), tuple(checks(len(lamps)))),
        assumptions=(
            Assumption("lens_shading", "The lens-shading map was not applied; the white frame does it."),
            Assumption("chart_tolerance", "The chart's table was taken to be right to 3 %."),
        ),
        truth=Truth("Nikon D850, measured", Curves.of(truth)),
    )  # fmt: skip


WHOLE = (
    "goodness_of_fit", "improbable_curves", "lamp_residual", "chart_fading", "other_makers", "unnamed", "band_ratio",
    "band_too_wide", "rival",
)  # fmt: skip
"""Checks of a result, and not of each shot."""


def checks(shots: int, *, unnamed: bool = False) -> list[Check]:
    """One number of each limit of the rules, all held but the clipped patch's: as many as a verdict can weigh."""
    others = ("unusual_", "lamp_residual_camera", "white_balance_mismatch_unnamed", "band_ratio_typical")
    others += ("chart_fading",)  # weighed for a camera of no family alone
    others += () if unnamed else ("unnamed", "band_ratio")
    found = []
    for place, bound in rules().numbers.items():
        name, above = place.partition(".")[2], bound.beyond == "above"
        if bound.makes != "doubtful" or name.startswith(others):
            continue
        for shot in [None] if name in WHOLE else range(1, shots + 1):
            factor = 1.2 if (name, shot) == ("dirty", 1) else 0.31 if above else 1.23
            refuses = rules().number(f"verdict.{bound.refuses}") if bound.refuses else None
            found.append(Check(name, shot, bound.value * factor, bound.value, refuses, bound.beyond or "above"))
    return found


def covariance() -> np.ndarray:
    """Of 3 x 24 coefficients, as a solution has it: digits of all sizes."""
    root = np.sin(np.add.outer(np.arange(72.0), 1.7 * np.arange(9.0)) ** 2)
    return np.asarray(0.03 * root @ root.T + 0.2 * np.eye(72))


def document(*lamps: str) -> Result:
    return _document(lamps or ("D55",))


def changed(part: Any, **values: Any) -> Any:
    """A copy of a part with other values at places such as `capture__shots__0__photo__iso`; `all` is each entry."""
    for place, value in values.items():
        head, _, rest = place.partition("__")
        if isinstance(part, tuple):
            rows = range(len(part)) if head == "all" else (int(head),)
            part = tuple(
                entry if i not in rows else changed(entry, **{rest: value}) if rest else value
                for i, entry in enumerate(part)
            )
        else:
            part = replace(part, **{head: changed(getattr(part, head), **{rest: value}) if rest else value})
    return part


NOT_FOUND = Reason(
    "chart_not_found",
    "chart.dng: no ColorChecker lies in the photo.",
    "Fill a quarter of the frame with the chart, or give its corners with --corners.",
)


def refused(*, shots: bool = False) -> Result:
    """Without an answer; with `shots` all photos were measured, and the verdict refused."""
    made = document()
    capture = made.capture if shots else replace(made.capture, shots=())
    verdict = Verdict("refused", (NOT_FOUND,), made.verdict.checks if shots else ())
    return replace(made, answer=None, truth=None, capture=capture, verdict=verdict)


def unplaced() -> Result:
    """A refusal that found no chart, and so has nothing but the photo."""
    (shot,) = document().capture.shots
    last = UnfinishedShot(shot.lamp, shot.photo, shot.means.black, shot.means.saturation)
    return changed(refused(), capture__unfinished=last)


def unnamed() -> Result:
    """Of an unnamed light."""
    made = document()
    (shot,) = made.capture.shots
    light = EstimatedLamp(
        kinds={"daylight": 0.93, "white-led": 0.04, "fluorescent": 0.03, "bulb": 0.0},
        power=shot.lamp.values / shot.lamp.values.mean(),
        std=0.6 * np.exp(-(((WAVELENGTHS - 400) / 60) ** 2)) + 0.05, kelvin=5480.0, kelvin_std=210.0,
    )  # fmt: skip
    choice = tuple(
        replace(each, kinds=(kind,), probability=each.probability * share)
        for each in made.answer.choice
        for kind, share in light.kinds.items()
    )
    return changed(
        made, capture__shots__0__lamp=unnamed_light(), answer__choice=choice, answer__lights=(light,),
        verdict__checks=tuple(checks(1, unnamed=True)),
    )  # fmt: skip


UNIT = Unit("NIKON CORPORATION", "NIKON D850", serial="6001234", lens="AF-S 50mm f/1.8G", aperture=5.6)


def passport(made: Result) -> Passport:
    return Passport(
        id="0123456789abcdef" * 2, issued=datetime(2026, 11, 22, 9, 30, tzinfo=UTC),
        begins=datetime(2026, 11, 23, tzinfo=UTC), ends=datetime(2027, 11, 23, tzinfo=UTC), unit=UNIT,
        captured="2026-11-03T12:04:00+01:00", chart_serial="CC-77",
        lamp_serials=("L-1",) * len(made.capture.photos), software="0.1.0", result_sha256="5e" * 32,
        result=excerpt_of(made),
    )  # fmt: skip


def known(made: Result, *, verified: bool = True) -> Provenance:
    """A signed result."""
    return Provenance(unit=Unit(focal_length=50.0), signature=Signature(passport(made), "K" * 43, verified))


@cache
def preview() -> bytes:
    """A picture in place of the photo."""
    import cv2

    sound, data = cv2.imencode(".jpg", np.full((HEIGHT // 8, WIDTH // 8, 3), (96, 110, 122), np.uint8))
    assert sound
    return bytes(data)
