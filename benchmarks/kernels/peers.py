"""Other solvers of the same problems, each a function of whitened rows: (p, N, r), (p, N) → codes (p, r).

On a learned basis p = 1, the three channels' one problem, N = 3 k n; on the paper's p = 3, a problem a channel.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeAlias

import numpy as np
from scipy import sparse

from benchmarks.kernels.turns import Unavailable
from camssf.grid import Floats

Run: TypeAlias = Callable[[], Floats]


Solve: TypeAlias = Callable[[Floats, Floats], Floats]
"""One problem's rows (N, r) and target (N,) to its code (r,)."""


def _load(module: str, package: str) -> Any:
    """A peer's module; raises Unavailable."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return import_module(module)
    except ImportError as error:
        raise Unavailable(f"pip install {package}") from error


def _one_by_one(A: Floats, b: Floats, solve: Solve) -> Run:
    return lambda: np.array([solve(rows, target) for rows, target in zip(A, b, strict=True)])


def _elastic_net(cp: Any, rows: Any, target: Any, x: Any, l2: float, gamma: Any) -> Any:
    """The objective in cvxpy's terms."""
    smooth = 0.5 * cp.sum_squares(rows @ x - target) + gamma * cp.norm1(x)
    return smooth + 0.5 * l2 * cp.sum_squares(x) if l2 > 0 else smooth


def cvxpy_anew(A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool) -> Run:
    """Each problem built anew in each call, Clarabel at its default tolerances."""
    cp = _load("cvxpy", "cvxpy")

    def solve(rows: Floats, target: Floats) -> Floats:
        x = cp.Variable(A.shape[2], nonneg=nonnegative)
        cp.Problem(cp.Minimize(_elastic_net(cp, rows, target, x, l2, gamma))).solve(solver=cp.CLARABEL)
        return np.array(x.value)

    return _one_by_one(A, b, solve)


def cvxpy_compiled(A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool, together: int = 1) -> Run:
    """So many problems of that size compiled once (DPP), rows, targets and γ parameters; solved for all in turn."""
    cp = _load("cvxpy", "cvxpy")
    rows = [cp.Parameter(A.shape[1:]) for _ in range(together)]
    targets = [cp.Parameter(A.shape[1]) for _ in range(together)]
    xs = [cp.Variable(A.shape[2], nonneg=nonnegative) for _ in range(together)]
    weight = cp.Parameter(nonneg=True)
    parts = [_elastic_net(cp, a, t, x, l2, weight) for a, t, x in zip(rows, targets, xs, strict=True)]
    problem = cp.Problem(cp.Minimize(sum(parts)))

    def run() -> Floats:
        codes = []
        for start in range(0, len(A), together):
            for i in range(together):
                rows[i].value, targets[i].value = A[start + i], b[start + i]
            weight.value = gamma
            problem.solve(solver=cp.CLARABEL)
            codes += [np.array(x.value) for x in xs]
        return np.array(codes)

    return run


def cvxpy_compiled_at_once(A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool) -> Run:
    """All problems of a call as one compiled problem (DPP), one solve a call; with p = 1 as `cvxpy_compiled`."""
    return cvxpy_compiled(A, b, l2, gamma, nonnegative, together=len(A))


def _quadratic(
    rows: Floats, target: Floats, l2: float, gamma: float, nonnegative: bool
) -> tuple[Floats, Floats, Floats]:
    """½ zᵀ P z + qᵀ z under G z <= 0: z = x where x ≥ 0, else (x, t) with |x| <= t."""
    r = rows.shape[1]
    M, pull = rows.T @ rows + l2 * np.eye(r), rows.T @ target
    if nonnegative:
        return M, gamma - pull, -np.eye(r)
    P = np.zeros((2 * r, 2 * r))
    P[:r, :r] = M
    eye = np.eye(r)
    return P, np.concatenate([-pull, np.full(r, gamma)]), np.block([[eye, -eye], [-eye, -eye]])


def clarabel_direct(A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool) -> Run:
    """The quadratic program in normal equations, set up and solved for each problem, default tolerances."""
    clarabel = _load("clarabel", "clarabel")
    settings = clarabel.DefaultSettings()
    settings.verbose = False

    def solve(rows: Floats, target: Floats) -> Floats:
        P, q, G = _quadratic(rows, target, l2, gamma, nonnegative)
        cones = [clarabel.NonnegativeConeT(len(G))]
        upper = sparse.csc_matrix(np.triu(P))
        solver = clarabel.DefaultSolver(upper, q, sparse.csc_matrix(G), np.zeros(len(G)), cones, settings)
        return np.array(solver.solve().x)[: A.shape[2]]

    return _one_by_one(A, b, solve)


def osqp_direct(A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool) -> Run:
    """The same program by OSQP, tolerances 1e-8, polished."""
    osqp = _load("osqp", "osqp")
    exact: dict[str, Any] = {"eps_abs": 1e-8, "eps_rel": 1e-8, "max_iter": 20_000, "polishing": True}

    def solve(rows: Floats, target: Floats) -> Floats:
        P, q, G = _quadratic(rows, target, l2, gamma, nonnegative)
        solver = osqp.OSQP()
        below, upper = np.full(len(G), -np.inf), sparse.csc_matrix(np.triu(P))
        solver.setup(upper, q, sparse.csc_matrix(G), below, np.zeros(len(G)), verbose=False, **exact)
        return np.asarray(solver.solve(raise_error=False).x[: A.shape[2]])

    return _one_by_one(A, b, solve)


def sklearn_elastic_net(A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool) -> Run:
    """Coordinate descent, tol 1e-10, at most 20,000 sweeps."""
    sklearn = _load("sklearn.linear_model", "scikit-learn")
    total = gamma + l2
    exact: dict[str, Any] = {"fit_intercept": False, "positive": nonnegative, "tol": 1e-10, "max_iter": 20_000}

    def solve(rows: Floats, target: Floats) -> Floats:
        net = sklearn.ElasticNet(total / len(target), l1_ratio=gamma / total, **exact)
        return np.asarray(net.fit(rows, target).coef_)

    return _one_by_one(A, b, solve)


def skglm_elastic_net(A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool) -> Run:
    """Working sets and Anderson acceleration, tol 1e-10; numba has compiled it before the clock starts."""
    skglm = _load("skglm", "skglm")
    penalties, solvers, datafits = (_load(f"skglm.{part}", "skglm") for part in ("penalties", "solvers", "datafits"))
    total = gamma + l2

    def solve(rows: Floats, target: Floats) -> Floats:
        penalty = penalties.L1_plus_L2(total / len(target), gamma / total, positive=nonnegative)
        solver = solvers.AndersonCD(max_iter=100, max_epochs=20_000, tol=1e-10, fit_intercept=False)
        net = skglm.GeneralizedLinearEstimator(datafits.Quadratic(), penalty, solver)
        return np.asarray(net.fit(np.asfortranarray(rows), target).coef_)

    return _one_by_one(A, b, solve)


PEERS = {
    "cvxpy, built anew": cvxpy_anew,
    "cvxpy, compiled (DPP), a problem a solve": cvxpy_compiled,
    "cvxpy, compiled (DPP), all in one solve": cvxpy_compiled_at_once,
    "Clarabel, called directly": clarabel_direct,
    "OSQP, called directly": osqp_direct,
    "scikit-learn ElasticNet": sklearn_elastic_net,
    "skglm": skglm_elastic_net,
}
