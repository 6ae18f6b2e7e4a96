"""The shipped ONNX models: what they are, that they give the reference's numbers, that no other is taken."""

import hashlib
from dataclasses import replace
from importlib import resources
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from camssf.errors import InvalidArgument, NotConverged
from camssf.grid import WAVELENGTHS
from camssf.recovery import onnx_model
from camssf.recovery.basis import read_basis, widened
from camssf.recovery.observation import Observation
from camssf.recovery.onnx_model import SHIPPED, load_model
from camssf.recovery.prediction import predict, predict_together
from camssf.recovery.sensitivity import Problem, solve_on_basis, solve_together
from camssf.recovery.unnamed_light import by_modes
from camssf.spectra import read_lamp
from golden.compare import blur, norm, optimality
from golden.running import problem
from tests.golden.test_golden import CASES as EVERY
from tests.golden.test_golden import SLOW, failures, outputs_of
from tests.recovery.test_dense_model import BASES, random_captures
from tests.support.dense_model import dense_model
from tests.support.problems import chart_and_lamp, model_inputs, near, recovered, seeds, theory, toy_camera, whiten

OTHERWISE_COSTLY = (
    "light/three", "light/other-kind", "light/other-kind-unsure", "light/called-kelvin", "light/faded", "light/two",
    "light/told-of-two", "calibrate/error-rival-of-four", "calibrate/auto-other-maker",
)  # fmt: skip
"""Cases whose time goes into weighing hypotheses, by the reference whatever solves: golden's own check runs them, and
Kotlin by the model. What the model then solves here is what it solves in the other cases of these stages."""
CASES = {name: case for name, case in EVERY.items() if "model" in case["requires"] and name not in OTHERWISE_COSTLY}
STAGES = sorted({case["stage"] for case in CASES.values()})


@pytest.mark.numerical
@pytest.mark.parametrize(
    "stage", [pytest.param(stage, marks=pytest.mark.full if stage in SLOW else ()) for stage in STAGES]
)
def test_golden_cases(stage: str) -> None:
    assert not failures([name for name, case in CASES.items() if case["stage"] == stage], "onnx")


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case["stage"] == "ssf" and case["oracle"]])
def test_the_code_is_proven_without_the_model(name: str) -> None:
    """Objective not above cvxpy's, gap small, but for what rounding of the reference's rows makes of it."""
    case, rows = CASES[name], problem(CASES[name])
    l2, gamma, nonnegative = (case["inputs"][key] for key in ("l2", "gamma", "nonnegative"))
    codes, least = outputs_of(name, "onnx")["code"].T.reshape(len(rows.matrix), -1), case["oracle"]["objective"]
    for A, b, sigma, x, known in zip(rows.matrix, rows.target, rows.covariance, codes, least, strict=True):
        objective, gap = optimality(A, b, sigma, x, l2, gamma, nonnegative)
        assert gap <= 1e-9 + blur(A, b, sigma, x, l2, gamma)
        assert objective <= known * (1 + 1e-9)


@pytest.mark.parametrize("seed", seeds(6))
def test_the_posterior_of_the_lamps_modes(seed: int) -> None:
    """û = Dᵀ P⁻¹ b and I - Dᵀ P⁻¹ D with P = Σ + A Aᵀ; of an LED's modes, and of every smooth error."""
    (given,), basis = random_captures(seed), BASES[seed % 3]
    modes = np.zeros((len(given.lamp), 8, WAVELENGTHS.size))
    modes[-1] = read_lamp("white-led").modes
    given = replace(given, lamp_modes=modes, lamp_tolerance=np.full(len(modes), 0.02))
    for evidence, scale in ((given, 1.7), (by_modes(given), 1.0)):
        found = load_model(basis).run(model_inputs(evidence, basis) | {"prior_scale": np.array(scale)})
        known = dense_model(evidence, widened(read_basis(basis), scale))
        D, b = whiten(known.D, known.b, known.sigma + known.A @ known.A.T)
        assert found["mode_estimate"].shape == evidence.lamp_modes.shape[:2]
        assert norm(found["mode_estimate"].ravel(), D.T @ b) <= 1e-10
        assert near(found["mode_covariance"], np.eye(D.shape[1]) - D.T @ D, abs=1e-10)


def toy() -> Observation:
    """That every model takes: one photo of twelve patches."""
    reflectance, lamp = chart_and_lamp()
    y = theory(reflectance, lamp, toy_camera())
    return Observation(y, reflectance, lamp, standard_error=0.01 * y)


@pytest.mark.parametrize("basis", SHIPPED)
def test_budget_and_bands_only_where_the_call_asks_for_them(basis: str) -> None:
    """Without them the call is faster; every other output has the same bits. The paper's basis has neither."""
    given = model_inputs(toy(), basis)
    with_, without = (load_model(basis).run(given | {"explain": np.array(wanted)}) for wanted in (1.0, 0.0))
    for name in ("budget", "predicted_std"):
        assert with_[name].shape == without[name].shape
        assert np.isfinite(with_.pop(name)).all() == (basis != "gaussian")
        assert np.isnan(without.pop(name)).all()
    assert {name: value.tobytes() for name, value in with_.items()} == {
        name: value.tobytes() for name, value in without.items()
    }


