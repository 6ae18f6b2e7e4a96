"""The shipped ONNX models: what they are, and that they give the reference's numbers and keep the oracle's."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

from benchmarks.claims.certify import model_rows, row_reader
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery import model as formulas
from camssf.recovery.basis import read_basis, widened
from camssf.recovery.budget import explain
from camssf.recovery.covariance import SOURCES
from camssf.recovery.evidence import log_evidences
from camssf.recovery.inputs import OF_HYPOTHESES
from camssf.recovery.observation import Observation
from camssf.recovery.onnx_model import SHIPPED, Model, load_model, onnx_runtime
from camssf.recovery.optimum import optimum
from camssf.recovery.prediction import predict
from camssf.recovery.sensitivity import SolverSettings, Ssf, solve_on_basis
from camssf.recovery.unnamed_light import by_modes
from camssf.spectra import read_lamp
from golden.compare import blur, norm, optimality, peak
from golden.linear_model import LinearModel, linear_model
from golden.products import model_inputs
from golden.reading import paths, read_case
from golden.running import _complete, arrays, by_model, findings, judge, problem, run
from golden.stages.layers import layers
from tests.support.problems import (
    chart_and_lamp,
    observed,
    recovered,
    seeds,
    theory,
    toy_camera,
    whiten,
    whiten_in_80_bits,
)

EVERY = {f"{path.parent.name}/{path.stem}": read_case(path) for path in paths()}
CASES = {name: case for name, case in EVERY.items() if by_model(case)}
LAMPS = ("D55", "A", "LED-B3", "FL2")
SEEDED = ("cameras", "gaussian", "phones", "gaussian", "ryyb", "gaussian")
"""Bases of the seeded problems, in turn: every even seed has a learned one."""


@cache
def outputs_of_case(name: str) -> dict[str, Any]:
    """What the model gives for a case: run once for all tests."""
    return run(CASES[name], "onnx")


@pytest.mark.parametrize("stage", sorted({case["stage"] for case in CASES.values()}))
def test_golden_cases(stage: str) -> None:
    """Every limit of the stage's cases; where cvxpy solved it, also the model's own code, proved without the model:
    objective not above cvxpy's, gap small, but for what rounding of the reference's rows makes of it."""
    for name in [name for name, case in CASES.items() if case["stage"] == stage]:
        case = CASES[name]
        if case["expect"] != "success":
            found = findings(case, "onnx")
        else:
            found = [*judge(case, outputs_of_case(name)), *_complete(case, outputs_of_case(name))]
        assert found, name
        assert not [finding for finding in found if not finding.holds or finding.skipped], name
        if stage != "ssf" or not case["oracle"]:
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
        "signals": y,
        "reflectance": R,
        "lamp": L,
        "standard_error": np.hypot(0.005 * y, 0.001),
        "chart_tolerance": float(rng.choice([0.0, 0.03])) if learned else 0.0,
        "lamp_tolerance": float(rng.choice([0.0, 0.02])),
        "basis": basis,
        "l2": l2,
        "gamma": gamma,
        "nonnegative": bool(rng.integers(2)),
    }


def both(arguments: dict[str, Any]) -> tuple[Ssf, Ssf]:
    return recovered(**arguments, engine="onnx"), recovered(**arguments, engine="reference")


@pytest.mark.parametrize("seed", seeds(60))
def test_seeded_problems(seed: int) -> None:
    onnx, reference = both(seeded(seed))
    assert (onnx.engine, reference.engine) == ("onnx", "reference")
    assert onnx.proof.gap.max() <= 1e-9
    assert reference.proof.gap.max() <= 1e-9
    assert norm(onnx.values, reference.values) <= 1e-10
    assert norm(onnx.predicted, reference.predicted) <= 1e-10
    assert norm(onnx.lamp, reference.lamp) <= 1e-10
    if reference.std is None:
        assert onnx.std is None
    else:
        assert norm(onnx.std, reference.std) <= 1e-10


@pytest.mark.parametrize("seed", seeds(0, 24, 2))
def test_lamps_of_a_family(seed: int) -> None:
    """As above, told of one lamp or all that they are any white LED or daylight: two turns of the outer loop."""
    a = seeded(seed)
    k = len(a["lamp"])
    modes = np.zeros((k, 8, WAVELENGTHS.size))
    modes[-1] = read_lamp("white-led").modes
    if seed % 4:
        modes[0, 0] = read_lamp("daylight").modes[0]
    onnx, reference = both(a | {"lamp_modes": modes})
    for name in ("values", "predicted", "std"):
        assert norm(getattr(onnx, name), getattr(reference, name)) <= 1e-10
    assert norm(onnx.lamp, reference.lamp) <= 1e-10
    assert max(onnx.proof.gap.max(), reference.proof.gap.max()) <= 1e-9
    assert norm(onnx.lamp[-1], a["lamp"][-1]) > 1e-3


def far(seed: int) -> dict[str, Any]:
    """Arguments whose lamps are told as anything: humps up to 300 times the lamp, exact signals, 30 % tolerance."""
    a = seeded(2 * seed)
    rng = np.random.default_rng([77, seed])
    k, q, size = len(a["lamp"]), int(rng.integers(1, 7)), 10 ** rng.uniform(-0.5, 2.5)
    centre, width = rng.uniform(400, 700, (2, k, q, 1)), rng.uniform(10, 60, (k, q, 1))
    modes = size * rng.normal(size=(k, q, 1)) * np.exp(-0.5 * ((WAVELENGTHS - centre[0]) / width) ** 2)
    floor = a["standard_error"] * rng.choice([0.0, 0.1])
    return a | {"lamp_modes": modes, "lamp_tolerance": 0.3, "standard_error": floor}


@pytest.mark.parametrize("seed", seeds(40))
def test_engines_agree_as_far_as_the_last_place_of_the_inputs_tells(seed: int) -> None:
    """Lamps so loose that the first look's condition is 1e12 and more: no engine adds to what one unit in the last
    place of the inputs does. An explicit inverse in the reference did, by up to 1e-2 of the peak."""
    a = far(seed)
    onnx, reference = both(a)
    rng = np.random.default_rng(seed)
    inherent = 0.0
    for _ in range(3):
        given = {name: a[name] for name in ("signals", "reflectance", "lamp")}
        moved = {name: x * (1 + 2.0**-52 * rng.integers(-1, 2, x.shape)) for name, x in given.items()}
        inherent = max(inherent, norm(recovered(**a | moved, engine="onnx").values, onnx.values))
    assert max(onnx.proof.gap.max(), reference.proof.gap.max()) <= 1e-9
    assert norm(onnx.values, reference.values) <= 30 * inherent + 1e-10


def outputs_of(
    model: Model, observation: Observation, prior_scale: float = 1.0, explain: float = 1.0
) -> dict[str, Floats]:
    """All outputs of the model for an observation without a mask."""
    return model.run(model_inputs_of(observation, prior_scale, explain))


def model_inputs_of(observation: Observation, prior_scale: float, explain: float) -> dict[str, Floats]:
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
    found = outputs_of(model, observation, prior_scale)
    return found["mode_estimate"], found["mode_covariance"]


def posterior(linear: LinearModel) -> tuple[Floats, Floats]:
    """û = Dᵀ P⁻¹ b and I - Dᵀ P⁻¹ D of the lamp modes, P = Σ + A Aᵀ with D Dᵀ in Σ, by the whole P."""
    A, b, D = linear.matrix[0], linear.target[0], linear.modes
    D, b = whiten(D, b, linear.covariance[0] + A @ A.T)
    return D.T @ b, np.eye(D.shape[1]) - D.T @ D


def unlike(given: tuple[Floats, Floats], expected: tuple[Floats, Floats]) -> float:
    """How far two posteriors of modes are from each other, in standard deviations of the prior, which are 1."""
    (mean, spread), (other, known) = given, expected
    assert mean.size == other.size
    apart = np.max(np.abs(mean.ravel() - other.ravel())) / max(1.0, np.max(np.abs(other)))
    return float(max(apart, np.max(np.abs(spread - known))))


@pytest.mark.parametrize("seed", seeds(0, 24, 2))
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
        assert unlike(found, posterior(linear_model(evidence, widened(read_basis(basis), scale)))) <= 1e-10


@pytest.mark.parametrize("seed", seeds(0, 40, 4))
def test_the_posterior_of_loose_modes_is_as_good_as_its_inputs(seed: int) -> None:
    """As for the curves: no engine adds to what one unit in the last place of the inputs does."""
    a = far(seed)
    given, model = observed(**a)[0], load_model(a["basis"])
    rng = np.random.default_rng(seed)
    found, inherent = modes_told(model, given), 0.0
    for _ in range(3):
        moved = {name: getattr(given, name) * (1 + 2.0**-52 * rng.integers(-1, 2, getattr(given, name).shape))
                 for name in ("signals", "reflectance", "lamp")}  # fmt: skip
        inherent = max(inherent, unlike(modes_told(model, replace(given, **moved)), found))
    assert unlike(found, posterior(linear_model(given, read_basis(a["basis"])))) <= 30 * inherent + 1e-10


def test_without_modes_or_a_prior_nothing_is_said_of_them() -> None:
    """The prior stands where there are none; the paper's basis has none to speak of."""
    a = seeded(2)
    mean, spread = modes_told(load_model("phones"), observed(**a)[0])
    assert (mean == 0).all()
    assert (spread == np.eye(len(spread))).all()
    paper = next(a for a in map(seeded, range(1, 9, 2)) if a["basis"] == "gaussian")
    mean, spread = modes_told(load_model("gaussian"), observed(**paper | {"lamp_modes": np.ones((1, 2, 681))})[0])
    assert mean.shape == (1, 2)
    assert spread.shape == (2, 2)
    assert np.isnan(mean).all()
    assert np.isnan(spread).all()


