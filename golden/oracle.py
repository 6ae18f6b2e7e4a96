"""Solves the convex problems by cvxpy and Clarabel, and polishes the solutions; imported only to generate cases."""

from __future__ import annotations

import warnings
from contextlib import suppress
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camssf.grid import STEP, Floats
from camssf.recovery.basis import Basis
from camssf.recovery.rows import anchor
from golden.compare import optimality
from golden.forms import Json
from golden.linear_model import LinearModel

ENOUGH = 1e-13
"""Relative duality gap at which polishing stops; for λ₂ > 0, where the gap is of second order, its square is used."""


def consult(
    linear: LinearModel,
    l2: float,
    gamma: Floats,
    nonnegative: bool,
    basis: Basis | None = None,
    white: Floats | None = None,
) -> Json:
    """Objective, code and gap of each problem by Clarabel; and the curves on the 5-nm nodes if they are unique.

    Args:
        linear: the rows of p problems; p = 1 on a learned basis, the three channels together.
        l2, gamma, nonnegative: penalties and constraint of the problem, γ (p,).
        basis: basis of the curves; None for no curves.
        white: (681,) ρ_w L of the first lamp, to scale the curves; None for no curves.
    """
    from importlib.metadata import version

    codes, objectives, gaps, polished, unique = [], [], [], [], []
    for A, b, sigma, weight in zip(linear.matrix, linear.target, linear.covariance, gamma, strict=True):
        x, better = _problem(A, b, sigma, l2, float(weight), nonnegative)
        objective, gap = optimality(A, b, sigma, x, l2, float(weight), nonnegative)
        codes.append(x)
        objectives.append(objective)
        gaps.append(gap)
        polished.append(better)
        unique.append(_unique(A, b, sigma, x, l2, float(weight), nonnegative))
    curves = None
    if basis is not None and white is not None and all(unique):
        own = anchor(basis, white)
        s = (own.mean + np.einsum("cmr,cr->cm", own.dictionary, np.reshape(codes, (3, -1)))).T
        s = s / (white @ s * STEP)
        curves = s[::10] / s.max(axis=0)
    return {
        "solver": f"cvxpy {version('cvxpy')}, Clarabel {version('clarabel')}",
        "polished": polished,
        "x": np.array(codes),
        "objective": np.array(objectives),
        "gap": np.array(gaps),
        "ssf": curves,
    }


def _problem(A: Floats, b: Floats, sigma: Floats, l2: float, gamma: float, nonnegative: bool) -> tuple[Floats, bool]:
    """The code of one problem, and whether polishing improved Clarabel's gap."""
    root = np.linalg.cholesky(sigma)
    F, y = np.linalg.solve(root, A), np.linalg.solve(root, b)

    def gap(x: Floats) -> float:
        return optimality(A, b, sigma, x, l2, gamma, nonnegative)[1]

    x = _clarabel(F, y, l2, gamma, nonnegative)
    best, better, enough = x, False, ENOUGH**2 if l2 > 0 else ENOUGH
    size = float(np.abs(x).max(initial=0.0))
    w = F.T @ (y - F @ x) - l2 * x
    for share in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9):
        for support in (np.abs(x) > share * size, np.abs(w) >= gamma * (1 - share)):
            if gap(best) <= enough:
                return best, better
            tried = _polish(F, y, l2, gamma, nonnegative, support, np.sign(np.where(np.abs(x) > share * size, x, w)))
            if tried is not None and gap(tried) < gap(best):
                best, better = tried, True
    return best, better


def _clarabel(F: Floats, y: Floats, l2: float, gamma: float, nonnegative: bool) -> Floats:
    """Solve the whitened problem by Clarabel, with columns and target scaled to unit norm."""
    cp: Any = import_module("cvxpy")
    column = np.sqrt((F**2).sum(axis=0) + l2)
    column = np.where(column > 0, column, 1.0)
    size = float(np.linalg.norm(y)) or 1.0
    u = cp.Variable(F.shape[1], nonneg=nonnegative)
    terms = 0.5 * cp.sum_squares(y / size - (F / column) @ u)
    terms += 0.5 * l2 * cp.sum_squares(cp.multiply(1.0 / column, u))
    terms += gamma / size * cp.norm1(cp.multiply(1.0 / column, u))
    # With tolerances this small Clarabel often reports "almost solved"; the gap is computed afterwards.
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with suppress(cp.error.SolverError):  # then polishing starts from zero, and its gap is checked as usual
            cp.Problem(cp.Minimize(terms)).solve(
                solver=cp.CLARABEL, tol_gap_abs=1e-14, tol_gap_rel=1e-13, tol_feas=1e-13, max_iter=400
            )
    found: Any = np.zeros(F.shape[1]) if u.value is None else u.value
    x = np.asarray(found, float) * size / column
    return np.maximum(x, 0.0) if nonnegative else x


def _polish(
    F: Floats, y: Floats, l2: float, gamma: float, nonnegative: bool, support: NDArray[np.bool_], sign: Floats
) -> Floats | None:
    """Active-set iteration from a guessed support: KKT system by QR, drop wrong signs, add the worst violator.

    Returns None if the system is singular.
    """
    r = F.shape[1]
    support, sign = support.copy(), sign.copy()
    x = np.zeros(r)
    for _ in range(4 * r):
        x = np.zeros(r)
        if support.any():
            S = np.concatenate([F[:, support], np.sqrt(l2) * np.eye(int(support.sum()))])
            if S.shape[1] > S.shape[0]:
                return None
            Q, R = np.linalg.qr(S)
            if np.abs(np.diag(R)).min() <= 1e-12 * np.abs(np.diag(R)).max():
                return None
            target = np.concatenate([y, np.zeros(S.shape[1])])
            x[support] = np.linalg.solve(R, Q.T @ target - gamma * np.linalg.solve(R.T, sign[support]))
            off = S.T @ (target - S @ x[support]) - gamma * sign[support]  # one step of iterative refinement
            x[support] += np.linalg.solve(R, np.linalg.solve(R.T, off))
        wrong = support & ((x < 0) if nonnegative else (x * sign < 0)) & ((gamma > 0) | nonnegative)
        if wrong.any():
            support &= ~wrong
            continue
        w = F.T @ (y - F @ x) - l2 * x
        over = np.where(support, 0.0, (w if nonnegative else np.abs(w)) - gamma * (1.0 + 1e-12))
        if not over.max() > 0:
            return x
        worst = int(over.argmax())
        support[worst], sign[worst] = True, np.sign(w[worst])
    return x


def _unique(A: Floats, b: Floats, sigma: Floats, x: Floats, l2: float, gamma: float, nonnegative: bool) -> bool:
    """Whether x is unique: λ₂ > 0, or the columns at the bound are independent (Tibshirani 2013, Lemma 2)."""
    if l2 > 0:
        return True
    root = np.linalg.cholesky(sigma)
    F, y = np.linalg.solve(root, A), np.linalg.solve(root, b)
    w = F.T @ (y - F @ x)
    at_bound = (w if nonnegative else np.abs(w)) >= gamma * (1 - 1e-6)
    if not at_bound.any():
        return True
    E = F[:, at_bound] / np.linalg.norm(F[:, at_bound], axis=0)
    return bool(E.shape[1] <= E.shape[0] and np.linalg.svd(E, compute_uv=False)[-1] > 1e-7)
