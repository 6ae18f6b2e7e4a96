"""Solves the convex problems by cvxpy and Clarabel, and polishes the solutions; imported only to generate cases."""

from __future__ import annotations

import warnings
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camssf.grid import STEP, Floats
from camssf.recovery.basis import read_basis, widened
from camssf.recovery.rows import anchor
from golden.compare import optimality
from golden.forms import Json, resolve
from golden.linear_model import LinearModel


@dataclass(frozen=True)
class Problem:
    """½ ‖y - F x‖² + ½ λ₂ ‖x‖² + γ ‖x‖₁ of whitened rows, x ≥ 0 where `nonnegative`."""

    F: Floats
    y: Floats
    l2: float
    gamma: float
    nonnegative: bool

    def optimality(self, x: Floats) -> tuple[float, float]:
        """Objective and relative duality gap of a code."""
        return optimality(self.F, self.y, np.eye(len(self.y)), x, self.l2, self.gamma, self.nonnegative)

    def slope(self, x: Floats) -> Floats:
        """Fᵀ (y - F x) - λ₂ x."""
        return np.asarray(self.F.T @ (self.y - self.F @ x) - self.l2 * x)

    def beyond(self, slope: Floats) -> Floats:
        """The slopes, of which γ is the largest of an optimum."""
        return slope if self.nonnegative else np.abs(slope)


def consult(rows: LinearModel, given: Json) -> Json:
    """Objective, code and gap of each problem by Clarabel; and the curves on the 5-nm nodes if they are unique.

    Args:
        rows: of p problems; p = 1 on a learned basis, the three channels together.
        given: the inputs of the case, for the penalties, the basis, and ρ_w L of the first lamp, which scales curves.
    """
    problems = []
    for A, b, sigma in zip(rows.matrix, rows.target, rows.covariance, strict=True):
        root = np.linalg.cholesky(sigma)
        whitened = np.linalg.solve(root, A), np.linalg.solve(root, b)
        problems.append(Problem(*whitened, given["l2"], given["gamma"], given["nonnegative"]))
    codes, polished = zip(*(_solved(problem) for problem in problems), strict=True)
    objectives, gaps = zip(*(one.optimality(x) for one, x in zip(problems, codes, strict=True)), strict=True)
    curves = None
    if all(_unique(one, x) for one, x in zip(problems, codes, strict=True)):
        white = resolve(given["white_reflectance"]) * resolve(given["lamp"])[0]
        own = anchor(widened(read_basis(given["basis"]), given.get("prior_scale", 1.0)), white)
        s = (own.mean + np.einsum("cmr,cr->cm", own.dictionary, np.reshape(codes, (3, -1)))).T
        s = s / (white @ s * STEP)
        curves = s[::10] / s.max(axis=0)
    return {
        "solver": f"cvxpy {version('cvxpy')}, Clarabel {version('clarabel')}",
        "polished": polished,
        "x": np.array(codes),
        "objective": objectives,
        "gap": gaps,
        "ssf": curves,
    }


def _solved(problem: Problem) -> tuple[Floats, bool]:
    """The code of one problem, and whether solving on its support improved Clarabel's gap."""
    x = best = _clarabel(problem)
    size, w = float(np.abs(x).max(initial=0.0)), problem.slope(x)
    for share in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9):
        large = np.abs(x) > share * size
        for support in (large, np.abs(w) >= problem.gamma * (1 - share)):
            tried = _polish(problem, support, np.sign(np.where(large, x, w)))
            if tried is not None and problem.optimality(tried)[1] < problem.optimality(best)[1]:
                best = tried
    return best, best is not x


def _clarabel(problem: Problem) -> Floats:
    """Solve the whitened problem by Clarabel, with columns and target scaled to unit norm."""
    cp: Any = import_module("cvxpy")
    column = np.sqrt((problem.F**2).sum(axis=0) + problem.l2)
    size = float(np.linalg.norm(problem.y)) or 1.0
    u = cp.Variable(len(column), nonneg=problem.nonnegative)
    terms = 0.5 * cp.sum_squares(problem.y / size - (problem.F / column) @ u)
    terms += 0.5 * problem.l2 * cp.sum_squares(cp.multiply(1.0 / column, u))
    terms += problem.gamma / size * cp.norm1(cp.multiply(1.0 / column, u))
    # With tolerances this small Clarabel often reports "almost solved"; the gap is computed afterwards.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with suppress(cp.error.SolverError):  # then polishing starts from zero, and its gap is checked as usual
            cp.Problem(cp.Minimize(terms)).solve(
                solver=cp.CLARABEL, tol_gap_abs=1e-14, tol_gap_rel=1e-13, tol_feas=1e-13, max_iter=400
            )
    found: Any = np.zeros(len(column)) if u.value is None else u.value
    x = np.asarray(found, float) * size / column
    return np.asarray(np.maximum(x, 0.0) if problem.nonnegative else x)


def _polish(problem: Problem, support: NDArray[np.bool_], sign: Floats) -> Floats | None:
    """The code with this support and these signs that solves the KKT system, by QR; None if that is singular."""
    x, count = np.zeros(problem.F.shape[1]), int(support.sum())
    if count == 0:
        return x
    S = np.concatenate([problem.F[:, support], np.sqrt(problem.l2) * np.eye(count)])
    target, pull = np.concatenate([problem.y, np.zeros(count)]), problem.gamma * sign[support]
    Q, R = np.linalg.qr(S)
    if len(R) < count or np.abs(np.diag(R)).min() <= 1e-12 * np.abs(np.diag(R)).max():
        return None
    x[support] = np.linalg.solve(R, Q.T @ target - np.linalg.solve(R.T, pull))
    off = S.T @ (target - S @ x[support]) - pull  # one step of iterative refinement
    x[support] += np.linalg.solve(R, np.linalg.solve(R.T, off))
    return x


def _unique(problem: Problem, x: Floats) -> bool:
    """Whether x is unique: λ₂ > 0, or the columns at the bound are independent (Tibshirani 2013, Lemma 2)."""
    at_bound = problem.beyond(problem.slope(x)) >= problem.gamma * (1 - 1e-6)
    if problem.l2 > 0 or not at_bound.any():
        return True
    E = problem.F[:, at_bound] / np.linalg.norm(problem.F[:, at_bound], axis=0)
    return bool(E.shape[1] <= E.shape[0] and np.linalg.svd(E, compute_uv=False)[-1] > 1e-7)
