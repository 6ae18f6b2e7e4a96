"""The solver, judged by other solvers, by its optimality conditions and by its scaling laws."""

from __future__ import annotations

import warnings
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from camssf.recovery import pivoting as walking
from camssf.recovery.elastic_net import ElasticNet, soft
from camssf.recovery.layers import DEPTH, RELAXATION, ista, splitting
from camssf.recovery.pivoting import PROVEN, SETTLED
from golden.forms import ROOT
from golden.linear_model import LinearModel, solve
from golden.reading import read_case
from golden.running import problem
from tests.support.problems import (
    duality_gap,
    gamma_max,
    joint_sensing,
    random_sensing,
    walked,
    whiten,
    whiten_in_80_bits,
)

pytestmark = pytest.mark.requirement("R-OPTIMUM")

sizes = st.tuples(st.integers(0, 10_000), st.integers(2, 30), st.integers(1, 26))


def whitened(linear: LinearModel, channel: int) -> tuple[np.ndarray, np.ndarray]:
    root = np.linalg.cholesky(np.linalg.inv(linear.covariance[channel])).T
    return root @ linear.matrix[channel], root @ linear.target[channel]


@pytest.mark.full
@given(sizes, st.sampled_from([1e-4, 1e-2, 0.3]), st.booleans())
@settings(max_examples=60, deadline=None, derandomize=True)
def test_lasso_agrees_with_scikit_learn(size: tuple[int, int, int], share: float, nonnegative: bool) -> None:
    from sklearn.linear_model import Lasso

    sensing = random_sensing(*size)
    gamma = share * gamma_max(sensing)
    code = solve(sensing, 0.0, gamma, nonnegative=nonnegative)
    assert (code.gap <= 1e-9).all()
    for c in range(3):
        rows = sensing.matrix.shape[1]
        other = Lasso(gamma[c] / rows, fit_intercept=False, positive=nonnegative, tol=1e-12, max_iter=100_000)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # its own gap is not always small: that is why only objectives count
            x = other.fit(sensing.matrix[c], sensing.target[c]).coef_
        theirs = 0.5 * np.sum((sensing.target[c] - sensing.matrix[c] @ x) ** 2) + gamma[c] * np.abs(x).sum()
        assert code.objective[c] <= theirs * (1 + 1e-9)
        # Coordinate descent stops by a tolerance on ‖b‖², far above the smallest objectives.
        assert theirs <= code.objective[c] * (1 + 1e-4) + 1e-7 * np.sum(sensing.target[c] ** 2)


