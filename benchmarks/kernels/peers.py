"""Other solvers of the same problems, each a function of whitened rows: (p, N, r), (p, N) → codes (p, r).

On a learned basis p = 1, the three channels' one problem, N = 3 k n; on the paper's p = 3, a problem a channel.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeAlias

import numpy as np

from camssf.grid import Floats

Run: TypeAlias = Callable[[], Floats]


class Missing(Exception):
    """The peer is not installed; the message says how to install it."""


def _load(module: str, package: str) -> Any:
    """A peer's module; raises Missing."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return import_module(module)
    except ImportError as error:
        raise Missing(f"pip install {package}") from error


def cvxpy_anew(A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool) -> Run:
    """Each problem built anew in each call, Clarabel at its default tolerances."""
    cp = _load("cvxpy", "cvxpy")

    def run() -> Floats:
        codes = []
        for rows, target in zip(A, b, strict=True):
            x = cp.Variable(A.shape[2], nonneg=nonnegative)
            parts = [0.5 * cp.sum_squares(rows @ x - target), gamma * cp.norm1(x)]
            if l2 > 0:
                parts.append(0.5 * l2 * cp.sum_squares(x))
            cp.Problem(cp.Minimize(sum(parts))).solve(solver=cp.CLARABEL)
            codes.append(x.value)
        return np.array(codes)

    return run


def cvxpy_compiled(A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool) -> Run:
    """A problem of that size compiled once (DPP), its rows, target and γ parameters; a solve for each problem."""
    cp = _load("cvxpy", "cvxpy")

    rows, target, weight = cp.Parameter(A.shape[1:]), cp.Parameter(A.shape[1]), cp.Parameter(nonneg=True)
    x = cp.Variable(A.shape[2], nonneg=nonnegative)
    parts = [0.5 * cp.sum_squares(rows @ x - target), weight * cp.norm1(x)]
    if l2 > 0:
        parts.append(0.5 * l2 * cp.sum_squares(x))
    problem = cp.Problem(cp.Minimize(sum(parts)))

    def run() -> Floats:
        codes = []
        for own_rows, own_target in zip(A, b, strict=True):
            rows.value, target.value, weight.value = own_rows, own_target, gamma
            problem.solve(solver=cp.CLARABEL)
            codes.append(np.array(x.value))
        return np.array(codes)

    return run


def cvxpy_compiled_at_once(A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool) -> Run:
    """All problems of a call as one compiled problem (DPP), one solve a call; with p = 1 as `cvxpy_compiled`."""
    cp = _load("cvxpy", "cvxpy")

    rows = [cp.Parameter(A.shape[1:]) for _ in A]
    targets = [cp.Parameter(A.shape[1]) for _ in A]
    weight = cp.Parameter(nonneg=True)
    xs = [cp.Variable(A.shape[2], nonneg=nonnegative) for _ in A]
    parts = [
        0.5 * cp.sum_squares(a @ x - t) + weight * cp.norm1(x) for a, t, x in zip(rows, targets, xs, strict=True)
    ]
    if l2 > 0:
        parts += [0.5 * l2 * cp.sum_squares(x) for x in xs]
    problem = cp.Problem(cp.Minimize(sum(parts)))

    def run() -> Floats:
        for row, own_rows, target, own_target in zip(rows, A, targets, b, strict=True):
            row.value, target.value = own_rows, own_target
        weight.value = gamma
        problem.solve(solver=cp.CLARABEL)
        return np.array([x.value for x in xs])

    return run


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
    from scipy import sparse

    settings = clarabel.DefaultSettings()
    settings.verbose = False

    def run() -> Floats:
        codes = []
        for rows, target in zip(A, b, strict=True):
            P, q, G = _quadratic(rows, target, l2, gamma, nonnegative)
            cones = [clarabel.NonnegativeConeT(len(G))]
            upper = sparse.csc_matrix(np.triu(P))
            solver = clarabel.DefaultSolver(upper, q, sparse.csc_matrix(G), np.zeros(len(G)), cones, settings)
            codes.append(np.array(solver.solve().x)[: A.shape[2]])
        return np.array(codes)

    return run


def osqp_direct(A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool) -> Run:
    """The same program by OSQP, tolerances 1e-8, polished."""
    osqp = _load("osqp", "osqp")
    from scipy import sparse

    def run() -> Floats:
        codes = []
        for rows, target in zip(A, b, strict=True):
            P, q, G = _quadratic(rows, target, l2, gamma, nonnegative)
            solver = osqp.OSQP()
            exact: dict[str, Any] = {"eps_abs": 1e-8, "eps_rel": 1e-8, "max_iter": 20_000, "polishing": True}
            below = np.full(len(G), -np.inf)
            upper = sparse.csc_matrix(np.triu(P))
            solver.setup(upper, q, sparse.csc_matrix(G), below, np.zeros(len(G)), verbose=False, **exact)
            codes.append(solver.solve(raise_error=False).x[: A.shape[2]])
        return np.array(codes)

    return run


def sklearn_elastic_net(A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool) -> Run:
    """Coordinate descent, tol 1e-10, at most 20,000 sweeps."""
    sklearn = _load("sklearn.linear_model", "scikit-learn")
    total = gamma + l2

    def run() -> Floats:
        codes = []
        for rows, target in zip(A, b, strict=True):
            net = sklearn.ElasticNet(
                total / len(target), l1_ratio=gamma / total, fit_intercept=False, positive=nonnegative, tol=1e-10,
                max_iter=20_000,
            )  # fmt: skip
            codes.append(net.fit(rows, target).coef_)
        return np.array(codes)

    return run


def skglm_elastic_net(A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool) -> Run:
    """Working sets and Anderson acceleration, tol 1e-10; numba has compiled it before the clock starts."""
    skglm = _load("skglm", "skglm")
    penalties, solvers, datafits = (_load(f"skglm.{part}", "skglm") for part in ("penalties", "solvers", "datafits"))
    total = gamma + l2

    def run() -> Floats:
        codes = []
        for rows, target in zip(A, b, strict=True):
            penalty = penalties.L1_plus_L2(total / len(target), gamma / total, positive=nonnegative)
            solver = solvers.AndersonCD(max_iter=100, max_epochs=20_000, tol=1e-10, fit_intercept=False)
            net = skglm.GeneralizedLinearEstimator(datafits.Quadratic(), penalty, solver)
            codes.append(net.fit(np.asfortranarray(rows), target).coef_)
        return np.array(codes)

    return run


PEERS = {
    "cvxpy, built anew": cvxpy_anew,
    "cvxpy, compiled (DPP), a problem a solve": cvxpy_compiled,
    "cvxpy, compiled (DPP), all in one solve": cvxpy_compiled_at_once,
    "Clarabel, called directly": clarabel_direct,
    "OSQP, called directly": osqp_direct,
    "scikit-learn ElasticNet": sklearn_elastic_net,
    "skglm": skglm_elastic_net,
}
