"""The verdict's rules, one fault at a time, on a capture that is accepted without it."""

import json
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2, norm

from camssf.errors import CalibrationError, NotSensorRaw
from camssf.grid import WAVELENGTHS, Floats
from camssf.photo.find.pose import Pose
from camssf.photo.patches import FrameMeans, PatchMeans
from camssf.photo.signals import normalise
from camssf.recovery.basis import Basis, interpolate, read_basis
from camssf.recovery.covariance import CHANNEL_SHARE, red_end, smooth_errors
from camssf.recovery.hypotheses import recover
from camssf.recovery.observation import Observation
from camssf.recovery.rows import anchor
from camssf.recovery.sensitivity import SolverSettings, Ssf
from camssf.recovery.unfamiliar_camera import code_length
from camssf.rules import rules
from camssf.spectra import Lamp, read_chart, read_lamp
from camssf.spectra.layouts import LAYOUTS
from camssf.verdict.exposure_and_noise import FEW_PATCHES, few
from camssf.verdict.goodness_of_fit import EXPLANATION, GoodnessOfFit, VerdictInputs, signal_covariance
from camssf.verdict.judge import judge
from camssf.verdict.lamp import OTHER_LAMP_REFUSES, RIVAL, Neutral, Rival
from camssf.verdict.reasons import Check, Checks, Fatal, Reason, Verdict, refusal
from golden.linear_model import linear_model
from tests.support.problems import measured_cameras, theory

TABLE = read_chart("classic24")
SPAN, BLACK, WELL = 12000.0, 512.0, 8000.0
"""Range and black level, DN; electrons at full range."""


def frame(signal: Floats) -> FrameMeans:
    """400 samples a patch of a photon counter."""
    electrons = WELL * np.maximum(signal, 0.0) + 9.0
    error = np.sqrt(electrons / 400.0) * SPAN / WELL
    mean = BLACK + SPAN * signal
    still = np.zeros_like(mean)
    return FrameMeans(mean, error, np.full(mean.shape, 400), still, still, still, mean[:, [1, 1]])


