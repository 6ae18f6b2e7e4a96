"""The libraries that run the formulas: NumPy against array-api-strict, torch with its gradients, and the tracer."""

from collections.abc import Mapping
from dataclasses import fields, replace
from importlib.resources import files
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from camssf.grid import Floats
from camssf.recovery.arrays import inverse, namespace, whiten, whiten_and_solve
from camssf.recovery.basis import read_basis
from camssf.recovery.inputs import basis_arrays, hypotheses_of, with_hypothesis
from camssf.recovery.model import learned_model
from camssf.recovery.onnx_model import onnx_runtime, run_session
from camssf.recovery.posterior import evidence_of
from camssf.recovery.rows import Hypotheses
from camssf.recovery.whitening import whitened_model
from camssf_colour.posterior import LinearResponse, components_of, exact_posteriors, posterior_of
from camssf_colour.surface_prior import SurfacePrior, read_prior
from golden.compare import norm
from tests.recovery.test_dense_model import BASES, random_captures
from tests.support.problems import model_inputs, seeds

GAPS = ("gap", "layers_gap")
"""Outputs that are rounding errors."""


def open_model(content: bytes) -> Any:
    """A session whose graph runs as it stands, as the product's does."""
    runtime = onnx_runtime()
    options = runtime.SessionOptions()
    options.graph_optimization_level = runtime.GraphOptimizationLevel.ORT_DISABLE_ALL
    return runtime.InferenceSession(content, options, providers=["CPUExecutionProvider"])


@pytest.mark.requirement("R-ENGINE")
@pytest.mark.parametrize("size", [1, 7])
def test_triangular_systems(size: int) -> None:
    """Σ of its axes and of a number of rows that panels do not divide; leading axes; then the same as a model."""
    rng, h, n = np.random.default_rng(size), 2, 3
    given = {"factor": rng.normal(size=(h, n, size, size + 2)), "columns": rng.normal(size=(h, n, size, 4))}

    def white(given: Any) -> dict[str, Any]:
        sigma, columns = given["factor"] @ given["factor"].mT, given["columns"]
        found, log_det = whiten(sigma, columns, 3)
        again, _, solve = whiten_and_solve(sigma, columns)
        outputs = [found.mT @ found, log_det, again.mT @ again, solve(), *inverse(sigma)]
        return {f"y{i}": y for i, y in enumerate(outputs)}

    sigma, columns = given["factor"] @ given["factor"].mT, given["columns"]
    squares, log_det, _, solved, inverted, *_ = found = [*white(given).values()]
    assert squares == pytest.approx(columns.mT @ np.linalg.solve(sigma, columns), rel=1e-8, abs=1e-8)
    assert log_det == pytest.approx(np.linalg.slogdet(sigma)[1], rel=1e-9, abs=1e-9)
    assert sigma @ solved == pytest.approx(columns, abs=1e-9)
    assert sigma @ inverted == pytest.approx(np.broadcast_to(np.eye(size), sigma.shape), abs=1e-9)

    pytest.importorskip("onnx", reason="onnx is not installed (extra: export)")
    from camssf_onnx.models import traced

    model = traced("f", {"factor": ["h", "n", "q", "p"], "columns": ["h", "n", "q", 4]}, white)
    for y, known in zip(open_model(model.SerializeToString()).run(None, given), found, strict=True):
        np.testing.assert_allclose(y, known, rtol=1e-12, atol=1e-12)


def random_inputs(seed: int) -> dict[str, Floats]:
    """The inputs of a model for a random capture, with penalties that make some of them walk."""
    (observation,) = random_captures(seed)
    name, hard = BASES[seed % 3], seed % 3 == 2
    more = {"l2": 1e-4 if hard else 1.0, "gamma": 0.5 if hard else 0.05, "nonnegative": float(hard)}
    inputs = model_inputs(observation, name) | more | {"explain": 1.0, "solve": 1.0}
    return with_hypothesis(inputs) | basis_arrays(read_basis(name), 24)


def apart(found: Mapping[str, Any], known: Mapping[str, Floats]) -> dict[str, float]:
    return {name: norm(np.asarray(found[name]), known[name]) for name in known if name not in GAPS}


@pytest.mark.requirement("R-ENGINE")
@pytest.mark.parametrize("seed", seeds(9))
def test_the_models_are_the_formulas(seed: int) -> None:
    """Every output of the shipped models against NumPy's, the number of pivots included."""
    from camssf.recovery.onnx_model import load_model

    basis, inputs = read_basis(BASES[seed % 3]), random_inputs(seed)
    known = learned_model(inputs)
    found = run_session(load_model(basis.name).session, inputs)
    assert set(found) == set(known)
    assert max(apart(found, known).values()) < 1e-11


SOURCES = {"curves": 4, "lamp": 2, "reference": 3}
"""Sources of a surface's errors, and how many each has here."""


def surface_arrays(seed: int) -> dict[str, Floats]:
    """A shipped prior, and a random response of one or two photos with its errors, by the names of the models."""
    rng, c = np.random.default_rng(seed), 3 * (1 + seed % 2)
    prior = vars(read_prior(("general", "skin")[seed % 2])).copy()
    del prior["name"]
    signals = rng.random((c, 35)) * np.exp(-0.5 * ((np.arange(35) - rng.uniform(5, 30, (c, 1))) / 4) ** 2)
    signals /= signals.sum(axis=1, keepdims=True)
    y = np.maximum(signals @ (prior["shapes"][seed] * 0.4) * (1 + 0.02 * rng.normal(size=c)), 0.01)
    fine = np.exp(rng.normal(size=(2, 5, c)))
    fine /= fine.mean(axis=2, keepdims=True)
    arrays = prior | {"y": y, "error": 0.01 * y, "fine": fine, "coarse": fine[0, :3], "signals": signals}
    arrays["outputs"] = rng.random((6 + 35 * (seed % 2), 35))
    for source, size in SOURCES.items():
        moved = np.concatenate([signals, np.ones((6, 35))])
        arrays[f"moves by {source}"] = 0.01 * rng.normal(size=(size, c + 6, 35)) * moved
    return arrays