@pytest.mark.parametrize("seed", seeds(0, 24, 2))
def test_budget_and_bands_are_the_reference_s(seed: int) -> None:
    """With and without a white LED of unknown spectrum, uneven light and masked patches."""
    a = seeded(seed) | {"l2": 1.0, "gamma": 0.05, "nonnegative": False}
    k, n, _ = a["signals"].shape
    model, rng = load_model(a["basis"]), np.random.default_rng(seed)
    modes = np.zeros((k, 8, WAVELENGTHS.size))
    modes[-1] = read_lamp("white-led").modes
    uneven = {"gain_modes": 0.1 * rng.normal(size=(k, 2, n)), "gain_own": 0.1}
    masked = np.where(np.arange(n)[:, None] % 3 == 1, 1000.0, a["standard_error"])
    for more in ({}, {"standard_error": masked} | uneven, {"standard_error": masked, "lamp_modes": modes} | uneven):
        scale = 1.0 if seed % 4 else 2.0
        given = observed(**a | more)[0]
        found = outputs_of(model, given, scale)
        settings = SolverSettings(l2=1.0, gamma=0.05, nonnegative=False, engine="reference")
        ssf = solve_on_basis(given, a["basis"], prior_scale=scale, settings=settings)
        shares = explain(given, basis=a["basis"], prior_scale=scale)
        assert tuple(shares) == (*SOURCES, "unseen")
        assert found["budget"] == pytest.approx(np.array(list(shares.values())), abs=1e-10)
        assert norm(found["predicted_std"], predict(ssf, given).std) <= 1e-10
        assert found["predicted_std"] == pytest.approx(predict(ssf, given).std, rel=1e-9)


