"""The solver, judged by other solvers, by its optimality conditions and by its scaling laws."""

from __future__ import annotations

import warnings
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from camssf.recovery import pivoting as walking
from camssf.recovery.elastic_net import ElasticNet, soft
from camssf.recovery.layers import DEPTH
from camssf.recovery.pivoting import PROVEN, SETTLED
from golden.forms import ROOT
from golden.linear_model import LinearModel, solve
from golden.reading import read_case
from golden.running import problem
from tests.support.problems import duality_gap, gamma_max, joint_sensing, random_sensing, whiten, whiten_in_80_bits

pytestmark = pytest.mark.requirement("R-OPTIMUM")

sizes = st.tuples(st.integers(0, 10_000), st.integers(2, 30), st.integers(1, 26))


def whitened(linear: LinearModel, channel: int) -> tuple[np.ndarray, np.ndarray]:
    root = np.linalg.cholesky(np.linalg.inv(linear.covariance[channel])).T
    return root @ linear.matrix[channel], root @ linear.target[channel]


@pytest.mark.full
@given(sizes, st.sampled_from([1e-4, 1e-2, 0.3]), st.sampled_from([0.0, 1e-3, 1.0, 30.0]), st.booleans())
@settings(max_examples=80, deadline=None, derandomize=True)
def test_objectives_agree_with_scikit_learn(
    size: tuple[int, int, int], share: float, l2: float, nonnegative: bool
) -> None:
    from sklearn.linear_model import ElasticNet as Theirs

    sensing = random_sensing(*size, correlated=l2 > 0)
    gamma = share * gamma_max(sensing)
    code = solve(sensing, l2, gamma, nonnegative=nonnegative)
    assert (code.gap <= 1e-9).all()
    for c in range(3):
        A, b = whitened(sensing, c)
        total = gamma[c] + l2
        other = Theirs(
            total / len(b), l1_ratio=gamma[c] / total, fit_intercept=False, positive=nonnegative, tol=1e-12,
            max_iter=100_000,
        )  # fmt: skip
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # its own gap is not always small: that is why only objectives count
            x = other.fit(A, b).coef_
        theirs = 0.5 * np.sum((b - A @ x) ** 2) + 0.5 * l2 * x @ x + gamma[c] * np.abs(x).sum()
        assert code.objective[c] <= theirs * (1 + 1e-9)
        # Coordinate descent stops by a tolerance on ‖b‖², far above the smallest objectives.
        assert theirs <= code.objective[c] * (1 + 1e-4) + 1e-7 * np.sum(b**2)
        assert l2 == 0 or np.abs(code.values[c] - x).max() <= 1e-3 * max(1.0, np.abs(x).max())


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
    sizes, st.sampled_from([1e-5, 1e-3, 0.1]), st.booleans(), st.sampled_from([0.0, 1.0]), st.sampled_from([0, DEPTH])
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


@pytest.mark.parametrize("layers", ["splitting", "ista"])
def test_the_finish_is_exact_whatever_layers_began(layers: str) -> None:
    sensing = random_sensing(5, 20, 12)
    gamma = 0.1 * gamma_max(sensing)
    code = solve(sensing, 0.5, gamma, layers=layers)
    assert (code.gap < 1e-12).all()
    assert code.values == pytest.approx(solve(sensing, 0.5, gamma, depth=0).values, abs=1e-10)


def in_80_bits(
    A: np.ndarray, b: np.ndarray, l2: float, gamma: float, nonnegative: bool, x: np.ndarray
) -> tuple[np.longdouble, np.longdouble]:
    """Objective and duality gap in extended precision, by the conjugate's first form or by scaling the residual."""
    z, l2, gamma = np.asarray(x, dtype=np.longdouble), np.longdouble(l2), np.longdouble(gamma)
    r = b - A @ z
    g = A.T @ r
    primal = (r @ r + l2 * z @ z) / 2 + gamma * abs(z).sum()
    beyond = np.maximum((g if nonnegative else abs(g)) - gamma, 0)
    if l2 > 0:
        return primal, np.sum(l2 * z**2 / 2 + gamma * abs(z) + beyond**2 / (2 * l2) - z * g)
    alpha = min(1, gamma / (g.max() if nonnegative else abs(g).max()))
    return primal, primal - (alpha * r @ b - (alpha * r) @ (alpha * r) / 2)


@pytest.mark.parametrize("nonnegative", [False, True])
def test_where_nothing_is_worth_its_penalty_zero_is_proven(nonnegative: bool) -> None:
    """γ twice what makes every code 0: the residual itself is dual, and must not be scaled up."""
    sensing = random_sensing(6, 20, 12)
    problem = ElasticNet(sensing.matrix[0], sensing.target[0], 0.0, 2.0 * gamma_max(sensing)[0], nonnegative)
    assert duality_gap(problem, np.zeros(12))[1] == pytest.approx(0.0, abs=1e-15)


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
    wide = partial(in_80_bits, *whiten_in_80_bits(A, b, sigma), l2, gamma, nonnegative)
    least, gap = wide(code.values[0])
    assert code.objective[0] == pytest.approx(float(least), rel=1e-12)
    assert code.gap[0] <= 1e-9
    assert gap / least <= 1e-9
    near = ElasticNet(*whiten(A, b, sigma), l2, gamma, nonnegative)
    rng = np.random.default_rng(12)
    for size in (1e-1, 1e-3, 1e-5):
        x = code.values[0] + size * rng.normal(size=72)
        x = np.maximum(x, 0.0) if nonnegative else x
        objective, found = duality_gap(near, x)
        primal, distance = wide(x)
        assert objective == pytest.approx(float(primal), rel=1e-12)
        assert found * objective == pytest.approx(float(distance), rel=1e-6, abs=1e-13 * objective)
        assert primal - least <= distance * (1 + 1e-6)
