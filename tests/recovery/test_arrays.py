"""The libraries that run the formulas: NumPy against array-api-strict, torch and the tracer of `camssf_onnx`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from importlib.resources import files
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from benchmarks.problems import open_model
from camssf.grid import Floats
from camssf.recovery import covariance
from camssf.recovery.arrays import inverse, namespace, whiten, whiten_and_solve
from camssf.recovery.basis import fold, interpolate, read_basis
from camssf.recovery.causes import ChartScene, cause_evidences
from camssf.recovery.drift import UnitShots, drift_evidences
from camssf.recovery.inputs import basis_arrays, hypotheses_of, observation_arrays, with_hypothesis
from camssf.recovery.misfit import AnswerBasis, JudgedSignals, misfit
from camssf.recovery.model import learned_model, paper_model
from camssf.recovery.onnx_model import run_session
from camssf.recovery.posterior import evidence_of
from camssf.recovery.sensitivity import SolverSettings, solve_on_basis
from camssf.recovery.whitening import whitened_model
from camssf.spectra import read_lamp
from camssf_colour import Reference, View, light, response
from camssf_colour.camera import OwnWhite
from camssf_colour.posterior import LinearResponse, components_of, means_of, posterior_of
from camssf_colour.surface_prior import SurfacePrior, read_prior
from golden.compare import norm
from tests.colour.test_colour import blurred
from tests.recovery.test_dense_model import BASES, random_captures
from tests.support.problems import seeds

pytestmark = pytest.mark.requirement("R-ENGINE")

GAPS = ("gap", "layers_gap")
"""Outputs that are rounding errors."""


def ran(function: Callable[..., Any], axes: Mapping[str, list[str | int]], **inputs: Any) -> list[Floats]:
    """What the model of a function gives; `axes` names the inputs' axes."""
    pytest.importorskip("onnx", reason="onnx is not installed (extra: export)")
    from camssf_onnx.models import traced

    def by_name(given: Any) -> Any:
        found = function(**given)
        return {f"y{i}": y for i, y in enumerate(found if isinstance(found, list) else [found])}

    model = traced("f", axes, by_name).SerializeToString()
    return open_model(model).run(None, {name: np.asarray(value, float) for name, value in inputs.items()})  # type: ignore[no-any-return]