@pytest.mark.parametrize("basis", SHIPPED)
def test_budget_and_bands_only_where_the_call_asks_for_them(basis: str) -> None:
    """Without them the call is faster; every other output has the same bits. The paper's basis has neither."""
    given = observed(**seeded(SEEDED.index(basis)))[0]
    with_, without = (outputs_of(load_model(basis), given, explain=wanted) for wanted in (1.0, 0.0))
    for name in ("budget", "predicted_std"):
        assert with_[name].shape == without[name].shape
        assert np.isfinite(with_.pop(name)).all() == (basis != "gaussian")
        assert np.isnan(without.pop(name)).all()
    assert {name: value.tobytes() for name, value in with_.items()} == {
        name: value.tobytes() for name, value in without.items()
    }


@pytest.mark.parametrize("k", [1, 2])
@pytest.mark.parametrize("loose", [True, False], ids=["kinds of light", "named lamps"])
def test_hypotheses_are_weighed_in_one_call(k: int, loose: bool) -> None:
    """Lamps, their modes and faded charts: each has the reference's evidence, whatever stands beside it."""
    rng = np.random.default_rng(k)
    chart, day = chart_and_lamp("D55", slice(0, 24))
    y = np.stack([theory(chart, day, toy_camera())] * k) * (1 + 0.01 * rng.normal(size=(k, 24, 3)))
    kinds = [read_lamp(name) for name in (("daylight", "bulb", "white-led") if loose else ("D65", "A", "FL2"))]
    guesses = [
        Observation(
            y, chart * (1 - 0.05 * i), np.stack([kind.values] * k), standard_error=np.full(y.shape, 0.004),
            chart_tolerance=np.full(24, 0.03), lamp_tolerance=np.full(k, kind.tolerance),
            lamp_modes=np.stack([np.vstack([kind.modes, np.zeros((8 - len(kind.modes), WAVELENGTHS.size))])] * k),
        )
        for i, kind in enumerate(kinds)
    ]  # fmt: skip
    given = [model_inputs_of(guess, prior_scale=0.7, explain=0.0) for guess in guesses]
    stack = given[0] | {name: np.stack([each[name] for each in given]) for name in OF_HYPOTHESES}
    for basis in ("phones", "cameras"):
        (found,) = load_model(basis).session.run(
            ["evidence"], stack | load_model(basis).arrays | {"solve": np.array(0.0)}
        )
        expected = log_evidences(guesses, widened(read_basis(basis), 0.7))
        assert found == pytest.approx(expected, rel=1e-10)
        assert np.ptp(expected) > 1


