"""Defines the metrics of the golden vectors, and tests the optimality of a code without a solver."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from camssf.grid import WAVELENGTHS, Floats

ROUNDINGS = 4
"""Rounding errors, in units of 2⁻⁵³, between two machines' residuals: of rows, whitening, x and sums."""
VISIBLE = (WAVELENGTHS >= 400.0) & (WAVELENGTHS <= 700.0)


def exact(found: Any, expected: Any) -> float:
    """0 if shapes and all values are equal, else infinity."""
    a, b = np.asarray(found), np.asarray(expected)
    return 0.0 if a.shape == b.shape and bool(np.all(a == b)) else np.inf


def norm(found: ArrayLike, expected: ArrayLike) -> float:
    """max |a - b| / max |b|, or max |a| if b is all zero; infinity for another shape or a NaN."""
    apart, size = _apart(found, expected)
    return float(np.max(apart, initial=0.0)) / (float(np.max(size, initial=0.0)) or 1.0)


def difference(found: ArrayLike, expected: ArrayLike) -> float:
    """max |a - b|, for whole numbers of which a step is the unit."""
    return float(np.max(_apart(found, expected)[0], initial=0.0))


def relative(found: ArrayLike, expected: ArrayLike) -> float:
    """max |a - b| / |b| element by element, for numbers of different sizes (one a problem); |a| where b = 0."""
    apart, size = _apart(found, expected)
    return float(np.max(apart / np.where(size == 0, 1.0, size), initial=0.0))


def at_most(found: ArrayLike, expected: ArrayLike | None = None) -> float:
    """The largest of the found values; only the bound is compared with it."""
    del expected
    a = np.asarray(found, float)
    return float(a.max(initial=0.0)) if np.isfinite(a).all() else np.inf


def peak(found: ArrayLike, expected: ArrayLike) -> float:
    """max |a - b| of curves (681, 3), each divided by its peak, and curves of peak 1 on the 5-nm nodes (69, 3).

    Every tenth value of the found curves counts. Found curves that are on the nodes already are not rescaled.
    """
    a, b = _pair(found, expected)
    if a.ndim != 2 or not np.isfinite(a).all() or (a.max(axis=0) <= 0).any():
        return np.inf
    a = a[::10] / a.max(axis=0) if len(a) == WAVELENGTHS.size else a
    return np.inf if a.shape != b.shape else float(np.abs(a - b).max())


def rmse(found: ArrayLike, expected: ArrayLike) -> float:
    """Root mean square difference of peak-normalised curves (681, 3), 400 to 700 nm, mean of R, G, B."""
    a, b = _pair(found, expected)
    sound = a.shape == b.shape == (WAVELENGTHS.size, 3) and np.isfinite(a).all()
    if not sound or (a.max(axis=0) <= 0).any():
        return np.inf
    difference = (a / a.max(axis=0) - b / b.max(axis=0))[VISIBLE]
    return float(np.sqrt(np.mean(difference**2, axis=0)).mean())


METRICS: dict[str, Callable[[Any, Any], float]] = {
    metric.__name__: metric for metric in (exact, norm, difference, relative, at_most, peak, rmse)
}


def optimality(
    A: Floats, b: Floats, covariance: Floats, x: Floats, l2: float, gamma: float, nonnegative: bool
) -> tuple[float, float]:
    """Objective and relative duality gap of a code x, for one problem: the formulae of `camssf.recovery.duality_gap`.

    It uses the Cholesky factor of Σ, not its inverse, and no solver, so that it can judge all solvers. λ₂ > 0: the
    residual itself is a dual point, and the gap follows from the conjugate of the penalty. λ₂ = 0: the dual point is
    the residual, scaled until it is feasible.
    """
    root = np.linalg.cholesky(covariance)
    A, b = np.linalg.solve(root, A), np.linalg.solve(root, b)
    r = b - A @ x
    g = A.T @ r
    l1 = gamma * float(np.abs(x).sum())
    objective = 0.5 * float(r @ r + l2 * x @ x) + l1
    if nonnegative and (x < 0).any():
        return objective, np.inf
    if l2 > 0:
        short = x - _soft(g, gamma, nonnegative) / l2
        inside = np.clip(g, -np.inf if nonnegative else -gamma, gamma)
        gap = float(np.sum(0.5 * l2 * short**2 + (gamma * np.abs(x) - x * inside)))
    else:
        worst = float(np.max(g if nonnegative else np.abs(g), initial=0.0))
        alpha = min(1.0, gamma / worst) if worst > 0 else 1.0
        gap = 0.5 * (1 - alpha) ** 2 * float(r @ r) + l1 - alpha * float(x @ g)
    return objective, max(gap, 0.0) / objective if objective > 0 else 0.0


def blur(A: Floats, b: Floats, covariance: Floats, x: Floats, l2: float, gamma: float) -> float:
    """Bound on the change of x's relative duality gap by rounding; it depends on the conditioning of the problem.

    Rows and whitening differ between machines in the last bits, and x is rounded, so g = Fᵀ (y - F x) changes by
    δ ≤ ROUNDINGS 2⁻⁵³ |F|ᵀ (|F| |x| + |y|). λ₂ = 0: α falls by max δ / γ and xᵀ g changes by |x|ᵀ δ, so the gap
    grows by at most 2 ‖x‖₁ max δ. λ₂ > 0: the gap's slope in g is soft(g) / λ₂ - x, almost zero at a solution, and
    its curvature is at most 1 / λ₂.
    """
    root = np.linalg.cholesky(covariance)
    F, y = np.linalg.solve(root, A), np.linalg.solve(root, b)
    delta = ROUNDINGS * 2.0**-53 * (np.abs(F).T @ (np.abs(F) @ np.abs(x) + np.abs(y)))
    r = y - F @ x
    l1 = float(np.abs(x).sum())
    objective = 0.5 * float(r @ r + l2 * x @ x) + gamma * l1
    if l2 > 0:
        slope = np.where(x == 0, 0.0, np.abs(x - _soft(F.T @ r, gamma, False) / l2))
        moved = float(np.sum(slope * delta + delta**2 / (2.0 * l2)))
    else:
        moved = 2.0 * l1 * float(delta.max())
    return moved / objective if objective > 0 else 0.0


def _soft(g: Floats, gamma: float, nonnegative: bool) -> Floats:
    """Soft thresholding; a separate implementation, so that the test shares no code with the solvers."""
    return np.asarray(np.maximum(g - gamma, 0.0) - (0.0 if nonnegative else np.maximum(-g - gamma, 0.0)))


def _apart(found: ArrayLike, expected: ArrayLike) -> tuple[Floats, Floats]:
    """|a - b| and |b|; infinitely apart for another shape or a NaN."""
    a, b = _pair(found, expected)
    if a.shape != b.shape or not np.isfinite(a).all():
        return np.array([np.inf]), np.ones(1)
    return np.abs(a - b), np.abs(b)


def _pair(found: ArrayLike, expected: ArrayLike) -> tuple[Floats, Floats]:
    return np.asarray(found, dtype=float), np.asarray(expected, dtype=float)
