"""The layers and their relations to ISTA, LISTA, Douglas-Rachford and ADMM: docs/solver.md, line by line.

Each test holds a formula that the page states, and computes the other side in that side's own terms: ADMM with its
multiplier, Douglas and Rachford's with proximal steps by least squares, never with the layer's own weights.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from camssf.grid import Floats
from camssf.recovery.basis import read_basis
from camssf.recovery.elastic_net import ElasticNet
from camssf.recovery.layers import DEPTH, RELAXATION, Layer, ista, splitting
from camssf.recovery.observation import Observation
from camssf.spectra import read_chart, read_lamp
from golden.linear_model import linear_model
from tests.support.problems import theory, toy_camera, walked, whiten

pytestmark = pytest.mark.requirement("R-LAYERS")

SIGNED = pytest.mark.parametrize("nonnegative", [False, True], ids=["signed", "nonnegative"])
PENALTIES = pytest.mark.parametrize(
    ("l2", "gamma"), [(1.0, 0.05), (0.3, 2.0), (0.0, 0.7)], ids=["product", "both", "l1"]
)
SHAPES = pytest.mark.parametrize(("rows", "atoms"), [(30, 12), (9, 14)], ids=["tall", "wide"])


def random_problem(
    seed: int, l2: float, gamma: float, nonnegative: bool = False, rows: int = 30, atoms: int = 12
) -> ElasticNet:
    """Rows of singular values from 30 to 0.1: some directions the data hold, of others they say nothing."""
    rng = np.random.default_rng(seed)
    left, _, right = np.linalg.svd(rng.normal(size=(rows, atoms)), full_matrices=False)
    A = left * np.geomspace(30.0, 0.1, min(rows, atoms)) @ right
    return ElasticNet(A, A @ rng.normal(size=atoms) + rng.normal(size=rows), l2, gamma, nonnegative)


def capture(*lamps: str, basis: str = "cameras") -> tuple[Floats, Floats]:
    """Whitened rows of a simulated capture of the whole chart, A and b of the first problem."""
    known, chart = read_basis(basis), read_chart("classic24").values
    powers = np.stack([read_lamp(name).values for name in lamps])
    signals = np.stack([theory(chart, power, toy_camera()) for power in powers])
    signals = signals * (1.0 + 0.002 * np.random.default_rng(0).normal(size=signals.shape))
    linear = linear_model(
        Observation(
            signals,
            chart,
            powers,
            standard_error=np.full(signals.shape, 0.002),
            chart_tolerance=0.03,
            white_tolerance=0.01,
        ),
        known,
    )
    return whiten(linear.matrix[0], linear.target[0], linear.covariance[0])


def constants(problem: ElasticNet) -> tuple[float, float]:
    """ρ and β of `splitting`."""
    rho = problem.gamma + 2.0 * problem.l2
    return rho, rho / (rho + problem.l2)


def states(layer: Layer, depth: int) -> list[Floats]:
    """v of each layer, from v = 0 on."""
    found = [np.zeros(layer.W1b.size)]
    for _ in range(depth):
        found.append(layer(found[-1]))
    return found


def optimum(problem: ElasticNet) -> Floats:
    """By the pivoting walk, which needs no layers; its KKT conditions are checked here."""
    x = walked(problem, np.zeros(problem.g.size))[0]
    assert kkt(problem, x) < 1e-9
    return x


def kkt(problem: ElasticNet, x: Floats) -> float:
    """How far w = Aᵀ (b - A x) - λ₂ x is from γ ∂‖x‖₁ (x ≥ 0: from γ minus the cone's normals)."""
    w = problem.A.T @ (problem.b - problem.A @ x) - problem.l2 * x
    low = np.where(x == 0, -np.inf if problem.nonnegative else -problem.gamma, np.sign(x) * problem.gamma)
    high = np.where(x == 0, problem.gamma, np.sign(x) * problem.gamma)
    outside = np.maximum(np.maximum(low - w, w - high), 0.0)
    return float(outside.max()) + (float(np.maximum(-x, 0.0).max()) if problem.nonnegative else 0.0)


def penalty_step(s: Floats, problem: ElasticNet, rho: float) -> Floats:
    """argmin over x of ½ λ₂ ‖x‖² + γ ‖x‖₁ + ½ ρ ‖x - s‖², atom by atom: the best of three points."""
    l2, gamma = problem.l2, problem.gamma

    def value(x: Floats) -> Floats:
        return np.asarray(0.5 * l2 * x**2 + gamma * np.abs(x) + 0.5 * rho * (x - s) ** 2)

    plus, minus = (np.maximum((sign * rho * s - gamma) / (l2 + rho), 0.0) * sign for sign in (1.0, -1.0))
    choices = np.stack([np.zeros_like(s), plus] + ([] if problem.nonnegative else [minus]))
    return np.asarray(choices[np.argmin([value(x) for x in choices], axis=0), np.arange(s.size)])


def data_step(t: Floats, problem: ElasticNet, rho: float) -> Floats:
    """argmin over x of ½ ‖b - A x‖² + ½ ρ ‖x - t‖², as least squares: neither H nor W is formed."""
    root = np.sqrt(rho)
    stacked = np.concatenate([problem.A, root * np.eye(t.size)])
    return np.asarray(np.linalg.lstsq(stacked, np.concatenate([problem.b, root * t]), rcond=None)[0])


# What `splitting` is.


@SIGNED
@PENALTIES
@SHAPES
def test_splitting_is_douglas_rachford_s(l2: float, gamma: float, nonnegative: bool, rows: int, atoms: int) -> None:
    """s ← s + α (prox_f(2 x - s) - x), x = prox_h(s): Lions and Mercier 1979, relaxed: Eckstein, Bertsekas 1992."""
    problem = random_problem(1, l2, gamma, nonnegative, rows, atoms)
    (rho, beta), layer, s = constants(problem), splitting(problem), np.zeros(atoms)
    for v in states(layer, 40):
        assert v == pytest.approx(beta * s, rel=1e-9, abs=1e-11)  # the state, times β
        x = penalty_step(s, problem, rho)
        assert layer.answer(v) == pytest.approx(x, rel=1e-9, abs=1e-11)
        s = s + RELAXATION * (data_step(2.0 * x - s, problem, rho) - x)


@SIGNED
@PENALTIES
@SHAPES
def test_splitting_is_over_relaxed_admm(l2: float, gamma: float, nonnegative: bool, rows: int, atoms: int) -> None:
    """Boyd et al. 2011, Sec. 3.1.1 and 3.4.3: x, z and the scaled multiplier u, α x + (1 - α) z in x's place."""
    problem = random_problem(2, l2, gamma, nonnegative, rows, atoms)
    (rho, beta), layer = constants(problem), splitting(problem)
    z, u = np.zeros(atoms), np.zeros(atoms)
    for v in states(layer, 40)[1:]:
        x = RELAXATION * data_step(z - u, problem, rho) + (1.0 - RELAXATION) * z
        z, s = penalty_step(x + u, problem, rho), x + u
        u = s - z
        assert v == pytest.approx(beta * s, rel=1e-9, abs=1e-11)
        assert layer.answer(v) == pytest.approx(z, rel=1e-9, abs=1e-11)


def test_one_refinement_keeps_the_digits_of_the_pull() -> None:
    """W₁ b of the paper's rows against 80 bits: W g alone keeps only what W's condition leaves."""
    problem = ElasticNet(*capture("D55", basis="gaussian"), 0.0, 1e-2, True)
    wide = problem.A.astype(np.longdouble)
    eye = np.eye(problem.g.size)
    spread = wide.T @ wide + np.longdouble(problem.gamma) * eye
    W = np.linalg.inv(spread.astype(float)).astype(np.longdouble)
    for _ in range(4):  # Newton's steps to the inverse in 80 bits
        W = W @ (2 * eye - spread @ W)
    exact = RELAXATION * (W @ (wide.T @ problem.b.astype(np.longdouble)))
    plain = RELAXATION * (np.linalg.inv(problem.H + problem.gamma * eye) @ problem.g)
    size = float(abs(exact).max())
    refined_off, plain_off = (float(abs(found - exact).max()) / size for found in (splitting(problem).W1b, plain))
    assert plain_off > 1e-9
    # What rounding leaves hangs on the order of sums: 0.03 to 0.4 of the plain error on the kernels that were tried.
    condition = float(np.linalg.cond(spread.astype(float)))
    assert refined_off < 0.6 * plain_off
    assert refined_off < 64 * 2.0**-53 * condition


# Optima and fixed points.


@SIGNED
@PENALTIES
@SHAPES
def test_an_optimum_is_a_fixed_point(l2: float, gamma: float, nonnegative: bool, rows: int, atoms: int) -> None:
    """`splitting`: v = x + w / (ρ + λ₂); `ista`: v = x + w / ‖M‖, with w = g - M x."""
    problem = random_problem(4, l2, gamma, nonnegative, rows, atoms)
    x = optimum(problem)
    w = problem.residual(x)
    for layer, stiffness in (
        (splitting(problem), constants(problem)[0] + l2),
        (ista(problem), float(np.linalg.norm(problem.M, 2))),
    ):
        v = x + w / stiffness
        assert layer.answer(v) == pytest.approx(x, abs=1e-9)
        assert layer(v) == pytest.approx(v, abs=1e-9)


@SIGNED
@PENALTIES
@SHAPES
def test_a_fixed_point_is_an_optimum(l2: float, gamma: float, nonnegative: bool, rows: int, atoms: int) -> None:
    """Where the layers come to rest the KKT conditions hold, and v holds the multiplier: w = (ρ + λ₂) (v - x)."""
    problem = random_problem(5, l2, gamma, nonnegative, rows, atoms)
    layer = splitting(problem)
    v = states(layer, 20_000)[-1]
    assert abs(layer(v) - v).max() < 1e-13
    x = layer.answer(v)
    assert kkt(problem, x) < 1e-9
    assert (constants(problem)[0] + l2) * (v - x) == pytest.approx(problem.residual(x), abs=1e-9)
    assert x == pytest.approx(optimum(problem), abs=1e-9)


# How fast.


def test_the_bound_of_one_layer_on_the_support() -> None:
    """K = (1 - α β) I + α (2 β - 1) ρ W: eigenvalues from -γ / (2 γ + 6 λ₂) to (2 γ + 3 λ₂) / (2 γ + 6 λ₂)."""
    for l2, gamma in ((1.0, 0.05), (0.3, 2.0), (2.0, 0.0), (1.0, 30.0)):
        problem = random_problem(8, l2, gamma)
        (rho, beta), layer = constants(problem), splitting(problem)
        W = np.linalg.inv(problem.H + rho * np.eye(12))
        whole = layer.W2 + layer.W3
        expected = (1 - RELAXATION * beta) * np.eye(12) + RELAXATION * (2 * beta - 1) * rho * W
        assert whole == pytest.approx(expected, abs=1e-13)
        eigenvalues = np.linalg.eigvalsh(whole)
        least, most = -gamma / (2 * gamma + 6 * l2), (2 * gamma + 3 * l2) / (2 * gamma + 6 * l2)
        assert least < eigenvalues.min()
        assert eigenvalues.max() < most
        # Any support: the block of W is between the same bounds, by interlacing.
        some = np.arange(12) % 3 != 0
        block = np.linalg.eigvalsh(whole[np.ix_(some, some)])
        assert least < block.min()
        assert block.max() < most
        # A bare direction and one that the data hold at any cost reach them.
        bare, held = (1 - RELAXATION * beta + RELAXATION * (2 * beta - 1) * share for share in (1.0, 0.0))
        assert (bare, held) == pytest.approx((most, least), abs=1e-15)


@PENALTIES
def test_from_the_settled_support_on_the_error_falls_by_that_bound(l2: float, gamma: float) -> None:
    """All atoms serve: v - v* of one layer after the other."""
    problem = random_problem(9, l2, gamma)
    # The same rows, with a b for which the optimum is a code of all atoms and of known signs.
    x = np.where(np.arange(12) % 2, 3.0, -2.0)
    wanted = problem.M @ x + gamma * np.sign(x)
    problem = replace(problem, b=problem.A @ np.linalg.solve(problem.H, wanted))
    assert optimum(problem) == pytest.approx(x, abs=1e-9)
    layer, (rho, _) = splitting(problem), constants(problem)
    fixed = x + gamma * np.sign(x) / (rho + l2)
    path = states(layer, 60)
    served = [bool((np.sign(layer.answer(v)) == np.sign(x)).all()) for v in path]
    settled = max(i for i, each in enumerate(served) if not each) + 1
    assert settled < 40
    bound = (2 * gamma + 3 * l2) / (2 * gamma + 6 * l2)
    off = [np.linalg.norm(v - fixed) for v in path]
    pairs = [(now, then) for now, then in zip(off[settled + 1 :], off[settled:], strict=False) if then > 1e-9]
    assert len(pairs) >= 5
    assert all(now <= bound * then * (1 + 1e-6) for now, then in pairs)


@PENALTIES
def test_a_layer_is_a_mean_of_the_state_and_two_reflections(l2: float, gamma: float) -> None:
    """W₂ S + W₃ = (1 - α / 2) I + (α / 2) (2 ρ W - I) (2 β S - I), S any atoms that serve; no factor exceeds 1."""
    problem = random_problem(10, l2, gamma)
    (rho, beta), layer, one = constants(problem), splitting(problem), np.eye(12)
    reflected = 2 * rho * np.linalg.inv(problem.H + rho * one) - one
    assert np.linalg.norm(reflected, 2) <= 1 + 1e-13
    for seed in range(8):
        S = np.diag(np.random.default_rng(seed).integers(0, 2, 12))
        expected = (1 - RELAXATION / 2) * one + RELAXATION / 2 * reflected @ (2 * beta * S - one)
        assert abs(layer.W2 @ S + layer.W3 - expected).max() < 1e-13
        assert np.linalg.norm(2 * beta * S - one, 2) <= 1 + 1e-13


def test_off_the_support_the_last_bound_is_all_there_is() -> None:
    """An atom at zero that the data hold tight: its state moves by 1 - α ρ W of its error, almost none."""
    problem = ElasticNet(np.array([[1e3]]), np.array([0.0]), 1.0, 0.05, False)
    layer = splitting(problem)
    assert abs(layer(np.array([1e-3])))[0] > 0.999 * 1e-3
    # With α = 2 one of which they say nothing would swing for ever: 1 - 2 ρ W = -1.
    bare = ElasticNet(np.zeros((1, 1)), np.zeros(1), 1.0, 0.05, False)
    assert splitting(bare)(np.array([1e-3])) == pytest.approx([1e-3 * (1 - RELAXATION)])
    s = np.array([1e-3])
    for _ in range(9):
        x = penalty_step(s, bare, 2.05)
        s = s + 2.0 * (data_step(2.0 * x - s, bare, 2.05) - x)
    assert s == pytest.approx([-1e-3])


@pytest.mark.parametrize("lamps", [("D55",), ("A",), ("FL2",), ("D55", "A")], ids="+".join)
def test_a_capture_s_layers_settle_at_that_rate_off_the_support_too(lamps: tuple[str, ...]) -> None:
    """The product's penalties, 72 atoms of which some serve: spectral radius of the layer at the optimum."""
    problem = ElasticNet(*capture(*lamps), 1.0, 0.05, False)
    layer, x = splitting(problem), optimum(problem)
    serves = x != 0
    assert 10 <= serves.sum() <= 50
    radius = float(abs(np.linalg.eigvals(layer.W2 * serves + layer.W3)).max())
    assert radius <= 3.1 / 6.1 + 1e-12
    assert layer.unroll(DEPTH) == pytest.approx(x, abs=1e-9)


# Its relatives.


@SIGNED
@pytest.mark.parametrize("l2", [0.0, 0.5])
def test_ista_is_proximal_gradient_descent(l2: float, nonnegative: bool) -> None:
    """x ← prox(x - ∇f(x) / ‖M‖), which Daubechies, Defrise and De Mol 2004 brought forward; step by step."""
    problem = random_problem(11, l2, 0.7, nonnegative)
    layer, x, norm = ista(problem), np.zeros(12), float(np.linalg.eigvalsh(problem.M).max())
    objective = [0.5 * problem.b @ problem.b]
    for depth in range(1, 40):
        gradient = problem.A.T @ (problem.A @ x - problem.b) + l2 * x
        x = penalty_step(x - gradient / norm, replace(problem, l2=0.0), norm)
        assert layer.unroll(depth) == pytest.approx(x, rel=1e-11, abs=1e-13)
        r = problem.b - problem.A @ x
        objective.append(0.5 * (r @ r + l2 * x @ x) + 0.7 * abs(x).sum())
    assert (np.diff(objective) <= 0).all()  # it descends, which `splitting` need not


def test_a_layer_without_the_multiplier_is_not_ista_however_large_its_step() -> None:
    """H = ρ = g = 1, γ = 0.1, one atom: ISTA stands at the optimum 0.9 at once, z ← soft(W g + ρ W z) at 0.8."""
    one = ElasticNet(np.ones((1, 1)), np.ones(1), 0.0, 0.1, False)
    assert ista(one).unroll(1) == pytest.approx([0.9])
    z = 0.0
    for _ in range(200):
        z = max((1.0 + z) / 2.0 - 0.1, 0.0)
    assert z == pytest.approx(0.8)
    assert splitting(one).unroll(200) == pytest.approx([0.9])
