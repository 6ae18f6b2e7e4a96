"""The layers and their relations to ISTA, LISTA, Douglas-Rachford and ADMM: formulas of docs/solver.md.

Each test holds one that the page states, and computes the other side in that side's own terms: ADMM with its
multiplier, Douglas and Rachford's with proximal steps by least squares, never with the layer's own weights.
"""

from dataclasses import replace

import numpy as np
import pytest

from camssf.grid import Floats
from camssf.recovery.elastic_net import ElasticNet
from camssf.recovery.layers import RELAXATION, Layer, ista, splitting
from tests.support.problems import walked

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
def test_a_fixed_point_is_an_optimum(l2: float, gamma: float, nonnegative: bool, rows: int, atoms: int) -> None:
    """Where the layers come to rest the KKT conditions hold, and v holds the multiplier: w = (ρ + λ₂) (v - x)."""
    problem = random_problem(5, l2, gamma, nonnegative, rows, atoms)
    layer = splitting(problem)
    v = states(layer, 20_000)[-1]
    assert abs(layer(v) - v).max() < 1e-13
    x = layer.answer(v)
    assert kkt(problem, x) < 1e-9
    assert (constants(problem)[0] + l2) * (v - x) == pytest.approx(problem.residual(x), abs=1e-9)
    assert x == pytest.approx(walked(problem, np.zeros(problem.g.size))[0], abs=1e-9)  # which needs no layers


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
        # A bare direction and one that the data hold at any cost reach them.
        bare, held = (1 - RELAXATION * beta + RELAXATION * (2 * beta - 1) * share for share in (1.0, 0.0))
        assert (bare, held) == pytest.approx((most, least), abs=1e-15)


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
