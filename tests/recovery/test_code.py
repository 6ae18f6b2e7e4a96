"""The solver, judged by other solvers, by its optimality conditions and by its scaling laws."""

from __future__ import annotations

import warnings
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camssf.recovery.elastic_net import ElasticNet, soft
from camssf.recovery.layers import DEPTH
from camssf.recovery.pivoting import PROVEN, SETTLED
from golden.linear_model import LinearModel, solve
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


@given(
    sizes, st.sampled_from([1e-5, 1e-3, 0.1]), st.booleans(), st.sampled_from([0.0, 1.0]), st.sampled_from([0, DEPTH])
)
@settings(max_examples=40, deadline=None, derandomize=True)
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
    {"patches": 24, "lamps": ("FL2", "LED-B3", "A")},
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