ROWS = ["ssf/cameras-nikon", "ssf/cameras-lamp-modes", "ssf/cameras-lamp-family", "ssf/cameras-lamp-one-of-two",
        "ssf/gaussian-paper", "ssf/gaussian-three-patches"]  # fmt: skip


def opened(model: Any) -> Model:
    """A model that is no file, as `load_model` opens one."""
    runtime = onnx_runtime()
    options = runtime.SessionOptions()
    options.intra_op_num_threads = 1
    options.graph_optimization_level = runtime.GraphOptimizationLevel.ORT_DISABLE_ALL
    options.log_severity_level = 3
    session = runtime.InferenceSession(model.SerializeToString(), options, providers=["CPUExecutionProvider"])
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    return Model(session, "", metadata, load_model("cameras").arrays)


def rows_apart(own: tuple[Floats, Floats], linear: LinearModel) -> float:
    """How far whitened rows are from those of A, b and Σ, in what no rotation of them changes.

    |G_ij - G'_ij| in parts of √(G'_ii G'_jj), the worst, of the Gram matrices of (A, b): H, g and the length of b.
    """
    apart = []
    for A, b, *given in zip(*own, linear.matrix, linear.target, linear.covariance, strict=True):
        ours, theirs = (
            (columns := np.column_stack(rows).astype(np.longdouble)).T @ columns
            for rows in ((A, b), whiten_in_80_bits(*given))
        )
        length = np.sqrt(np.diag(theirs))
        apart.append(np.max(np.abs(ours - theirs) / (length * length[:, None])))
    return float(max(apart))


@pytest.mark.full
@pytest.mark.parametrize("name", ROWS)
def test_the_model_forms_the_reference_s_rows(name: str) -> None:
    """A, b and Σ themselves: a gap proves an answer to an engine's own rows only."""
    given, reference = arrays(CASES[name]), problem(CASES[name])
    basis = given["basis"]
    pytest.importorskip("onnx", reason="onnx is not installed (extra: export)")
    reader = row_reader(basis)
    assert reader is not None
    own = model_rows(reader, model_inputs(load_model(basis), given))
    assert rows_apart(own, reference) <= 1e-11
    assert rows_apart(own, replace(reference, covariance=reference.covariance * (1 + 1e-9))) > 1e-10


