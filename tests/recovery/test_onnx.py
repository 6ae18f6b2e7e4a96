"""The shipped ONNX models: what they are, that they give the reference's numbers, that no other is taken."""

import hashlib
from dataclasses import replace
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
import pytest

from camssf.errors import InvalidArgument, NotConverged
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery import onnx_model
from camssf.recovery.basis import read_basis, widened
from camssf.recovery.observation import Observation
from camssf.recovery.onnx_model import SHIPPED, Model, load_model
from camssf.recovery.prediction import predict, predict_together
from camssf.recovery.sensitivity import Problem, solve_on_basis, solve_together
from camssf.recovery.unnamed_light import by_modes
from camssf.spectra import read_lamp
from golden.compare import blur, norm, optimality
from golden.running import findings, judge, problem, run
from tests.golden.test_golden import CASES as EVERY
from tests.golden.test_golden import by_model, stages_of
from tests.recovery.test_dense_model import BASES, random_captures
from tests.support.dense_model import DenseModel, dense_models
from tests.support.problems import chart_and_lamp, observed, recovered, seeds, theory, toy_camera, whiten

OTHERWISE_COSTLY = ("light/three", "light/other-kind", "light/other-kind-unsure", "calibrate/error-rival-of-four")
"""Cases whose time goes into weighing hypotheses, by the reference whatever solves: test_golden.py runs them, and
Kotlin by the model. What the model then solves here is what it solves in the other cases of these stages."""
CASES = {name: case for name, case in EVERY.items() if by_model(case) and name not in OTHERWISE_COSTLY}
LAMPS = ("D55", "A", "LED-B3", "FL2")
SEEDED = ("cameras", "gaussian", "phones", "gaussian", "ryyb", "gaussian")
"""Bases of the seeded problems, in turn: every even seed has a learned one."""


@cache
def outputs_of_case(name: str) -> dict[str, Any]:
    """What the model gives for a case: run once for all tests."""
    return run(CASES[name], "onnx")


@pytest.mark.numerical
@pytest.mark.parametrize("stage", stages_of(CASES))
def test_golden_cases(stage: str) -> None:
    """Every limit of a stage's cases; where cvxpy solved it, also the model's own code, proved without the model:
    objective not above cvxpy's, gap small, but for what rounding of the reference's rows makes of it."""
    for name, case in CASES.items():
        if case["stage"] != stage:
            continue
        found = findings(case, "onnx") if case["expect"] != "success" else judge(case, outputs_of_case(name))
        assert found, name
        assert not [finding for finding in found if not finding.holds or finding.skipped], name
        if case["stage"] != "ssf" or not case["oracle"]:
            continue
        given, rows = case["inputs"], problem(case)
        codes = outputs_of_case(name)["code"].T.reshape(len(rows.matrix), -1)
        for A, b, sigma, x, known in zip(
            rows.matrix, rows.target, rows.covariance, codes, case["oracle"]["objective"], strict=True
        ):
            objective, gap = optimality(A, b, sigma, x, given["l2"], given["gamma"], given["nonnegative"])
            assert gap <= 1e-9 + blur(A, b, sigma, x, given["l2"], given["gamma"]), name
            assert objective <= known * (1 + 1e-9), name


def seeded(seed: int) -> dict[str, Any]:
    """Arguments of `recover`: a shifted toy camera, one to three lamps, some patches, noise, penalties."""
    rng = np.random.default_rng(seed)
    basis = SEEDED[seed % 4]
    learned = basis != "gaussian"
    shots = int(rng.integers(1, 4)) if learned else 1
    lamps = rng.choice(LAMPS, shots, replace=False)
    order = rng.permutation(24)[: int(rng.choice([6, 9, 12, 18, 24]))]
    R = chart_and_lamp(patches=slice(0, 24))[0][order]
    L = np.stack([chart_and_lamp(str(lamp))[1] for lamp in lamps])
    noise = rng.choice([0.0, 0.005, 0.02])
    y = np.stack([theory(R, lamp, toy_camera(rng.normal(0, 8))) for lamp in L])
    y = np.maximum(y * (1 + noise * rng.normal(size=y.shape)), 0.0)
    known = ((1.0, 0.05), (1.0, 0.5), (0.0, 1.4), (1.0, 0.0)) if learned else ((0.0, 1.0), (1.0, 0.05))
    l2, gamma = known[int(rng.integers(len(known)))]
    return {
        "signals": y, "reflectance": R, "lamp": L, "standard_error": np.hypot(0.005 * y, 0.001),
        "chart_tolerance": float(rng.choice([0.0, 0.03])) if learned else 0.0,
        "lamp_tolerance": float(rng.choice([0.0, 0.02])), "basis": basis, "l2": l2, "gamma": gamma,
        "nonnegative": bool(rng.integers(2)),
    }  # fmt: skip


def of_basis(basis: str) -> dict[str, Any]:
    """Such arguments on this basis."""
    return seeded(SEEDED.index(basis))