@pytest.mark.parametrize("basis", SHIPPED)
def test_every_input_must_be_given(basis: str) -> None:
    """No input has a default: ONNX Runtime for Java takes no value for one that has."""
    model, given = load_model(basis), model_inputs(toy(), basis)
    assert model.session.get_overridable_initializers() == []
    assert {each.name for each in model.session.get_inputs()} == {*given, *model.arrays, "solve"}
    for name in given:
        with pytest.raises(ValueError, match=name):
            model.run({other: value for other, value in given.items() if other != name})


@pytest.mark.full
def test_check_passes(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("onnx", reason="onnx is not installed (extra: export)")
    from camssf_onnx.__main__ import main

    assert main(["check"]) == 0
    out = capsys.readouterr().out
    assert out.count("the same bytes") == 10  # models: three of the calibration, five of surfaces; bases and spaces
    assert out.splitlines()[-1] == "10 passed, 0 failed"


@pytest.mark.requirement("R-ENGINE")
@pytest.mark.parametrize("name", onnx_model.SHIPPED)
def test_a_shipped_model_belongs_to_its_basis(name: str) -> None:
    model, basis = onnx_model.load_model(name), read_basis(name)
    file = "gaussian" if name == "gaussian" else "learned"
    content = (resources.files("camssf") / "data" / f"camssf-{file}.onnx").read_bytes()
    assert model.sha256 == hashlib.sha256(content).hexdigest()
    assert len(content) <= 400_000
    assert model.metadata["basis_sha256"] == basis.sha256()
    assert model.metadata["grid"] == "380 to 720 nm every 0.5 nm"


@pytest.mark.requirement("R-ENGINE")
@pytest.mark.parametrize(
    ("name", "other", "words"),
    [
        ("VOCABULARY", "2", "do not belong"),
        ("read_basis", lambda name: widened(read_basis(name), 1.01), "the basis cameras do not belong"),
        ("resources", SimpleNamespace(files=lambda _: resources.files("camssf") / "nowhere"), "Install camssf anew"),
    ],
)
def test_another_model_is_refused(name: str, other: Any, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InvalidArgument, match="shipped"):
        onnx_model.load_model("nonsense")
    for kept in (onnx_model.load_model, onnx_model._open):
        kept.cache_clear()
    monkeypatch.setattr(onnx_model, name, other)
    with pytest.raises(InvalidArgument, match=words):
        onnx_model.load_model("cameras")


@pytest.mark.requirement("R-ENGINE")
@pytest.mark.parametrize("which", ["onnx", "reference"])
def test_no_curve_without_its_proof(which: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("camssf.recovery.sensitivity.LARGEST_GAP", -1.0)
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    with pytest.raises(NotConverged, match="duality gap"):
        recovered(y, reflectance, lamp, standard_error=0.01 * y, engine=which)


@pytest.mark.requirement("R-ENGINE")
@pytest.mark.parametrize("seed", seeds(1, 10, quick=1))
def test_folds_solved_together_are_those_of_each_without_its_patches(seed: int) -> None:
    """Curves, predictions of the left-out patches and their bands: a mask is as good as leaving out."""
    (given,) = random_captures(seed)
    basis, n = BASES[seed % 3], len(given.reflectance)
    used = np.ones(given.signals.shape[:2], dtype=bool) if given.used is None else given.used
    masks = [used & (np.arange(n) % 4 != fold) for fold in range(4)]
    observations = [replace(given, used=mask) for mask in masks]
    answers = solve_together([Problem(observation, basis) for observation in observations])
    bands = predict_together(answers, observations, basis=basis)
    for mask, found, band in zip(masks, answers, bands, strict=True):
        kept = mask.any(axis=0)
        gains = given.gain_modes
        alone = replace(
            given, signals=given.signals[:, kept], reflectance=given.reflectance[kept], used=mask[:, kept],
            standard_error=None if given.standard_error is None else given.standard_error[:, kept],
            chart_tolerance=given.chart_tolerance[kept], gain_modes=gains[:, :, kept],
        )  # fmt: skip
        expected = solve_on_basis(alone, basis)
        assert np.abs(found.values - expected.values).max() <= 1e-9 * expected.values.max()
        assert norm(found.lamp, expected.lamp) <= 1e-9
        std = predict(
            expected, alone, of=given.reflectance[~kept], of_tolerance=given.chart_tolerance[~kept],
            of_gains=gains[:, :, ~kept], basis=basis,
        ).std  # fmt: skip
        assert band.std[:, ~kept] == pytest.approx(std[:, kept.sum() :], rel=1e-9)
        assert band.std[:, kept] == pytest.approx(std[:, : kept.sum()], rel=1e-9)