UNFINISHED = [
    name for name, case in EVERY.items() if case["stage"] == "layers" and case["inputs"]["iteration"] == "splitting"
]


@cache
def unfinished(depth: int) -> Model:
    """The model of the learned basis with so many layers and without its finish."""
    pytest.importorskip("onnx", reason="onnx is not installed (extra: export)")
    from camssf_onnx import models

    with (
        patch.object(formulas, "optimum", partial(optimum, depth=depth, steps=0)),
        patch.object(models, "DEPTH", depth),
    ):
        return opened(models.build_learned())


@pytest.mark.full
@pytest.mark.parametrize("name", UNFINISHED)
def test_the_layers_alone_as_a_model(name: str) -> None:
    """Built without the finish: every limit of the case, and where the shipped model serves, its very bits."""
    case = EVERY[name]
    given = case["inputs"]
    found = layers(arrays(case), case, unfinished(given["depth"]))
    assert not [finding for finding in judge(case, found) if not finding.holds or finding.skipped]
    if by_model(case):
        assert found["ssf"].tobytes() == outputs_of_case(name)["ssf"].tobytes()


@pytest.mark.parametrize("seed", seeds(0, 12, 3))
def test_seeded_problems_against_cvxpy(seed: int) -> None:
    pytest.importorskip("cvxpy", reason="cvxpy is not installed (extra: test)")
    from golden.linear_model import linear_model
    from golden.oracle import consult

    a = seeded(seed)
    k, n, _ = a["signals"].shape
    basis, white = read_basis(a["basis"]), np.ones(WAVELENGTHS.size)
    rows = linear_model(
        Observation(
            a["signals"],
            a["reflectance"],
            a["lamp"],
            standard_error=a["standard_error"],
            chart_tolerance=np.full(n, a["chart_tolerance"]),
            white_reflectance=white,
            white_tolerance=0.01,
            lamp_tolerance=np.full(k, a["lamp_tolerance"]),
            lamp_modes=np.zeros((k, 0, WAVELENGTHS.size)),
        ),
        basis,
    )
    gamma = np.full(len(rows.matrix), a["gamma"])
    oracle = consult(rows, a["l2"], gamma, a["nonnegative"], basis, a["lamp"][0])
    assert oracle["gap"].max() <= 1e-9
    assert oracle["ssf"] is not None
    assert peak(recovered(**a, engine="onnx").values, oracle["ssf"]) <= 1e-6


@pytest.mark.parametrize("basis", SHIPPED)
def test_the_order_of_patches_changes_nothing(basis: str) -> None:
    a = seeded(SEEDED.index(basis))
    order = np.random.default_rng(5).permutation(len(a["reflectance"]))
    turned = a | {name: a[name][:, order] for name in ("signals", "standard_error")}
    turned["reflectance"] = a["reflectance"][order]
    assert norm(recovered(**turned).values, recovered(**a).values) < 1e-9


@pytest.mark.parametrize("basis", SHIPPED)
def test_exposure_and_lamp_scale_change_nothing(basis: str) -> None:
    a = seeded(SEEDED.index(basis))
    y = a["signals"]
    ones = np.ones_like(y)
    plain = recovered(**a, frames=(y, ones, 0 * ones))
    louder = recovered(**a, frames=(64 + 4096 * y, 64 + 4096 * ones, 64 * ones))
    assert norm(louder.values, plain.values) < 1e-9
    assert louder.channel_gain == pytest.approx([1, 1, 1])
    assert norm(recovered(**a | {"lamp": 1000 * a["lamp"]}).peak()[0], plain.peak()[0]) < 1e-9


@pytest.mark.parametrize("basis", SHIPPED)
def test_the_same_call_gives_the_same_bits(basis: str) -> None:
    a = seeded(SEEDED.index(basis))
    assert recovered(**a).values.tobytes() == recovered(**a).values.tobytes()