def agree(function: Callable[..., Any], axes: Mapping[str, list[str | int]], **inputs: Any) -> None:
    """The model of a function gives what the function gives on NumPy."""
    found, expected = ran(function, axes, **inputs), function(**inputs)
    for y, known in zip(found, expected if isinstance(expected, list) else [expected], strict=True):
        assert y.shape == np.shape(known)
        np.testing.assert_allclose(y, known, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("size", [1, 3, 6, 7, 13])
def test_triangular_systems(size: int) -> None:
    """Σ of its axes and of a number of rows that panels do not divide; leading axes."""
    rng, h, n = np.random.default_rng(size), 2, 3
    factor, columns = rng.normal(size=(h, n, size, size + 2)), rng.normal(size=(h, n, size, 4))

    def white(factor: Any, columns: Any) -> list[Any]:
        sigma = factor @ factor.mT
        found, log_det = whiten(sigma, columns, 3)
        again, _, solve = whiten_and_solve(sigma, columns)
        return [found.mT @ found, log_det, again.mT @ again, solve(), *inverse(sigma)]

    agree(white, {"factor": ["h", "n", "q", "p"], "columns": ["h", "n", "q", 4]}, factor=factor, columns=columns)
    sigma = factor @ factor.mT
    found = white(factor, columns)
    assert found[0] == pytest.approx(columns.mT @ np.linalg.solve(sigma, columns), rel=1e-8, abs=1e-8)
    assert found[1] == pytest.approx(np.linalg.slogdet(sigma)[1], rel=1e-9, abs=1e-9)
    assert sigma @ found[3] == pytest.approx(columns, abs=1e-9)
    assert sigma @ found[4] == pytest.approx(np.broadcast_to(np.eye(size), sigma.shape), abs=1e-9)


def test_interpolation_and_its_adjoint() -> None:
    rng = np.random.default_rng(0)
    f, s = rng.normal(size=(2, 3, 681)), rng.normal(size=(69, 1))
    agree(lambda f: fold(f), {"f": [2, "n", 681]}, f=f)
    agree(lambda s: interpolate(s), {"s": [69, "n"]}, s=s)
    assert fold(f) @ s[:, 0] == pytest.approx(f @ interpolate(s)[:, 0], rel=1e-12)
    assert fold(f, f) == pytest.approx(fold(f * f), rel=1e-14)


@pytest.mark.parametrize(
    ("function", "reason"),
    [
        (lambda x, y: x @ x, "no product"),
        (lambda x, y: x + x.mT, "do not fit together"),
        (lambda x, y: x if x else y, "has no truth"),
        (lambda x, y: x if x.shape[0] == 1 else y, "cannot be compared"),
        (lambda x, y: x if x.shape[0] else y, "no truth"),
        (lambda x, y: namespace(x).reshape(x, (x.shape[0], 4)), "cannot have the shape"),
        (lambda x, y: namespace(x).concat([x, y[0, ...].mT], axis=0), "cannot be joined"),
        (lambda x, y: y[..., 0] + x, "only if c is 1"),
        (lambda x, y: x**3, "only squares"),
        (lambda x, y: x[::2, ...], "in steps"),
        (lambda x, y: namespace(x).cumsum(x), "cumsum"),
    ],
)
def test_what_cannot_be_traced_says_so(function: Any, reason: str) -> None:
    with pytest.raises((TypeError, ValueError, AttributeError), match=reason):
        ran(function, {"x": ["k", "n"], "y": ["c", "k", "n"]}, x=np.ones((2, 3)), y=np.ones((1, 2, 3)))


def test_sizes_are_polynomials() -> None:
    pytest.importorskip("onnx", reason="onnx is not installed (extra: export)")
    from camssf_onnx.sizes import Dim, broadcast, same

    k, n, h, e = (Dim({(name,): 1}) for name in "knhe")
    size: Any = 3 * k * n + k * 2 - 1
    assert repr(size) == "-1 + 2·k + 3·k·n"
    assert same(size - size, 0)
    assert same((k + n) * (k - n), k * k - n * n)
    assert not same(k, 1)
    assert broadcast((e, 1, k), (h, n, 1)) == (h, n, k)
    with pytest.raises(ValueError, match="only if e is 1"):
        broadcast((e,), (k,))


# The formulas as a whole


def model_inputs(seed: int, **more: Any) -> dict[str, Floats]:
    """The inputs of a model for a random capture, with penalties that make some of them walk."""
    (observation,) = random_captures(seed)
    y, hard = observation.signals, seed % 3 == 2
    inputs = observation_arrays(observation, read_basis(BASES[seed % 3])) | {
        "chart": y, "white": np.ones_like(y), "dark": np.zeros_like(y), "l2": 1e-4 if hard else 1.0,
        "gamma": 0.5 if hard else 0.05, "nonnegative": float(hard), "prior_scale": 1.0, "explain": 1.0, "solve": 1.0,
    } | more  # fmt: skip
    return with_hypothesis(inputs) | basis_arrays(read_basis(BASES[seed % 3]), 24)


def apart(found: Mapping[str, Any], known: Mapping[str, Floats]) -> dict[str, float]:
    """How far each output is from another run's."""
    return {name: norm(np.asarray(found[name]), known[name]) for name in known if name not in GAPS}


def judged_inputs(seed: int) -> dict[str, Floats]:
    """`JudgedSignals`, `AnswerBasis`, `UnitShots` and `ChartScene` of a random capture and its answer.

    Some patches do not count, there are three fields of light, and the first shot is new; an even seed has a white
    frame.
    """
    (observation,) = random_captures(seed)
    rng, (k, n, _) = np.random.default_rng(seed), observation.signals.shape
    basis, white = read_basis(BASES[seed % 3]), np.zeros(n)
    answer = solve_on_basis(observation, basis, settings=SolverSettings(engine="reference"))
    arrays = {name: np.asarray(x, float) for name, x in observation_arrays(observation, basis).items()}
    white[0] = seed % 2
    raw_white = (answer.lamp * arrays["white_reflectance"]) @ answer.values
    return arrays | {
        "signals": observation.signals, "predicted": answer.predicted, "curves": answer.values, "code": answer.code,
        "lamp": answer.lamp, "used": (rng.random((k, n)) > 0.1).astype(float),
        "level": rng.uniform(0.3, 1.0, (k, n, 3)),
        "fields": rng.normal(size=(3, k, n)), "new": (np.arange(k) < 1).astype(float),
        "raw_white": raw_white * np.exp(0.01 * rng.normal(size=raw_white.shape)), "first_lamp": answer.lamp[0],
        "places": rng.uniform(-0.5, 0.5, (n, 2)), "reference": white,
        "tables": np.clip(arrays["reflectance"] + rng.normal(0, 0.02, (2, n, 1)), 0.01, 1.0),
    } | {name: x[0] for name, x in basis_arrays(basis, 24).items()}  # fmt: skip


def judged_outputs(arrays: Mapping[str, Any], explain: float = 1.0) -> dict[str, Any]:
    """The misfit, the drift and the causes of a capture."""
    signals, basis, shots, scene = (
        kind(**{field.name: arrays[field.name] for field in fields(kind)})
        for kind in (JudgedSignals, AnswerBasis, UnitShots, ChartScene)
    )
    xp = namespace(signals.signals)
    causes = dict(zip(("cause", "cause_patch"), vars(cause_evidences(signals, basis, scene)).values(), strict=True))
    drift = drift_evidences(signals, basis, shots)
    return vars(misfit(signals, xp.asarray(explain, dtype=xp.float64))) | {"drift": drift} | causes


def paper_inputs(seed: int) -> dict[str, Floats]:
    """Of one shot."""
    inputs = model_inputs(seed, l2=1e-3)
    first = ("chart", "white", "dark", "standard_error", "gain_modes")
    second = ("lamp", "lamp_modes")
    return inputs | {name: inputs[name][:1] for name in first} | {name: inputs[name][:, :1] for name in second}


def paper_outputs(inputs: Mapping[str, Any]) -> dict[str, Any]:
    xp, atoms = namespace(inputs["chart"]), read_basis("gaussian").dictionary[0]
    found = paper_model(inputs, xp.asarray(np.array(atoms), dtype=xp.float64))
    return {name: found[name] for name in ("ssf", "code", "predicted", "finish_steps")}


@pytest.mark.parametrize("seed", seeds(9))
def test_the_models_are_the_formulas(seed: int) -> None:
    """Every output of the shipped models against NumPy's, the number of pivots included."""
    from camssf.recovery.onnx_model import load_model

    basis, inputs = read_basis(BASES[seed % 3]), model_inputs(seed)
    known = learned_model(inputs)
    found = run_session(load_model(basis.name).session, inputs)
    assert set(found) == set(known)
    assert max(apart(found, known).values()) < 1e-11


@pytest.fixture(scope="module")
def verdict_session() -> Any:
    pytest.importorskip("onnx", reason="onnx is not installed (extra: export)")
    from camssf_onnx.models import build_verdict

    return open_model(build_verdict().SerializeToString())


@pytest.mark.parametrize("seed", seeds(9))
def test_the_verdict_as_a_model(verdict_session: Any, seed: int) -> None:
    arrays = judged_inputs(seed)
    given = {one.name: arrays[one.name] for one in verdict_session.get_inputs() if one.name in arrays}
    for explain in (1.0, 0.0):
        known = judged_outputs(arrays, explain)
        names = [name for name in known if explain or not name.startswith("cause")]
        flags = {"explain": np.array(explain), "weigh": np.array(explain)}
        for name, value in zip(names, verdict_session.run(names, given | flags), strict=True):
            np.testing.assert_allclose(value, known[name], rtol=1e-9, atol=1e-12 if name != "cause" else 1e-9,
                                       err_msg=name)  # fmt: skip
    off = {"explain": np.array(0.0), "weigh": np.array(0.0), "new": 0.0 * given["new"]}
    for nothing in verdict_session.run(["drift", "cause", "cause_patch"], given | off):
        assert np.isnan(nothing).all()


SOURCES = {"curves": 4, "lamp": 2, "reference": 3}
"""Sources of a surface's errors, and how many each has here."""


OF_PRIOR = ("shapes", "variances", "shared", "changes", "log_weights")
"""Arrays of a prior, as its class has them."""


def surface_arrays(seed: int) -> dict[str, Floats]:
    """A shipped prior, and a random response of one or two photos with its errors, by the names of the models."""
    rng, c = np.random.default_rng(seed), 3 * (1 + seed % 2)
    prior = vars(read_prior(("general", "skin")[seed % 2])).copy()
    del prior["name"]
    signals = rng.random((c, 35)) * np.exp(-0.5 * ((np.arange(35) - rng.uniform(5, 30, (c, 1))) / 4) ** 2)
    signals /= signals.sum(axis=1, keepdims=True)
    y = np.maximum(signals @ (prior["shapes"][seed] * 0.4) * (1 + 0.02 * rng.normal(size=c)), 0.01)
    arrays = prior | {"y": y, "error": 0.01 * y, "z": np.exp(rng.normal(size=(2, 5, c))), "signals": signals}
    arrays["z"] /= arrays["z"].mean(axis=2, keepdims=True)
    arrays["outputs"] = rng.random((6 + 35 * (seed % 2), 35))
    for source, size in SOURCES.items():
        moved = np.concatenate([signals, np.ones((6, 35))])
        arrays[f"moves by {source}"] = 0.01 * rng.normal(size=(size, c + 6, 35)) * moved
    return arrays


def surface_outputs(arrays: Mapping[str, Any]) -> dict[str, Any]:
    """What the formulas give."""
    moves, c = [arrays[f"moves by {source}"] for source in SOURCES], arrays["signals"].shape[0]
    joint, ends = namespace(arrays["y"]).concat(moves), np.cumsum([0, *SOURCES.values()]).tolist()
    sources = {name: slice(*rows) for name, rows in zip(SOURCES, pairwise(ends), strict=True)}
    response = LinearResponse(arrays["signals"], joint[:, :c, :], arrays["outputs"], joint[:, c:, :], sources)
    components = components_of(SurfacePrior("", *(arrays[name] for name in OF_PRIOR)), response)
    outputs: dict[str, Any] = vars(posterior_of(components, arrays["y"], arrays["error"])).copy()
    return outputs.pop("parts") | outputs | {"means": means_of(components, arrays["z"])}


FORMULAS: dict[str, tuple[Callable[[int], dict[str, Floats]], Callable[[Any], dict[str, Any]], float]] = {
    "learned": (model_inputs, learned_model, 1e-10),
    "paper": (paper_inputs, paper_outputs, 1e-9),
    "verdict": (judged_inputs, judged_outputs, 1e-9),
    "surface": (surface_arrays, surface_outputs, 1e-10),
}
"""Inputs by seed, the formulas, and how far two libraries may be apart."""


@pytest.mark.parametrize("library", ["array_api_strict", "torch"])
@pytest.mark.parametrize("seed", [0, 1, 2])
@pytest.mark.parametrize("name", FORMULAS)
def test_every_library_gives_the_same(name: str, seed: int, library: str) -> None:
    """All outputs, the walk's number of pivots included."""
    xp = pytest.importorskip(library, reason=f"{library} is not installed")
    inputs_of, formula, most = FORMULAS[name]
    inputs = inputs_of(seed)
    found = formula({name: xp.asarray(np.array(x, float), dtype=xp.float64) for name, x in inputs.items()})
    assert max(apart(found, formula(inputs)).values()) < most


def run_step(step: str, arrays: Mapping[str, Any]) -> dict[str, Any]:
    """The outputs of a shipped model of surfaces, of those arrays that it takes."""
    session = open_model((files("camssf") / "data" / f"surfaces-{step}.onnx").read_bytes())
    return run_session(session, {one.name: arrays[one.name] for one in session.get_inputs()})


@pytest.mark.parametrize("seed", range(6))
def test_the_surface_as_models(seed: int) -> None:
    """As many surfaces of the prior are kept as in NumPy: they differ from seed to seed."""
    arrays = surface_arrays(seed)
    arrays |= run_step("components", arrays)
    found, known = run_step("posterior", arrays) | run_step("means", arrays), surface_outputs(arrays)
    assert set(found) == set(known)
    assert max(apart(found, known).values()) < 1e-10


@pytest.mark.parametrize("seed", range(6))
def test_the_lights_as_a_model(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """One photo or two, with ratios or without, each with its own lamp."""
    rng, calls = np.random.default_rng(seed), dict[str, Any]()
    camera = replace(blurred(), own=OwnWhite(np.array([0.6, 1.0, 0.7]), read_lamp("D55")))
    lamps = [read_lamp(name) for name in (("daylight",), ("white-led", "A"))[seed % 2]]
    ratios = [rng.normal(scale=0.1, size=2) if j + seed // 2 != 1 else None for j in range(len(lamps))]

    def remembered(name: str, function: Any) -> Any:
        def call(*given: Any) -> Any:
            calls[name] = given, function(*given)
            return calls[name][1]

        return call

    monkeypatch.setattr(light, "condition", remembered("condition", light.condition))
    monkeypatch.setattr(response, "response_of", remembered("response", response.response_of))
    lights = light.see_together(camera, lamps, ratios, [0.005] * len(lamps))
    view = View(("1931", "1964")[seed % 2], ("lamp", "D50", "D65")[seed % 3])
    response.surface_response(lights, [Reference()] * len(lamps), view, reflectance=False)
    ((lit,), conditioned), ((_, _, viewed), answer) = calls["condition"], calls["response"]
    known = vars(answer).copy()
    known |= {f"moves by {source}": moves for source, moves in known.pop("moves").items()}
    known |= {name: getattr(conditioned, name) for name in ("log_evidence", "chi_squared")}
    found = run_step("lights", vars(lit) | vars(viewed))
    assert set(found) == set(known)
    for name, value in known.items():
        np.testing.assert_allclose(found[name], value, rtol=1e-9, atol=1e-12, err_msg=name)


def test_one_line_changes_every_engine(monkeypatch: pytest.MonkeyPatch) -> None:
    """The chart's correlation length, which one line states: NumPy, torch and a new model follow."""
    pytest.importorskip("onnx", reason="onnx is not installed (extra: export)")
    torch = pytest.importorskip("torch", reason="torch is not installed (extra: torch)")
    from camssf_onnx.models import build_learned

    basis, inputs = read_basis("phones"), model_inputs(0, solve=0.0)
    known = learned_model(inputs)["evidence"]
    monkeypatch.setattr(covariance, "CHART_CORRELATION", 50.0)
    changed = evidence_of(whitened_model(hypotheses_of(random_captures(0), basis), np.array(0.0)))
    assert abs(changed - known) > 1e-3
    session = open_model(build_learned().SerializeToString())
    assert session.run(["evidence"], inputs)[0] == pytest.approx(changed, rel=1e-10)
    tensors = {name: torch.tensor(np.array(x, float)) for name, x in inputs.items()}
    assert learned_model(tensors)["evidence"].numpy() == pytest.approx(changed, rel=1e-10)
