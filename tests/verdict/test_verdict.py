"""What the verdict's rules stand on, by hand and by draws; golden's stage verdict has a case of each rule."""

import json
from dataclasses import replace
from functools import cached_property
from pathlib import Path

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
from camssf.spectra import read_chart, read_lamp
from camssf.spectra.layouts import LAYOUTS
from camssf.verdict.exposure_and_noise import FEW_PATCHES, few
from camssf.verdict.goodness_of_fit import EXPLANATION, VerdictInputs, signal_covariance
from camssf.verdict.reasons import Checks, Fatal, Reason, Verdict, refusal
from golden.forms import ROOT
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
    """One or two shots of the same camera, measured and solved, with what the verdict weighs."""

    def __init__(self, *signals: Floats, lamps: tuple[str, ...] = ("D55",)) -> None:
        white, dark = (frame(level * np.ones((24, 3))) for level in (1.0, 0.0))
        self.shots = [PatchMeans(frame(y), white, dark, np.full(3, BLACK), 16383.0) for y in signals]
        self.poses = [pose()] * len(signals)
        self.lamps = [read_lamp(name) for name in lamps]
        self.signals = normalise(self.shots, TABLE)

    @cached_property
    def ssf(self) -> Ssf:
        ssf = recover(self.evidence())
        values = TABLE.faded(ssf.chart_fading).values
        return replace(ssf, predicted=np.stack([theory(values, light, ssf.values) for light in ssf.lamp]))

    def evidence(self) -> Observation:
        used = self.signals.used[0]
        return Observation(
            self.signals.values[:, used], TABLE.values[used], np.stack([lamp.values for lamp in self.lamps]),
            standard_error=self.signals.standard_error[:, used], chart_tolerance=TABLE.tolerance[used],
            lamp_tolerance=[lamp.tolerance for lamp in self.lamps],
        )  # fmt: skip

    def told(self) -> VerdictInputs:
        white = np.ones(WAVELENGTHS.size), 0.01
        return VerdictInputs(self.signals, TABLE, self.shots, self.poses, self.lamps, white)


def clean(lamp: str = "D55") -> Floats:
    return theory(TABLE.values, read_lamp(lamp).values, camera())


def test_a_refusal_raises_the_error_of_its_gravest_reason() -> None:
    weak = Reason("glare", "weak.", "do.", 1.0, 2.0)
    error = refusal(Verdict("refused", (weak, Fatal("not_sensor_raw", "bent.", "do not.", 3.0, 2.0))))
    assert isinstance(error, NotSensorRaw)
    assert isinstance(error, CalibrationError)
    assert (error.message, error.value, error.threshold, len(error.reasons)) == ("bent.", 3.0, 2.0, 2)


def test_a_reason_states_the_limit_that_its_number_broke() -> None:
    """In golden cases, by the checks; that a band is hardly narrower than without a photo has a limit of its own."""
    own, seen = rules().number("verdict.band_ratio_typical"), 0
    for path in sorted((ROOT / "cases/verdict").glob("*.json")):
        outputs = json.loads(path.read_bytes())["outputs"] or {}
        checked = [(value, limit) for value, *limits in outputs.get("checked", ()) for limit in limits]
        for value, limit in zip(outputs.get("values") or (), outputs.get("thresholds") or (), strict=True):
            assert (value, limit) == (0, 0) or limit == own or (value, limit) in checked, path.name
            seen += (value, limit) != (0, 0)
    assert seen > 60


def test_covariance_is_that_of_the_sensing_matrix_at_the_answer() -> None:
    """All rows of two shots at once: red's, green's, blue's."""
    scene = Scene(clean(), clean("A"), lamps=("D55", "A"))
    used = scene.signals.used[0]
    answer = Basis("answer", scene.ssf.values.T, np.zeros((3, WAVELENGTHS.size, 1)), True, "")
    known = linear_model(replace(scene.evidence(), white_tolerance=0.01), answer)
    mine, theirs = signal_covariance(scene.told(), scene.ssf), known.covariance[0]
    n = 3 * 2 * used.sum()
    assert mine.shape == theirs.shape == (n, n)
    # The sensing matrix knows errors times curves on 5-nm nodes and straight between.
    assert np.abs(mine - theirs).max() < 0.01 * np.abs(theirs).max()
    # Of one patch the channels share an error, of two patches they share the white's and the light's alone.
    red, green = np.arange(n // 3), n // 3 + np.arange(n // 3)
    assert (mine[red, green] > 2 * np.abs(mine[red, np.roll(green, 1)])).mean() > 0.8


def test_the_length_of_the_code_by_hand() -> None:
    """Ten directions fully known, none of the others: χ² of ten degrees of freedom."""
    scene = Scene(clean())
    found = drawn_answer(scene)
    K = np.diag(np.repeat([1.0, 0.0], [10, 62]))
    code = np.zeros(72)
    for chance in (0.5, 0.02, 0.001):
        code[0] = chi2.isf(chance, 10) ** 0.5
        exact = replace(found, code=code.reshape(24, 3), code_covariance=np.eye(72) - K)
        assert code_length(exact) == pytest.approx(norm.isf(chance), abs=0.03)
    assert code_length(replace(found, code_covariance=np.eye(72))) is None  # nothing was learned
    assert code_length(replace(found, code_covariance=None)) is None


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
    return recover(scene.evidence(), basis="cameras", settings=SolverSettings(engine="reference"))


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
        found = scene.told().goodness_of_fit_of_shot(0, drawn_answer(scene))
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
