"""The solver, judged by its proof; golden/ has the solutions of another solver."""

from typing import Any

import numpy as np
import pytest

from camssf.recovery.basis import read_basis
from camssf.recovery.elastic_net import ElasticNet
from camssf.recovery.optimum import optimum
from camssf.recovery.pivoting import PROVEN, SETTLED
from golden.compare import optimality
from golden.linear_model import LinearModel, linear_model
from tests.recovery.test_dense_model import BASES, random_captures
from tests.support.problems import duality_gap, random_sensing, seeds, whiten

pytestmark = pytest.mark.requirement("R-OPTIMUM")


@pytest.mark.parametrize("nonnegative", [False, True])
def test_where_nothing_is_worth_its_penalty_zero_is_proven(nonnegative: bool) -> None:
    """γ twice what makes every code 0: the residual itself is dual, and must not be scaled up."""
    sensing = random_sensing(6, 20, 12)
    A, b = sensing.matrix[0], sensing.target[0]
    problem = ElasticNet(A, b, 0.0, 2.0 * np.abs(A.T @ b).max(), nonnegative)
    assert duality_gap(problem, np.zeros(12))[1] == pytest.approx(0.0, abs=1e-15)


ROWS: dict[str, Any] = {
    "eight rows, five atoms": lambda A, b: (A, b),
    "four rows, five atoms": lambda A, b: (A[:, :4], b[:, :4]),
    "one atom": lambda A, b: (A[..., :1], b),
    "every atom twice": lambda A, b: (np.concatenate([A, A], axis=2), b),
    "every atom and its negative": lambda A, b: (np.concatenate([A, -A], axis=2), b),
    "an atom of zeros": lambda A, b: (np.concatenate([A, 0 * A[..., :1]], axis=2), b),
    "no signal": lambda A, b: (A, 0 * b),
    "two atoms that meet the bound together": lambda A, b: (
        np.broadcast_to([[1.0, 1.0, 0.5], [1.0, -1.0, 0.0], [0.0, 0.0, 0.5]], (3, 3, 3)), np.array([[2.0, 0, 1]] * 3)
    ),
}  # fmt: skip


@pytest.mark.parametrize("nonnegative", [False, True])
@pytest.mark.parametrize(("l2", "gamma"), [(0.0, 0.5), (0.0, 1e-3), (1.0, 0.5), (1.0, 0.0)])
@pytest.mark.parametrize("name", ROWS)
def test_small_problems_are_proven(name: str, l2: float, gamma: float, nonnegative: bool) -> None:
    """Also where the code is not unique. The gap is by the golden vectors' formula, which shares no code."""
    known = random_sensing(3, 8, 5)
    A, b = ROWS[name](known.matrix, known.target)
    sigma = known.covariance[:, : A.shape[1], : A.shape[1]]
    code = optimum(LinearModel(A, b, sigma).whitened(l2, gamma, nonnegative)).x[..., 0]
    for c in range(3):
        objective, gap = optimality(A[c], b[c], sigma[c], code[c], l2, gamma, nonnegative)
        assert gap <= 1e-9
        near = ElasticNet(*whiten(A[c], b[c], sigma[c]), l2, gamma, nonnegative)
        assert duality_gap(near, code[c])[0] == pytest.approx(objective, rel=1e-9)


def one_problem(seed: int) -> LinearModel:
    """The product's one problem of 72 atoms, of a random capture."""
    (observation,) = random_captures(seed)
    return linear_model(observation, read_basis(BASES[seed % 3]))


@pytest.mark.parametrize("seed", seeds(8))
def test_the_layers_carry_the_product_s_problem(seed: int) -> None:
    """With the product's penalties the layers' own proof is enough: no step of the finish, and the same answer."""
    problem = one_problem(seed).whitened(1.0, 0.05)
    code, walked = optimum(problem), optimum(problem, depth=0)
    assert code.x.shape == (1, 72, 1)
    assert code.pivots == 0
    assert code.gap == code.layers_gap
    assert code.gap <= PROVEN
    assert walked.pivots > 0
    assert walked.layers_gap > SETTLED
    assert walked.gap <= 1e-15
    assert np.abs(code.x - walked.x).max() < 1e-7


@pytest.mark.parametrize("nonnegative", [False, True])
@pytest.mark.parametrize(("l2", "gamma"), [(1.0, 0.05), (1.0, 5.0), (0.0, 1.4)])
def test_the_gap_bounds_how_far_an_answer_is_off(l2: float, gamma: float, nonnegative: bool) -> None:
    """Of the product's one problem, by the golden vectors' formula from A, b and Σ themselves."""
    sensing = one_problem(1)
    A, b, sigma = sensing.matrix[0], sensing.target[0], sensing.covariance[0]
    code = optimum(sensing.whitened(l2, gamma, nonnegative))
    near, best = ElasticNet(*whiten(A, b, sigma), l2, gamma, nonnegative), code.x[0, :, 0]
    least, gap = optimality(A, b, sigma, best, l2, gamma, nonnegative)
    assert max(gap, code.gap) <= 1e-9
    rng = np.random.default_rng(12)
    for size in (1e-1, 1e-3, 1e-5):
        x = best + size * rng.normal(size=72)
        x = np.maximum(x, 0.0) if nonnegative else x
        objective, gap = duality_gap(near, x)
        known = optimality(A, b, sigma, x, l2, gamma, nonnegative)
        assert (objective, gap) == (pytest.approx(known[0], rel=1e-12), pytest.approx(known[1], rel=1e-6, abs=1e-13))
        assert objective - least <= gap * objective * (1 + 1e-6) + 1e-12 * least
