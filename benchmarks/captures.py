"""Captures of a chart by devices, as means of its patches; solved and judged as `camssf calibrate` does it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.devices import PHONES, Device, no_photo, scored
from benchmarks.shared import TABLE
from camssf.calibration import solve
from camssf.errors import CalibrationError
from camssf.fit.capture_fit import prepare_fit
from camssf.fit.solutions import recover_fit
from camssf.grid import WAVELENGTHS, Floats
from camssf.options import Options
from camssf.photo.capture import Capture, MeasuredShot, Photo
from camssf.photo.find.pose import Pose
from camssf.photo.patches import FrameMeans, PatchMeans
from camssf.photo.read.colour_matrix import ColourMatrix
from camssf.recovery.basis import read_basis
from camssf.recovery.sensitivity import Ssf
from camssf.spectra import Light, Unnamed, read_chart, read_lamp
from camssf.spectra.bundled import observer
from camssf.spectra.families import FAMILIES, LampKind, principal_modes
from camssf.spectra.layouts import LAYOUTS
from camssf.spectra.lights import kind_of, unnamed_light
from camssf.spectra.sampled import colour_science
from camssf.verdict.reasons import Check, Reason

LOW = (0.001, 0.0002)
"""Noise: σ is the hypotenuse of a share of the signal and a floor."""
LAMPS = {
    "daylight": ("D:4800", "D:5500", "D:6500", "D:7500", "D:10000"),
    "bulb": ("2500K", "2700K", "3000K"),
    "white-led": ("LED-B1", "LED-B2", "LED-B3", "LED-B4", "LED-B5", "LED-BH1", "LED-V1"),
    "fluorescent": ("FL2", "FL7", "FL11"),
}
KIND_OF = {lamp: kind for kind, lamps in LAMPS.items() for lamp in lamps}
BLACK, SPAN, SATURATION = 512.0, 15000.0, 16383.0
STATUSES = ("accepted", "doubtful", "refused")
SOURCES = colour_science().SDS_LIGHT_SOURCES
OPTIONS = Options(engine="reference")
MUNSELL = Path(__file__).parents[1] / "data" / "surfaces" / "vhrel_munsell.csv"
MATRIX_ERROR = 0.03
"""Relative error of a maker's colour matrices."""


def power(lamp: str) -> Floats:
    """(681,) of mean 1: a lamp of camssf or of colour-science, or under a tree."""
    if lamp == "under a tree":  # leaves let green and the near infrared through
        found = read_lamp("D:6000").values * (
            1.0 + 0.35 * np.exp(-0.5 * ((WAVELENGTHS - 550.0) / 35.0) ** 2) + 0.3 * (WAVELENGTHS > 690.0)
        )
    elif lamp in SOURCES:
        found = np.interp(WAVELENGTHS, SOURCES[lamp].wavelengths, SOURCES[lamp].values)
    else:
        found = read_lamp(lamp).values
    return np.asarray(found / found.mean())


def without(kind: LampKind, lamp: str) -> tuple[Floats, Floats]:
    """Mean of mean 1 and modes of a kind whose table lacks that lamp."""
    rest = [read_lamp(member).values for member in kind.members if member != lamp]
    mean, modes = principal_modes(rest, kind.components)
    return mean / mean.mean(), modes


def unnamed(lamp: str) -> Unnamed:
    """Unnamed light, of which no table holds this lamp."""
    light, lamps = unnamed_light(), []
    for possible in light.lamps:
        family = FAMILIES[kind_of(possible.name) or ""]
        if isinstance(family, LampKind) and lamp in family.members:
            mean, modes = without(family, lamp)
            possible = replace(possible, values=mean, modes=modes)
        lamps.append(possible)
    return replace(light, lamps=tuple(lamps))


def frame(signal: Floats, error: Floats) -> FrameMeans:
    """Means of a frame, DN, as `measure_patches` gives them; nothing else is wrong with it."""
    mean, still = BLACK + SPAN * signal, np.zeros_like(signal)
    return FrameMeans(mean, SPAN * error, np.full(mean.shape, 36), still, still, still, mean[:, [1, 1]])