def pose() -> Pose:
    layout = LAYOUTS["classic24"]
    i = np.arange(24)
    corner = np.stack([i % layout.columns, i // layout.columns], axis=1) * 100.0
    square = np.array([[0, 0], [80, 0], [80, 80], [0, 80]], float)
    patches = corner[:, None] + square
    return Pose("classic24", patches[[0, 5, 23, 18], [0, 1, 2, 3]], patches, 0, "detected", 0.97, ())


def camera() -> Floats:
    return measured_cameras()["Nikon D5100"]


class Scene:
    """One or two shots of the same camera, measured and solved, with what `judge` takes."""

    def __init__(self, *signals: Floats, white: bool = True, lamps: tuple[str, ...] = ("D55",)) -> None:
        one = frame(np.ones((24, 3))) if white else None
        dark = frame(np.zeros((24, 3)))
        self.shots = [PatchMeans(frame(y), one, dark, np.full(3, BLACK), 16383.0) for y in signals]
        self.poses = [pose()] * len(signals)
        self.lamps = [read_lamp(name) for name in lamps]
        self.rho = np.ones(WAVELENGTHS.size) if white else TABLE.values[TABLE.white]
        self.signals = normalise(self.shots, TABLE)
        self.rivals: tuple[Rival, ...] = ()
        self.neutrals: list[list[Neutral]] = []

    @cached_property
    def ssf(self) -> Ssf:
        return self.answer(self.lamps)

    def each(self) -> list[Ssf]:
        """The answer to every shot alone; none for one shot."""
        if len(self.shots) == 1:
            return []
        found = []
        for j, lamp in enumerate(self.lamps):
            only = Scene(self.signals.values[j], lamps=(lamp.name,))
            predicted = np.repeat(only.ssf.predicted, len(self.shots), axis=0)
            found.append(replace(only.ssf, predicted=predicted, lamp=self.ssf.lamp))
        return found

    def evidence(self, lamps: list[Lamp]) -> Observation:
        used = self.signals.used[0]
        return Observation(
            self.signals.values[:, used],
            TABLE.values[used],
            np.stack([lamp.values for lamp in lamps]),
            standard_error=self.signals.standard_error[:, used],
            chart_tolerance=TABLE.tolerance[used],
            white_reflectance=self.rho,
            lamp_tolerance=[lamp.tolerance for lamp in lamps],
        )

    def answer(self, lamps: list[Lamp]) -> Ssf:
        ssf = recover(self.evidence(lamps))
        table = TABLE.faded(ssf.chart_fading)
        return replace(
            ssf, predicted=np.stack([theory(table.values, light, ssf.values, self.rho) for light in ssf.lamp])
        )

    def goodness_of_fit(self, ssf: Ssf | None = None, lamps: list[Lamp] | None = None) -> GoodnessOfFit:
        return self.told(lamps or self.lamps).goodness_of_fit(ssf or self.ssf)

    def told(self, lamps: list[Lamp]) -> VerdictInputs:
        return VerdictInputs(self.signals, TABLE, self.shots, self.poses, lamps, (self.rho, 0.01))

    def judged(self, **changes: Any) -> Verdict:
        given = {
            name: changes.get(name, getattr(self, name)) for name in ("signals", "shots", "poses", "lamps", "ssf")
        }
        table = TABLE.faded(given["ssf"].chart_fading)
        return judge(
            VerdictInputs(given["signals"], table, given["shots"], given["poses"], given["lamps"], (self.rho, 0.01)),
            given["ssf"],
            rivals=self.rivals,
            neutrals=self.neutrals,
            alone=self.each(),
            unnamed=changes.get("unnamed", ()),
        )


def clean(lamp: str = "D55") -> Floats:
    return theory(TABLE.values, read_lamp(lamp).values, camera())


WHOLE = {"goodness_of_fit", "misfit_refuses", "improbable_curves", "lamp_residual", "band_too_wide", "other_makers"}
OF_A_SHOT = {"explanation", "dark_white", "veil", "few_patches", "dirty", "greens", "smooth", "rough", "poor_pose"}


def kept(check: Check) -> bool:
    return check.value <= check.limit if check.beyond == "above" else check.value >= check.limit


def test_an_accepted_capture_names_every_number_that_was_weighed() -> None:
    scene = Scene(clean(), clean("A"), lamps=("D55", "A"))
    verdict = scene.judged()
    assert verdict.status == "accepted"
    assert all(map(kept, verdict.checks))
    found = [(check.name, check.shot) for check in verdict.checks]
    assert len(set(found)) == len(found)
    assert {name for name, shot in found if shot is None} == WHOLE
    for number in (1, 2):
        assert {name for name, shot in found if shot == number} == OF_A_SHOT
    bounds = rules().numbers
    for check in verdict.checks:
        limits = {"improbable_curves": "unusual_camera", "lamp_residual": "lamp_residual_camera"}  # of its basis
        assert check.limit == bounds[f"verdict.{limits.get(check.name, check.name)}"].value
        assert check.beyond == bounds[f"verdict.{check.name}"].beyond
    (veil_refuses,) = {check.refuses for check in verdict.checks if check.name == "veil"}
    assert veil_refuses == bounds["verdict.veil_refuses"].value


def test_a_broken_number_is_the_reason_s() -> None:
    """Each reason's value and bound stand among the checks, broken; what keeps its limit is no reason."""
    scene = Scene(clean() * np.linspace(1.0, 0.7, 24)[:, None] * 0.05 + 0.05)
    scene.rivals = (Rival(0, "A", 1.0), Rival(0, "D65", 2.0))
    verdict = scene.judged(lamps=[replace(read_lamp("D55"), name="no lamp")])
    broken = {check.value for check in verdict.checks if not kept(check)}
    assert {reason.value for reason in verdict.reasons} <= broken
    assert len(verdict.reasons) >= 2
    assert refusal(verdict).checks == verdict.checks
    assert not [check for check in verdict.checks if check.name == "rival"]  # refused already: none was tried
    good = Scene(clean(), white=False)
    good.rivals = scene.rivals
    found = {check.name: check for check in good.judged().checks}
    assert (found["rival"].value, found["rival"].limit, found["rival"].refuses) == (2.0, RIVAL, OTHER_LAMP_REFUSES)
    assert "black" not in found  # there is a dark frame
    assert not {"smooth", "rough"} & set(found)  # and no white frame


def test_a_refusal_raises_the_error_of_its_gravest_reason() -> None:
    weak = Reason("glare", "weak.", "do.", 1.0, 2.0)
    error = refusal(Verdict("refused", (weak, Fatal("not_sensor_raw", "bent.", "do not.", 3.0, 2.0))))
    assert isinstance(error, NotSensorRaw)
    assert isinstance(error, CalibrationError)
    assert (error.message, error.value, error.threshold, len(error.reasons)) == ("bent.", 3.0, 2.0, 2)


# rule 1: expected errors, against sensing's own


def test_covariance_is_that_of_the_sensing_matrix_at_the_answer() -> None:
    """All rows of two shots at once: red's, green's, blue's."""
    scene = Scene(clean(), clean("A"), lamps=("D55", "A"))
    used = scene.signals.used[0]
    answer = Basis("answer", scene.ssf.values.T, np.zeros((3, WAVELENGTHS.size, 1)), True, "")
    known = linear_model(
        Observation(
            scene.signals.values[:, used],
            TABLE.values[used],
            np.stack([lamp.values for lamp in scene.lamps]),
            standard_error=scene.signals.standard_error[:, used],
            chart_tolerance=TABLE.tolerance[used],
            white_reflectance=scene.rho,
            white_tolerance=0.01,
            lamp_tolerance=np.array([lamp.tolerance for lamp in scene.lamps]),
            lamp_modes=np.zeros((2, 0, WAVELENGTHS.size)),
        ),
        answer,
    )
    mine, theirs = signal_covariance(scene.told(scene.lamps), scene.ssf), known.covariance[0]
    n = 3 * 2 * used.sum()
    assert mine.shape == theirs.shape == (n, n)
    # The sensing matrix knows errors times curves on 5-nm nodes and straight between.
    assert np.abs(mine - theirs).max() < 0.01 * np.abs(theirs).max()
    # Of one patch the channels share an error, of two patches they share the white's and the light's alone.
    red, green = np.arange(n // 3), n // 3 + np.arange(n // 3)
    assert (mine[red, green] > 2 * np.abs(mine[red, np.roll(green, 1)])).mean() > 0.8


# rule 2: goodness_of_fit


def test_the_length_of_the_code_by_hand() -> None:
    """Ten directions fully known, none of the others: χ² of ten degrees of freedom."""
    scene = Scene(clean())
    found = recover(scene.evidence(scene.lamps), basis="cameras", settings=SolverSettings(engine="reference"))
    K = np.diag(np.repeat([1.0, 0.0], [10, 62]))
    code = np.zeros(72)
    for chance in (0.5, 0.02, 0.001):
        code[0] = chi2.isf(chance, 10) ** 0.5
        exact = replace(found, code=code.reshape(24, 3), code_covariance=np.eye(72) - K)
        assert code_length(exact) == pytest.approx(norm.isf(chance), abs=0.03)
    assert code_length(replace(found, code_covariance=np.eye(72))) is None  # nothing was learned
    assert code_length(replace(found, code_covariance=None)) is None


# the rest


def test_what_refuses_is_the_first_reason() -> None:
    """The error of a refused result is that of its first reason, also when it is read from a document."""
    mixed = 0
    for path in (Path(__file__).parents[2] / "golden" / "cases" / "verdict").glob("*.json"):
        fatal = json.loads(path.read_text("utf-8"))["outputs"]["fatal"]
        assert fatal == sorted(fatal, reverse=True), path.name
        mixed += len(set(fatal)) > 1
    assert mixed


def test_as_many_patches_as_the_limit_are_enough() -> None:
    scene = Scene(clean())
    for count, reasons in ((FEW_PATCHES, []), (FEW_PATCHES - 1, ["underexposed.few_dark"])):
        assert [reason.key for reason in few(np.arange(24) < count, 0, scene.shots[0], Checks())] == reasons


def drawn_answer(scene: Scene) -> Ssf:
    """On the basis that the camera was drawn from, with its own width."""
    return recover(scene.evidence(scene.lamps), basis="cameras", settings=SolverSettings(engine="reference"))


def drawn(rng: np.random.Generator) -> Scene:
    """A capture in which everything is off just as it is told, under D55 with a white frame."""
    long, short, bent = (interpolate(smooth_errors(length)) for length in (100.0, 25.0, 60.0))
    lamp = read_lamp("D55")
    basis = anchor(read_basis("cameras"), lamp.values)
    edge = 70.0 * np.gradient(TABLE.values, 0.5, axis=1)

    def chart() -> Floats:
        u, v, w = (rng.normal(size=(24, c.shape[1])) @ c.T for c in (long, short, short))
        return np.asarray(0.03 * red_end(WAVELENGTHS) * (0.6 * TABLE.values * u + v / 3 + edge * w))

    curves = basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, rng.normal(size=basis.dictionary.shape[::2]))
    shared, light = chart(), lamp.values * (1 + lamp.tolerance * bent @ rng.normal(size=bent.shape[1]))
    white = (1 + 0.01 * rng.normal()) * (1 + 0.01 * long @ rng.normal(size=long.shape[1]))
    y = np.empty((24, 3))
    for c in range(3):
        off = np.sqrt(CHANNEL_SHARE) * shared + np.sqrt(1 - CHANNEL_SHARE) * chart()
        y[:, c] = ((TABLE.values + off) * light) @ curves[c] / ((white * light) @ curves[c])
    y *= 1 + 0.05 * 0.03 * rng.normal(size=y.shape)
    error = Scene(np.maximum(y, 1e-3)).signals.standard_error[0]
    return Scene(np.maximum(y + error * rng.normal(size=y.shape), 1e-3))


@pytest.mark.full
def test_surprise_is_chi_squared_when_all_is_as_told() -> None:
    """Camera, chart, white, lamp, drift and noise drawn from the model: T, and the explanations' gains."""
    rng = np.random.default_rng(4)
    z, strongest = [], []
    for _ in range(80):
        scene = drawn(rng)
        found = VerdictInputs(
            scene.signals, TABLE, scene.shots, scene.poses, scene.lamps, (scene.rho, 0.01)
        ).goodness_of_fit_of_shot(0, drawn_answer(scene))
        z.append(found.z)
        strongest.append(max(explanation.gain for explanation in found.explanations))
    # Of 80 standard normal numbers: the mean within 0.34, the spread within 0.21, each three standard errors.
    assert abs(np.mean(z)) < 0.34
    assert abs(np.std(z) - 1.0) < 0.21
    # 28 explanations, most of three degrees of freedom; their own curves' part makes them explain a little less.
    tenth, thousandth = (chi2.isf(share / 26, 3) for share in (0.1, 0.001))
    assert 0.01 < np.mean(np.array(strongest) > tenth) < 0.2
    assert thousandth < EXPLANATION < chi2.isf(0.0005 / 26, 3)
    assert max(strongest) < EXPLANATION