def model_inputs_of(observation: Observation, prior_scale: float = 1.0, explain: float = 0.0) -> dict[str, Floats]:
    """The model's inputs for it."""
    y = observation.signals
    modes = observation.lamp_modes if observation.lamp_modes.shape[1] else np.zeros((len(y), 1, WAVELENGTHS.size))
    gains = observation.gain_modes if observation.gain_modes.shape[1] else np.zeros((len(y), 1, y.shape[1]))
    names = ("standard_error", "reflectance", "chart_tolerance", "white_reflectance", "white_tolerance", "lamp",
             "lamp_tolerance", "gain_own")  # fmt: skip
    return {
        "chart": y, "white": np.ones_like(y), "dark": np.zeros_like(y), "lamp_modes": modes, "l2": np.array(1.0),
        "gain_modes": gains, "gamma": np.array(0.05), "nonnegative": np.array(0.0),
        "prior_scale": np.array(prior_scale), "explain": np.array(explain),
    } | {name: np.asarray(getattr(observation, name), float) for name in names}  # fmt: skip


def modes_told(model: Model, observation: Observation, prior_scale: float = 1.0) -> tuple[Floats, Floats]:
    """The model's posterior of the lamps' modes, (k, q) and (k q, k q)."""
    found = model.run(model_inputs_of(observation, prior_scale))
    return found["mode_estimate"], found["mode_covariance"]


def posterior(linear: DenseModel) -> tuple[Floats, Floats]:
    """û = Dᵀ P⁻¹ b and I - Dᵀ P⁻¹ D of the lamp modes, P = Σ + A Aᵀ with D Dᵀ in Σ, by the whole P."""
    D, b = whiten(linear.D, linear.b, linear.sigma + linear.A @ linear.A.T)
    return D.T @ b, np.eye(D.shape[1]) - D.T @ D


def unlike(given: tuple[Floats, Floats], expected: tuple[Floats, Floats]) -> float:
    """How far two posteriors of modes are from each other, in standard deviations of the prior, which are 1."""
    (mean, spread), (other, known) = given, expected
    assert mean.size == other.size
    apart = np.max(np.abs(mean.ravel() - other.ravel())) / max(1.0, np.max(np.abs(other)))
    return float(max(apart, np.max(np.abs(spread - known))))


@pytest.mark.parametrize("seed", seeds(0, 12, 2))
def test_the_posterior_of_the_lamps_modes(seed: int) -> None:
    """Light itself, as `light_of` asks for it: every smooth error is a mode; one shot to three."""
    a = seeded(seed)
    basis, k = a["basis"], len(a["lamp"])
    modes = np.zeros((k, 8, WAVELENGTHS.size))
    modes[-1] = read_lamp("white-led").modes
    given = observed(**a | {"lamp_modes": modes, "lamp_tolerance": 0.02})[0]
    for evidence, scale in ((given, 1.7), (by_modes(given), 1.0)):
        found = modes_told(load_model(basis), evidence, scale)
        assert found[0].shape == evidence.lamp_modes.shape[:2]
        (known,) = dense_models([evidence], widened(read_basis(basis), scale))
        assert unlike(found, posterior(known)) <= 1e-10


@pytest.mark.parametrize("basis", SHIPPED)
def test_budget_and_bands_only_where_the_call_asks_for_them(basis: str) -> None:
    """Without them the call is faster; every other output has the same bits. The paper's basis has neither."""
    given = observed(**of_basis(basis))[0]
    with_, without = (load_model(basis).run(model_inputs_of(given, explain=wanted)) for wanted in (1.0, 0.0))
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
    model, given = load_model(basis), model_inputs_of(observed(**of_basis(basis))[0])
    assert model.session.get_overridable_initializers() == []
    assert {each.name for each in model.session.get_inputs()} == {*given, *model.arrays, "solve"}
    for name in given:
        with pytest.raises(ValueError, match=name):
            model.run({other: value for other, value in given.items() if other != name})


# -- the files, by the onnx package -------------------------------------------------------------------------------


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
def test_another_model_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InvalidArgument, match="shipped"):
        onnx_model.load_model("nonsense")
    onnx_model.load_model.cache_clear()
    monkeypatch.setattr(onnx_model, "VOCABULARY", "2")
    with pytest.raises(InvalidArgument, match="do not belong"):
        onnx_model.load_model("cameras")
    monkeypatch.undo()
    monkeypatch.setattr(onnx_model, "read_basis", lambda name: widened(read_basis(name), 1.01))
    with pytest.raises(InvalidArgument, match="the basis cameras do not belong"):
        onnx_model.load_model("cameras")
    monkeypatch.undo()
    onnx_model._open.cache_clear()
    nowhere = resources.files("camssf") / "nowhere"
    monkeypatch.setattr(onnx_model.resources, "files", lambda package: nowhere)
    with pytest.raises(InvalidArgument, match="Install camssf anew"):
        onnx_model.load_model("cameras")
    monkeypatch.undo()
    onnx_model.load_model.cache_clear()


@pytest.mark.requirement("R-ENGINE")
@pytest.mark.parametrize("which", ["onnx", "reference"])
def test_no_curve_without_its_proof(which: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("camssf.recovery.sensitivity.LARGEST_GAP", -1.0)
    reflectance, lamp = chart_and_lamp("D55", slice(0, 24))
    y = theory(reflectance, lamp, toy_camera())
    with pytest.raises(NotConverged, match="duality gap"):
        recovered(y, reflectance, lamp, standard_error=0.01 * y, engine=which)


@pytest.mark.requirement("R-ENGINE")
def test_a_penalty_that_leaves_nothing_is_refused() -> None:
    reflectance, lamp = chart_and_lamp("D55")
    y = theory(reflectance, lamp, toy_camera())
    for which in ("onnx", "reference"):
        with pytest.raises(NotConverged, match="smaller gamma"):
            recovered(y, reflectance, lamp, basis="gaussian", gamma=1e9, engine=which)


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