def pose() -> Pose:
    """The chart seen straight."""
    layout, i = LAYOUTS["classic24"], np.arange(24)
    corner = np.stack([i % layout.columns, i // layout.columns], axis=1) * 100.0
    patches = corner[:, None] + np.array([[0, 0], [80, 0], [80, 80], [0, 80]], float)
    return Pose("classic24", patches[[0, 5, 23, 18], [0, 1, 2, 3]], patches, 0, "detected", 0.97, ())


def model_of(device: Device, maker: str) -> str:
    """What a file that names this maker calls the device; one that names none names no model."""
    return device.name[len(maker) :].strip() if maker else ""


def in_roles(photo: Photo) -> tuple[Photo, Photo, Photo]:
    """A simulated photo as chart's photo, white frame and dark frame: three files, since one file has one role."""
    chart, white, dark = (replace(photo, sha256=digit + photo.sha256[1:]) for digit in "cad")
    return chart, white, dark


def makers_matrices(curves: Floats, seed: int, off: float = MATRIX_ERROR) -> tuple[ColourMatrix, ...]:
    """Colour matrices for A and D65 as a maker may fit them to a camera (681, 3), with this relative error."""
    table = np.loadtxt(MUNSELL, delimiter=",", skiprows=1)
    surfaces = np.stack([np.interp(WAVELENGTHS, table[:, 0], column) for column in table.T[1:]])
    error = np.eye(3) + off * np.random.default_rng([11, seed]).normal(size=(3, 3))
    found = []
    for light in ("A", "D65"):
        reflected = surfaces * read_lamp(light).values
        to_raw = np.linalg.lstsq(reflected @ observer("1931"), reflected @ curves, rcond=None)[0].T
        found.append(ColourMatrix(light, tuple((error @ to_raw).ravel().tolist())))
    return tuple(found)


def capture(
    device: Device, lamps: Mapping[str, Floats], lights: Sequence[Light], maker: str, seed: int,
    chart: Floats | None = None, table: str = TABLE, matrices: tuple[ColourMatrix, ...] = (),
) -> Capture:  # fmt: skip
    """A chart under lamps, power (681,) by name, told as lights; by default Ohta's reflectances (24, 681)."""
    chart, shots = read_chart("classic24:ohta").values if chart is None else chart, []
    for number, (lit, light) in enumerate(zip(lamps.values(), lights, strict=True)):
        level = lit @ device.curves
        y = ((lit * chart) @ device.curves) / level
        level = level / level.max()
        error = np.hypot(LOW[0] * y, LOW[1])
        noise = error * np.random.default_rng([seed, number]).normal(size=y.shape)
        name = model_of(device, maker)
        photo = Photo(f"{number}.dng", 600, 400, 1, None, None, False, maker, name, f"{number:064d}", matrices)
        even = level * np.ones_like(y)
        white, dark = frame(even, 1e-5 * even), frame(np.zeros_like(y), np.zeros_like(y))
        means = PatchMeans(frame(level * (y + noise), level * error), white, dark, np.full(3, BLACK), SATURATION)
        shots.append(MeasuredShot(light, *in_roles(photo), pose(), means, None))
    return Capture(tuple(shots), read_chart(table), None)


@dataclass(frozen=True)
class Answer:
    """What `camssf calibrate` says of a capture.

    Attributes:
        status: of the verdict. reasons, checks: of the verdict or of the refusal.
        ssf: of a refused verdict, too; None where an earlier stage refused.
        error: the refusal, of whichever stage.
    """

    status: str
    reasons: tuple[Reason, ...]
    checks: tuple[Check, ...]
    ssf: Ssf | None
    error: CalibrationError | None = None

    @property
    def codes(self) -> tuple[str, ...]:
        """Of the reasons, or of the error."""
        return tuple(reason.code for reason in self.reasons) or ((self.error.code,) if self.error else ())


def answer_to(measured: Capture) -> Answer:
    """The verdict by the reference engine; the curves of a refused one are solved all the same."""
    try:
        result = solve(measured, options=OPTIONS)
    except CalibrationError as error:
        if not error.reasons:
            return Answer("refused", (), tuple(error.checks), None, error)
        fit = prepare_fit(measured, OPTIONS)
        ssf = recover_fit(fit, fit.signals.used, None)
        return Answer("refused", tuple(error.reasons), tuple(error.checks), ssf, error)
    verdict = result.verdict
    return Answer(verdict.status, tuple(verdict.reasons), tuple(verdict.checks), result.ssf)


@dataclass(frozen=True)
class Taken:
    """One capture, solved and judged.

    Attributes:
        device, lamps: whose, and the true lights.
        status: of the verdict. codes: of its reasons.
        rmse, covered: of the curves.
        no_photo: RMSE of the mean phone of the basis, without any photo.
        length, lamp_residual: of its `family_test`; None if the lamp was not named.
        kinds: of the first shot's light, by probability; empty where it was named.
        band_ratio: of the answer.
    """

    device: str
    lamps: tuple[str, ...]
    status: str
    codes: tuple[str, ...]
    rmse: float
    covered: float
    no_photo: float
    length: float
    lamp_residual: float | None
    kinds: Mapping[str, float]
    band_ratio: float | None

    @property
    def kind(self) -> str:
        """The likeliest of the first light's."""
        return max(self.kinds, key=lambda kind: self.kinds[kind])


def judged(measured: Capture, device: Device, lamps: Mapping[str, Floats]) -> Taken:
    """The answer to a capture under lamps, power (681,) by name, against the truth."""
    answer = answer_to(measured)
    if answer.ssf is None:
        fit = prepare_fit(measured, OPTIONS)
        answer = replace(answer, ssf=recover_fit(fit, fit.signals.used, None))
    ssf = answer.ssf
    assert ssf is not None
    assert ssf.family_test is not None
    light = ssf.lights[0] if ssf.lights else None
    return Taken(
        device.name, tuple(lamps), answer.status, answer.codes, *scored(ssf.peak(), device.curves),
        no_photo(read_basis(PHONES), device.curves), ssf.family_test.length, ssf.family_test.lamp_residual,
        light.kinds if light else {}, ssf.band_ratio,
    )  # fmt: skip


class Group(list[Taken]):
    """Captures of one row of a table."""

    def mean(self, name: str) -> float | None:
        """Of those that have that attribute."""
        known = [value for one in self if (value := getattr(one, name)) is not None]
        return float(np.mean(known)) if known else None

    def share(self, test: Callable[[Taken], bool]) -> float | None:
        """Of the captures that pass."""
        return float(np.mean([test(one) for one in self])) if self else None

    def where(self, test: Callable[[Taken], bool]) -> Group:
        """The captures that pass."""
        return Group(filter(test, self))

    def by_device(self, name: str) -> list[float]:
        """Means of that attribute, a device each."""
        return [float(self.where(lambda one, own=own: one.device == own).mean(name) or 0.0)  # type: ignore[misc]
                for own in dict.fromkeys(one.device for one in self)]  # fmt: skip

    def quantiles(self, name: str, *parts: float) -> tuple[float, ...]:
        """Of that attribute, where it is known."""
        known = [value for one in self if (value := getattr(one, name)) is not None]
        return tuple(np.quantile(known, parts).tolist()) if known else ()

    @property
    def rmse(self) -> float:
        """Mean RMSE."""
        return float(np.mean([one.rmse for one in self]))

    @property
    def coverage(self) -> float:
        """Mean coverage."""
        return float(np.mean([one.covered for one in self]))

    @property
    def worst(self) -> float:
        """Largest RMSE."""
        return max(one.rmse for one in self)

    @property
    def accepted(self) -> Group:
        """Those of them."""
        return self.where(lambda one: one.status == "accepted")

    @property
    def counts(self) -> tuple[int, ...]:
        """Accepted, doubtful, refused."""
        return tuple(sum(one.status == status for one in self) for status in STATUSES)

    @property
    def codes(self) -> str:
        """Reasons and how many captures have them."""
        named = dict.fromkeys(code for one in self for code in one.codes)
        return ", ".join(f"{code} {sum(code in one.codes for one in self)}" for code in named)


class Groups(dict[tuple[str, ...], Group]):
    """Captures by the words of their row."""

    def add(self, taken: Taken, *key: str) -> None:
        """One more of that row."""
        self.setdefault(key, Group()).append(taken)