@pytest.mark.full
@given(sizes, st.sampled_from([1e-4, 1e-2, 0.3]), st.sampled_from([1e-3, 1.0, 30.0]))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_elastic_net_agrees_with_scikit_learn(size: tuple[int, int, int], share: float, l2: float) -> None:
    from sklearn.linear_model import ElasticNet

    sensing = random_sensing(*size, correlated=True)
    gamma = share * gamma_max(sensing)
    code = solve(sensing, l2, gamma)
    assert (code.gap <= 1e-9).all()
    for c in range(3):
        A, b = whitened(sensing, c)
        total = (gamma[c] + l2) / len(b)
        other = ElasticNet(
            total, l1_ratio=gamma[c] / (gamma[c] + l2), fit_intercept=False, tol=1e-13, max_iter=100_000
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            x = other.fit(A, b).coef_
        theirs = 0.5 * np.sum((b - A @ x) ** 2) + 0.5 * l2 * x @ x + gamma[c] * np.abs(x).sum()
        assert code.objective[c] <= theirs * (1 + 1e-9)
        assert np.abs(code.values[c] - x).max() <= 1e-3 * max(1.0, np.abs(x).max())


@given(sizes)
@settings(max_examples=40, deadline=None, derandomize=True)
def test_vanishing_penalties_agree_with_nnls(size: tuple[int, int, int]) -> None:
    sensing = random_sensing(*size)
    code = solve(sensing, 0.0, 1e-7 * gamma_max(sensing), nonnegative=True)
    for c in range(3):
        _, residual = nnls(sensing.matrix[c], sensing.target[c])
        ours = np.linalg.norm(sensing.target[c] - sensing.matrix[c] @ code.values[c])
        assert ours == pytest.approx(residual, abs=1e-4 * np.linalg.norm(sensing.target[c]))


@given(sizes, st.floats(0.01, 100.0))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_without_l1_it_is_the_closed_form(size: tuple[int, int, int], l2: float) -> None:
    sensing = random_sensing(*size, correlated=True)
    code = solve(sensing, l2, np.zeros(3))
    for c in range(3):
        A, b = whitened(sensing, c)
        ridge = np.linalg.solve(A.T @ A + l2 * np.eye(A.shape[1]), A.T @ b)
        assert code.values[c] == pytest.approx(ridge, rel=1e-7, abs=1e-9)
        assert code.gap[c] <= 1e-12


@given(
    sizes,
    st.sampled_from([1e-5, 1e-3, 0.1]),
    st.booleans(),
    st.sampled_from([0.0, 1.0]),
    st.sampled_from([0, DEPTH]),
)
@settings(max_examples=80, deadline=None, derandomize=True)
def test_optimality_conditions(
    size: tuple[int, int, int], share: float, nonnegative: bool, l2: float, depth: int
) -> None:
    """To the digit where the walk ended; where the layers' proof was enough, as near as that proof says."""
    sensing = random_sensing(*size, correlated=True)
    gamma = share * gamma_max(sensing)
    code = solve(sensing, l2, gamma, nonnegative=nonnegative, depth=depth)
    for c in range(3):
        A, b = whitened(sensing, c)
        x = code.values[c]
        assert not (nonnegative and (x < 0).any())
        if code.finish_steps[c] == 0:
            assert code.gap[c] == code.layers_gap[c] <= SETTLED
            if l2 > 0:  # x = soft(g, γ) / λ₂, each term of the gap being ½ λ₂ of the square of what lacks
                off = x - soft(A.T @ (b - A @ x), gamma[c], nonnegative) / l2
                assert l2 / 2 * off @ off <= PROVEN * code.objective[c]
            continue
        w = A.T @ (b - A @ x) - l2 * x
        slack = 1e-6 * gamma[c]
        assert (w <= gamma[c] + slack).all()
        assert nonnegative or (w >= -gamma[c] - slack).all()
        assert np.abs(w[x > 0] - gamma[c]).max(initial=0) <= slack
        assert np.abs(w[x < 0] + gamma[c]).max(initial=0) <= slack


def test_scaling_laws() -> None:
    sensing = random_sensing(3, 15, 10)
    gamma = 0.05 * gamma_max(sensing)
    code = solve(sensing, 0.0, gamma).values
    twice = solve(LinearModel(sensing.matrix, 2 * sensing.target, sensing.covariance), 0.0, 2 * gamma).values
    assert twice == pytest.approx(2 * code, rel=1e-9, abs=1e-12)
    order = np.random.default_rng(0).permutation(15)
    shuffled = LinearModel(
        sensing.matrix[:, order], sensing.target[:, order], sensing.covariance[:, order][:, :, order]
    )
    assert solve(shuffled, 0.0, gamma).values == pytest.approx(code, rel=1e-9, abs=1e-12)
    louder = LinearModel(sensing.matrix, sensing.target, 4 * sensing.covariance)
    assert solve(louder, 0.0, gamma / 4).values == pytest.approx(code, rel=1e-9, abs=1e-12)


def test_edge_problems() -> None:
    sensing = random_sensing(5, 12, 8)
    gamma = gamma_max(sensing)
    assert not solve(sensing, 0.0, 1.0001 * gamma).values.any()  # γ so large that the code is zero
    silent = LinearModel(sensing.matrix, 0 * sensing.target, sensing.covariance)
    code = solve(silent, 0.0, np.ones(3))
    assert not code.values.any()
    assert not code.gap.any()
    twins = LinearModel(
        np.concatenate([sensing.matrix] * 2, axis=2), sensing.target, sensing.covariance
    )  # every atom twice: the code is not unique, the prediction is
    double, single = solve(twins, 0.0, 0.01 * gamma), solve(sensing, 0.0, 0.01 * gamma)
    assert (double.gap <= 1e-9).all()
    assert double.objective == pytest.approx(single.objective, rel=1e-9)
    alone = LinearModel(sensing.matrix[:, :, :1], sensing.target, sensing.covariance)
    by_hand = soft(np.einsum("cr,cr->c", alone.matrix[:, :, 0], alone.target), 1.0, False)
    by_hand /= np.einsum("cr,cr->c", alone.matrix[:, :, 0], alone.matrix[:, :, 0])
    assert solve(alone, 0.0, np.ones(3)).values[:, 0] == pytest.approx(by_hand, rel=1e-10)


def test_finish_does_what_the_layers_do_not() -> None:
    sensing = random_sensing(11, 20, 18)
    gamma = 1e-3 * gamma_max(sensing)
    layers = solve(sensing, 0.0, gamma, finish=0)
    exact = solve(sensing, 0.0, gamma)
    assert (layers.gap > 1e-6).any()
    assert (exact.gap <= 1e-10).all()
    assert exact.layers_gap == pytest.approx(layers.gap)
    deeper = solve(sensing, 0.0, gamma, finish=0, depth=2000)
    assert (deeper.gap < layers.gap).all()
    useless_start = solve(sensing, 0.0, gamma, depth=0)
    assert useless_start.values == pytest.approx(exact.values, rel=1e-8, abs=1e-10)


def test_a_walk_of_dependent_atoms_starts_anew_from_where_it_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three patches under the paper's 18 atoms: the first walk's answer is no answer, the second one's is proven."""
    case = read_case(ROOT / "cases" / "ssf" / "gaussian-three-patches.json")
    rows, gamma = problem(case), np.full(3, case["inputs"]["gamma"])
    code = solve(rows, 0.0, gamma, nonnegative=True)
    assert (code.gap <= 1e-9).all()
    monkeypatch.setattr(walking, "WALKS", 1)
    once = solve(rows, 0.0, gamma, nonnegative=True)
    assert (once.gap > 0.1).any()
    proven = once.gap <= 1e-9
    assert (once.values[proven] == code.values[proven]).all()  # who was proven at once is left alone
    assert ((once.values != 0) == (code.values != 0)).all()  # the first walk's support was right


@pytest.mark.parametrize(("name", "l2", "gamma"), [("gaussian", 0.0, 1.0), ("cameras", 1.0, 0.05)])
def test_the_layers_pull_keeps_its_digits(name: str, l2: float, gamma: float) -> None:
    """x against the same layers in 80 bits: an explicit inverse times the large pull alone is 1e-9 off."""
    rows = problem(read_case(ROOT / "cases" / "weights" / f"{name}.json"))
    nonnegative = name == "gaussian"
    found = solve(rows, l2, np.full(len(rows.matrix), gamma), nonnegative=nonnegative, depth=4, finish=0).values
    for c in range(len(rows.matrix)):
        A, b = (np.asarray(part, dtype=np.longdouble) for part in whiten(
            rows.matrix[c], rows.target[c], rows.covariance[c]
        ))  # fmt: skip
        rho = gamma + 2 * l2
        H, g = A.T @ A, A.T @ b
        M = H + rho * np.eye(len(H))
        W = np.linalg.inv(M.astype(float)).astype(np.longdouble)
        for _ in range(3):  # Newton's steps to the inverse in 80 bits
            W = W @ (2 * np.eye(len(M)) - M @ W)
        step, theta = RELAXATION * rho / (rho + l2), gamma / (rho + l2)
        v = np.zeros(len(M), dtype=np.longdouble)
        for _ in range(4):
            x = np.maximum(v - theta, 0) - (0 if nonnegative else np.maximum(-v - theta, 0))
            v = step * (W @ g) + step * (2 * rho * (W @ x) - x) + v - RELAXATION * rho * (W @ v)
        x = np.maximum(v - theta, 0) - (0 if nonnegative else np.maximum(-v - theta, 0))
        condition = float(np.linalg.cond(M.astype(float)))
        assert np.abs(found[c] - x).max() < 20 * 2.0**-53 * condition * max(1.0, float(np.abs(x).max()))


def problem_of(seed: int, l2: float, gamma: float, nonnegative: bool = False) -> ElasticNet:
    sensing = random_sensing(seed, 20, 12)
    return ElasticNet(*whiten(sensing.matrix[0], sensing.target[0], sensing.covariance[0]), l2, gamma, nonnegative)


@pytest.mark.parametrize("nonnegative", [False, True])
def test_ista_is_proximal_gradient_descent(nonnegative: bool) -> None:
    """x ← prox(x - ∇f(x) / ‖M‖), Beck and Teboulle 2009, Eq. (1.4), step by step."""
    problem = problem_of(3, 0.5, 0.7, nonnegative)
    layer, x = ista(problem), np.zeros(12)
    norm = np.linalg.eigvalsh(problem.M).max()
    for depth in range(1, 30):
        moved = x - (problem.M @ x - problem.g) / norm
        x = (
            np.maximum(moved - 0.7 / norm, 0.0)
            if nonnegative
            else np.sign(moved) * np.maximum(abs(moved) - 0.7 / norm, 0)
        )
        assert layer.unroll(depth) == pytest.approx(x, rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("nonnegative", [False, True])
@pytest.mark.parametrize(("l2", "gamma"), [(0.5, 0.7), (0.0, 0.7), (1.0, 0.05), (1.0, 0.0)])
def test_splitting_is_admm(l2: float, gamma: float, nonnegative: bool) -> None:
    """Boyd et al. 2011, Sec. 3.4.3 and 6.4: x, z and the scaled multiplier u, over-relaxed.

    ½ xᵀ H x - gᵀ x for x, ½ λ₂ ‖z‖² + γ ‖z‖₁ for z; the state is v = α x + (1 - α) z + u times ρ / (ρ + λ₂).
    """
    problem = problem_of(4, l2, gamma, nonnegative)
    layer, rho = splitting(problem), gamma + 2 * l2
    z, u = np.zeros(12), np.zeros(12)
    for depth in range(1, 30):
        x = np.linalg.solve(problem.H + rho * np.eye(12), problem.g + rho * (z - u))
        v = RELAXATION * x + (1 - RELAXATION) * z + u
        z = np.maximum(v - gamma / rho, 0) - (0.0 if nonnegative else np.maximum(-v - gamma / rho, 0))
        z = z * rho / (rho + l2)
        u = v - z
        assert layer.unroll(depth) == pytest.approx(z, rel=1e-11, abs=1e-13)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_layer_of_the_posterior_mean_halves_the_error(scale: float) -> None:
    """γ = 0, ρ = 2 λ₂: nothing is thresholded, and whatever H is, the layer's matrix has no eigenvalue above ½."""
    plain = problem_of(4, 0.0, 1.0)
    problem = ElasticNet(scale * plain.A, plain.b, 0.5, 0.0, False)
    layer = splitting(problem)
    values = np.linalg.eigvalsh(layer.W2 + layer.W3)
    assert values.min() > -1e-12
    assert values.max() <= 0.5 + 1e-12
    best = np.linalg.solve(problem.M, problem.g)
    off = [np.linalg.norm(layer.unroll(depth) - best) for depth in range(20)]
    digits = 20 * 2.0**-53 * float(np.linalg.cond(problem.M)) * off[0]
    assert digits < 1e-3 * off[0]
    assert all(after <= 0.5 * before + digits for before, after in pairwise(off))


@pytest.mark.parametrize("layers", ["splitting", "ista"])
def test_the_finish_is_exact_whatever_layers_began(layers: str) -> None:
    sensing = random_sensing(5, 20, 12)
    gamma = 0.1 * gamma_max(sensing)
    code = solve(sensing, 0.5, gamma, layers=layers)
    assert (code.gap < 1e-12).all()
    assert code.values == pytest.approx(solve(sensing, 0.5, gamma, depth=0).values, abs=1e-10)


class Outside(NamedTuple):
    """A problem whose rows are not float64."""

    A: np.ndarray
    b: np.ndarray
    l2: float
    gamma: float
    nonnegative: bool


def in_80_bits(problem: ElasticNet | Outside, x: np.ndarray) -> tuple[np.longdouble, np.longdouble]:
    """Objective and duality gap in extended precision, by the conjugate's first form or by scaling the residual."""
    A, b, z = (np.asarray(part, dtype=np.longdouble) for part in (problem.A, problem.b, x))
    l2, gamma = np.longdouble(problem.l2), np.longdouble(problem.gamma)
    r = b - A @ z
    g = A.T @ r
    primal = (r @ r + l2 * z @ z) / 2 + gamma * abs(z).sum()
    beyond = np.maximum((g if problem.nonnegative else abs(g)) - gamma, 0)
    if l2 > 0:
        return primal, np.sum(l2 * z**2 / 2 + gamma * abs(z) + beyond**2 / (2 * l2) - z * g)
    alpha = min(1, gamma / (g.max() if problem.nonnegative else abs(g).max()))
    return primal, primal - (alpha * r @ b - (alpha * r) @ (alpha * r) / 2)


@pytest.mark.parametrize("nonnegative", [False, True])
@pytest.mark.parametrize("l2", [0.0, 0.5])
@pytest.mark.parametrize("size", [1e-1, 1e-3, 1e-5])
def test_the_gap_bounds_the_distance_to_the_optimum(size: float, l2: float, nonnegative: bool) -> None:
    """Of answers that are off by so much; the gap is the dual's, recomputed in 80 bits from its textbook form."""
    problem = problem_of(6, l2, 2.0, nonnegative)
    best = walked(problem, splitting(problem).unroll(200))[0]
    least = in_80_bits(problem, best)[0]
    x = best + size * np.random.default_rng(8).normal(size=12)
    x = np.maximum(x, 0.0) if nonnegative else x
    objective, gap = duality_gap(problem, x)
    primal, wide = in_80_bits(problem, x)
    assert objective == pytest.approx(float(primal), rel=1e-14)
    assert gap * objective == pytest.approx(float(wide), rel=1e-6, abs=1e-14 * objective)
    assert 0 <= primal - least <= gap * objective * (1 + 1e-6)


@pytest.mark.parametrize("nonnegative", [False, True])
def test_where_nothing_is_worth_its_penalty_zero_is_proven(nonnegative: bool) -> None:
    """γ twice what makes every code 0: the residual itself is dual, and must not be scaled up."""
    g = np.abs(problem_of(6, 0.0, 1.0).g).max()
    assert duality_gap(problem_of(6, 0.0, 2.0 * g, nonnegative), np.zeros(12))[1] == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("nonnegative", [False, True])
def test_with_l2_the_gap_is_of_second_order(nonnegative: bool) -> None:
    """Ten times nearer along the support, a hundred times smaller; by scaling it would be ten times."""
    problem = problem_of(6, 0.5, 2.0, nonnegative)
    best = walked(problem, splitting(problem).unroll(200))[0]
    off = np.where(best != 0, np.random.default_rng(9).normal(size=12), 0.0)
    gaps = [duality_gap(problem, best + size * off)[1] for size in (1e-3, 1e-4, 1e-5)]
    assert gaps[0] / gaps[1] == pytest.approx(100, rel=0.05)
    assert gaps[1] / gaps[2] == pytest.approx(100, rel=0.05)
    assert duality_gap(problem, best)[1] < 1e-15


# -- the one problem of three channels ----------------------------------------------------------------------------

CAPTURES: list[dict[str, Any]] = [
    {"patches": 12},
    {"patches": 24},
    {"patches": 12, "lamps": ("D55", "A")},
    {"patches": 24, "lamps": ("FL2", "LED-B3", "A")},
    {"patches": 24, "lamps": ("D55",), "kind": "white-led"},
    {"patches": 12, "lamps": ("D55", "A"), "kind": "fluorescent"},
]


@pytest.mark.parametrize("capture", CAPTURES, ids=lambda capture: " ".join(map(str, capture.values())))
def test_the_layers_carry_the_product_s_problem(capture: dict[str, Any]) -> None:
    """With the product's penalties the layers' own proof is enough: no step of the finish, and the same answer."""
    sensing = joint_sensing(**capture)
    code = solve(sensing, 1.0, np.array([0.05]))
    assert code.values.shape == (1, 72)
    assert (code.finish_steps == 0).all()
    assert (code.gap == code.layers_gap).all()
    assert code.gap[0] <= PROVEN
    walked = solve(sensing, 1.0, np.array([0.05]), depth=0)
    assert walked.finish_steps[0] > 0
    assert walked.layers_gap[0] > SETTLED
    assert walked.gap[0] <= 1e-15
    assert np.abs(code.values - walked.values).max() < 1e-7


@pytest.mark.parametrize("nonnegative", [False, True])
@pytest.mark.parametrize("l2", [0.0, 1.0])
@pytest.mark.parametrize("share", [1e-6, 1e-3, 0.3])
def test_the_walk_arrives_from_nowhere(share: float, l2: float, nonnegative: bool) -> None:
    """72 atoms, no layer at all: the finish reaches its proof, and layers that prove themselves take none."""
    for sensing in (joint_sensing(patches=24), joint_sensing(patches=12, lamps=("D55", "A"))):
        gamma = share * gamma_max(sensing)
        walked = solve(sensing, l2, gamma, nonnegative=nonnegative, depth=0)
        assert walked.finish_steps[0] > 0
        assert walked.gap[0] <= 1e-9
        code = solve(sensing, l2, gamma, nonnegative=nonnegative)
        assert code.gap[0] <= 1e-9
        assert (code.finish_steps[0] == 0) == (code.layers_gap[0] <= SETTLED)
        assert code.objective[0] == pytest.approx(walked.objective[0], rel=2e-9)


def test_channels_without_common_errors_are_three_problems() -> None:
    """Σ without its blocks between channels: the codes of one problem a channel, objective and evidence summed."""
    joint = joint_sensing(patches=12, lamps=("D55", "A"), lamp_tolerance=0.02)
    N, r = joint.matrix.shape[1] // 3, 24
    blocks = [(slice(N * c, N * (c + 1)), slice(r * c, r * (c + 1))) for c in range(3)]
    sigma = np.zeros_like(joint.covariance)
    for part, own in blocks:
        sigma[0, part, part] = joint.covariance[0, part, part]
        outside = np.delete(joint.matrix[0, part], np.arange(72)[own], axis=1)
        assert not outside.any()  # a channel's rows know nothing of another's curve
    apart = LinearModel(joint.matrix, joint.target, sigma)
    three = LinearModel(
        np.stack([joint.matrix[0, part, own] for part, own in blocks]),
        joint.target.reshape(3, N),
        np.stack([joint.covariance[0, part, part] for part, _ in blocks]),
    )
    for l2, gamma, slack in ((1.0, 0.0, 1e-9), (1.0, 0.05, 1e-8), (0.0, 1.4, 1e-8)):
        for depth in (DEPTH, 0):
            one = solve(apart, l2, np.array([gamma]), depth=depth)
            each = solve(three, l2, np.full(3, gamma), depth=depth)
            assert one.values.reshape(3, r) == pytest.approx(each.values, abs=slack)
            assert one.objective[0] == pytest.approx(each.objective.sum(), rel=1e-9)
            assert one.log_evidence[0] == pytest.approx(each.log_evidence.sum(), rel=1e-12)
    # And the common errors are no trifle: with them the codes are others.
    together, by_itself = (solve(rows, 1.0, np.array([0.05])).values for rows in (joint, apart))
    assert np.abs(together - by_itself).max() > 0.1


@pytest.mark.parametrize("which", ["random", "joint", "modes"])
def test_the_evidence_is_the_density_of_the_target(which: str) -> None:
    """ln N(b; 0, Σ + A Aᵀ) without its 2π, by SciPy's eigenvalues."""
    from scipy.stats import multivariate_normal

    sensing = {
        "random": lambda: random_sensing(7, 20, 12, correlated=True),
        "joint": lambda: joint_sensing(patches=12, lamps=("D55", "A"), lamp_tolerance=0.02),
        "modes": lambda: joint_sensing(patches=24, kind="white-led"),
    }[which]()
    code = solve(sensing, 1.0, np.full(len(sensing.matrix), 0.05))
    for A, b, sigma, found in zip(sensing.matrix, sensing.target, sensing.covariance, code.log_evidence, strict=True):
        density = multivariate_normal(np.zeros(len(b)), sigma + A @ A.T).logpdf(b)
        assert found == pytest.approx(density + 0.5 * len(b) * np.log(2 * np.pi), rel=1e-9)


@pytest.mark.parametrize("nonnegative", [False, True])
@pytest.mark.parametrize(("l2", "gamma"), [(1.0, 0.05), (1.0, 5.0), (0.0, 1.4)])
def test_the_proof_of_the_one_problem_holds_in_80_bits(l2: float, gamma: float, nonnegative: bool) -> None:
    """From A, b and Σ themselves, whitened anew: of the answer, and of answers that are off."""
    sensing = joint_sensing(patches=12, lamps=("D55", "A"), lamp_tolerance=0.02)
    A, b, sigma = sensing.matrix[0], sensing.target[0], sensing.covariance[0]
    code = solve(sensing, l2, np.array([gamma]), nonnegative=nonnegative)
    wide = Outside(*whiten_in_80_bits(A, b, sigma), l2, gamma, nonnegative)
    least, gap = in_80_bits(wide, code.values[0])
    assert code.objective[0] == pytest.approx(float(least), rel=1e-12)
    assert code.gap[0] <= 1e-9
    assert gap / least <= 1e-9
    near = ElasticNet(*whiten(A, b, sigma), l2, gamma, nonnegative)
    rng = np.random.default_rng(12)
    for size in (1e-1, 1e-3, 1e-5):
        x = code.values[0] + size * rng.normal(size=72)
        x = np.maximum(x, 0.0) if nonnegative else x
        objective, found = duality_gap(near, x)
        primal, distance = in_80_bits(wide, x)
        assert objective == pytest.approx(float(primal), rel=1e-12)
        assert found * objective == pytest.approx(float(distance), rel=1e-6, abs=1e-13 * objective)
        assert primal - least <= distance * (1 + 1e-6)