def surface_outputs(arrays: Mapping[str, Any]) -> dict[str, Any]:
    moves, c = [arrays[f"moves by {source}"] for source in SOURCES], arrays["signals"].shape[0]
    joint, ends = namespace(arrays["y"]).concat(moves), np.cumsum([0, *SOURCES.values()]).tolist()
    sources = {name: slice(*rows) for name, rows in zip(SOURCES, pairwise(ends), strict=True)}
    response = LinearResponse(arrays["signals"], joint[:, :c, :], arrays["outputs"], joint[:, c:, :], sources)
    components = components_of(SurfacePrior("", *(arrays[each.name] for each in fields(SurfacePrior)[1:])), response)
    outputs: dict[str, Any] = vars(posterior_of(components, arrays["y"], arrays["error"])).copy()
    exact = vars(exact_posteriors(components, arrays["fine"], arrays["coarse"]))
    return outputs.pop("parts") | outputs | {f"exact {name}": array for name, array in exact.items()}


@pytest.mark.requirement("R-ENGINE")
@pytest.mark.parametrize("library", ["array_api_strict", "torch"])
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(
    ("inputs_of", "formula"),
    [(random_inputs, learned_model), (surface_arrays, surface_outputs)],
    ids=["learned", "surface"],
)
def test_every_library_gives_the_same(inputs_of: Any, formula: Any, seed: int, library: str) -> None:
    """All outputs, the walk's number of pivots included."""
    xp = pytest.importorskip(library, reason=f"{library} is not installed")
    inputs = inputs_of(seed)
    found = formula({name: xp.asarray(np.array(x, float), dtype=xp.float64) for name, x in inputs.items()})
    assert max(apart(found, formula(inputs)).values()) < 1e-10


def run_step(step: str, arrays: Mapping[str, Any]) -> dict[str, Any]:
    """The outputs of a shipped model of surfaces, of those arrays that it takes."""
    session = open_model((files("camssf") / "data" / f"surfaces-{step}.onnx").read_bytes())
    return run_session(session, {one.name: arrays[one.name] for one in session.get_inputs()})


@pytest.mark.requirement("R-ENGINE")
@pytest.mark.parametrize("seed", range(3))
def test_the_surface_as_models(seed: int) -> None:
    """As many surfaces of the prior are kept as in NumPy: they differ from seed to seed."""
    arrays = surface_arrays(seed)
    arrays |= run_step("components", arrays)
    exact = {f"exact {name}": array for name, array in run_step("exact", arrays).items()}
    found, known = run_step("posterior", arrays) | exact, surface_outputs(arrays)
    assert set(found) == set(known)
    assert max(apart(found, known).values()) < 1e-10


def test_exact_signals_are_those_without_noise() -> None:
    """The posterior of one surface leaves out unlikely surfaces of the prior, so it is close, not equal."""
    arrays = surface_arrays(2)
    for i, z in enumerate(arrays["coarse"]):
        known = surface_outputs(arrays | {"y": z, "error": np.zeros(3)})
        covariance = sum(known[name] for name in (*SOURCES, "noise", "metamers"))[-3:, -3:]
        assert norm(known["exact means"][0, i], known["mean"][-3:]) < 1e-4
        assert norm(known["exact covariance"][i], covariance) < 1e-4
        assert norm(known["exact signal_covariance"][i], known["signal_covariance"]) < 1e-4


@pytest.mark.parametrize("seed", [3, 5, 8])
def test_gradients_of_the_evidence_are_those_of_finite_differences(seed: int) -> None:
    """By signals, lamp and dictionary, along a random direction each; with and without modes.

    A hypothesis's evidence, and a slope, may be next to nothing: their bounds are relative to what they are sums of.
    """
    torch = pytest.importorskip("torch", reason="torch is not installed (extra: torch)")
    pytest.importorskip("array_api_compat", reason="array-api-compat is not installed (extra: torch)")

    def tensor(x: Any) -> Any:
        return torch.tensor(np.array(x), dtype=torch.float64)

    def evidences(**changed: Any) -> Any:
        arrays = {field.name: tensor(getattr(evidence, field.name)) for field in fields(Hypotheses)} | changed
        return evidence_of(whitened_model(Hypotheses(**arrays), torch.tensor(0.0)))

    evidence = hypotheses_of(random_captures(seed, h=2), read_basis("phones"))
    known: Floats = evidence_of(whitened_model(evidence, np.array(0.0)))
    assert evidences().numpy() == pytest.approx(known, abs=1e-12 * np.abs(known).max())
    rng = np.random.default_rng(seed)
    for name in ("signals", "lamp", "dictionary"):
        value = getattr(evidence, name)
        leaf = tensor(value).requires_grad_()
        evidences(**{name: leaf}).sum().backward()
        direction = value * rng.normal(size=value.shape)
        parts = leaf.grad.numpy() * direction
        step = 1e-6
        ahead, behind = (
            evidence_of(whitened_model(replace(evidence, **{name: value + sign * step * direction}), np.array(0.0)))
            for sign in (1.0, -1.0)
        )
        slope = float((ahead - behind).sum()) / (2.0 * step)
        assert parts.sum() == pytest.approx(slope, rel=1e-5, abs=1e-6 * np.abs(parts).sum())