@pytest.mark.parametrize("basis", SHIPPED)
def test_every_input_must_be_given(basis: str) -> None:
    """No input has a default: ONNX Runtime for Java takes no value for one that has."""
    model, given = load_model(basis), inputs_of(basis)
    assert model.session.get_overridable_initializers() == []
    assert {each.name for each in model.session.get_inputs()} == {*given, *model.arrays, "solve"}
    for name in given:
        with pytest.raises(ValueError, match=name):
            model.run({other: value for other, value in given.items() if other != name})


@pytest.mark.parametrize("basis", SHIPPED)
def test_codes_are_nonnegative_where_the_call_says_so(basis: str) -> None:
    model, given = load_model(basis), inputs_of(basis)
    assert (model.run(given | {"nonnegative": np.array(1.0)})["code"] >= 0).all()
    assert (model.run(given | {"nonnegative": np.array(0.0)})["code"] < 0).any()


def inputs_of(basis: str) -> dict[str, Floats]:
    a = seeded(SEEDED.index(basis))
    k, n, _ = a["signals"].shape
    ones = np.ones_like(a["signals"])
    return {
        "chart": a["signals"], "white": ones, "dark": 0 * ones, "standard_error": a["standard_error"],
        "reflectance": a["reflectance"], "chart_tolerance": np.full(n, 0.0),
        "white_reflectance": np.ones(681), "white_tolerance": np.array(0.01), "lamp": a["lamp"],
        "lamp_tolerance": np.zeros(k), "lamp_modes": np.zeros((k, 1, 681)), "gain_modes": np.zeros((k, 1, n)),
        "gain_own": np.array(0.0), "l2": np.array(1.0), "gamma": np.array(0.05), "nonnegative": np.array(0.0),
        "prior_scale": np.array(1.0), "explain": np.array(0.0),
    }  # fmt: skip


@pytest.mark.parametrize("basis", SHIPPED)
def test_metadata(basis: str) -> None:
    model: Model = load_model(basis)
    assert model.metadata["basis"] == basis
    assert model.metadata["grid"] == "380 to 720 nm every 0.5 nm"
    assert {"basis_sha256", "depth", "finish", "vocabulary"} <= set(model.metadata)
    assert len(model.metadata["basis_sha256"]) == len(model.sha256) == 64


# -- the files, by the onnx package -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def command() -> Any:
    pytest.importorskip("onnx", reason="onnx is not installed (extra: export)")
    from camssf_onnx import __main__

    return __main__


@pytest.mark.full
def test_check_passes(command: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(["check"]) == 0
    out = capsys.readouterr().out
    assert out.count("the same bytes") == 10  # models: three of the calibration, five of surfaces; bases and spaces
    assert out.splitlines()[-1] == "10 passed, 0 failed"


@pytest.mark.full
def test_faults_are_found(command: Any) -> None:
    import onnx

    content = (command.DATA / "camssf-learned.onnx").read_bytes()
    assert command.faults(content) == []

    def changed(change: Any) -> str:
        model = onnx.load_model_from_string(content)
        change(model)
        return "; ".join(command.faults(model.SerializeToString()))

    assert "IR 10" in changed(lambda m: setattr(m, "ir_version", 10))
    assert "opsets" in changed(lambda m: setattr(m.opset_import[0], "version", 17))
    assert "opsets" in changed(lambda m: m.opset_import.add(domain="com.microsoft", version=1))
    assert "com.microsoft.Inverse" in changed(lambda m: m.graph.node.add(op_type="Inverse", domain="com.microsoft"))
    body = "com.example.Odd"
    assert body in changed(
        lambda m: (
            next(n for n in m.graph.node if n.op_type == "If")
            .attribute[0]
            .g.node.add(op_type="Odd", domain="com.example")
        )
    )
    assert "bytes" in changed(lambda m: setattr(m.graph, "doc_string", "x" * 400_000))
    assert "invalid" in changed(lambda m: m.graph.node[-1].input.append("nowhere"))
