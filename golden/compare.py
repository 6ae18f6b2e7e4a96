"""The metrics of the golden vectors, each defined once, and the optimality of a code without any solver."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from camssf.grid import WAVELENGTHS, Floats

ROUNDINGS = 4
"""Half units in the last place between two machines' residuals: of the rows, their whitening, x and the sums."""
VISIBLE = (WAVELENGTHS >= 400.0) & (WAVELENGTHS <= 700.0)


def exact(found: Any, expected: Any) -> float:
    """0 where shapes and all values are equal, else infinity."""
    a, b = np.asarray(found), np.asarray(expected)
    return 0.0 if a.shape == b.shape and bool(np.all(a == b)) else np.inf


def norm(found: ArrayLike, expected: ArrayLike) -> float:
    """max |a - b| / max |b|; max |a| where b is all zero. Infinity for another shape or a NaN."""
    a, b = _pair(found, expected)
    if a.shape != b.shape or not np.isfinite(a).all():
        return np.inf
    size = float(np.max(np.abs(b), initial=0.0))
    return float(np.max(np.abs(a - b), initial=0.0)) / (size or 1.0)


def relative(found: ArrayLike, expected: ArrayLike) -> float:
    """Largest |a - b| / |b| of numbers that are each of their own size (one a channel); |a| where b = 0."""
    a, b = _pair(found, expected)
    if a.shape != b.shape or not np.isfinite(a).all():
        return np.inf
    return float(np.max(np.abs(a - b) / np.where(b == 0, 1.0, np.abs(b)), initial=0.0))


def at_most(found: ArrayLike, expected: ArrayLike | None = None) -> float:
    """The largest of the values themselves; nothing is compared with them but the bound."""
    del expected
    a = np.asarray(found, float)
    return float(a.max(initial=0.0)) if np.isfinite(a).all() else np.inf


def peak(found: ArrayLike, expected: ArrayLike) -> float:
    """Curves (681, 3), each divided by its own peak, against the 5-nm nodes (69, 3) of curves at peak 1: max |a - b|.

    Every tenth value of the found curves counts. Curves on the nodes are taken as they are.
    """
    a, b = _pair(found, expected)
    if a.ndim != 2 or not np.isfinite(a).all() or (a.max(axis=0) <= 0).any():
        return np.inf
    a = a[::10] / a.max(axis=0) if len(a) == WAVELENGTHS.size else a
    return np.inf if a.shape != b.shape else float(np.abs(a - b).max())


def rmse(found: ArrayLike, expected: ArrayLike) -> float:
    """Root mean square difference of peak-normalised curves (681, 3), 400 to 700 nm, mean of R, G, B."""
    a, b = _pair(found, expected)
    if a.shape != (WAVELENGTHS.size, 3) or a.shape != b.shape or not np.isfinite(a).all():
        return np.inf
    if (a.max(axis=0) <= 0).any():
        return np.inf
    difference = (a / a.max(axis=0) - b / b.max(axis=0))[VISIBLE]
    return float(np.sqrt(np.mean(difference**2, axis=0)).mean())


METRICS: dict[str, Callable[[Any, Any], float]] = {
    "exact": exact,
    "norm": norm,
    "relative": relative,
    "at_most": at_most,
    "peak": peak,
    "rmse": rmse,
}


def optimality(
    A: Floats, b: Floats, covariance: Floats, x: Floats, l2: float, gamma: float, nonnegative: bool
) -> tuple[float, float]:
    """Objective and relative duality gap of a code x, for one channel: the formula of `camssf.curves.proof`.

    By the Cholesky factor of Σ, not by its inverse, and without any solver, so that it may judge them all. The dual
    point is the residual, scaled until it is feasible; γ = 0 has no such ball, there ½ ‖w‖² / λ₂ bounds the gap.
    """
    root = np.linalg.cholesky(covariance)
    A, b = np.linalg.solve(root, A), np.linalg.solve(root, b)
    r = b - A @ x
    w = A.T @ r - l2 * x
    quadratic, l1 = float(r @ r + l2 * x @ x), gamma * float(np.abs(x).sum())
    objective = 0.5 * quadratic + l1
    if nonnegative and (x < 0).any():
        return objective, np.inf
    if gamma == 0:
        slope = np.where(x == 0, np.maximum(w, 0.0), w) if nonnegative else w
        gap = 0.5 * float(slope @ slope) / l2
    else:
        worst = float(np.max(w if nonnegative else np.abs(w), initial=0.0))
        alpha = min(1.0, gamma / worst) if worst > 0 else 1.0
        gap = 0.5 * (1 - alpha) ** 2 * quadratic + l1 - alpha * float(x @ w)
    return objective, max(gap, 0.0) / objective if objective > 0 else 0.0


def blur(A: Floats, b: Floats, covariance: Floats, x: Floats, l2: float, gamma: float) -> float:
    """How far rounding alone moves the relative gap of x, to first order: of each case its own, by its conditioning.

    Another machine's rows and whitening differ in the last bits, x is itself rounded, and so w = Fᵀ (y - F x) - λ₂ x
    moves by δ ≤ ROUNDINGS 2⁻⁵³ (|F|ᵀ (|F| |x| + |y|) + λ₂ |x|). Then α falls by max δ / γ and xᵀ w moves by |x|ᵀ δ:
    the gap grows by at most 2 ‖x‖₁ max δ; where γ = 0, by ½ ‖δ‖² / λ₂.
    """
    root = np.linalg.cholesky(covariance)
    F, y = np.linalg.solve(root, A), np.linalg.solve(root, b)
    delta = np.abs(F).T @ (np.abs(F) @ np.abs(x) + np.abs(y)) + l2 * np.abs(x)
    delta *= ROUNDINGS * 2.0**-53
    r = y - F @ x
    l1 = float(np.abs(x).sum())
    objective = 0.5 * float(r @ r + l2 * x @ x) + gamma * l1
    moved = 0.5 * float(delta @ delta) / l2 if gamma == 0 else 2.0 * l1 * float(delta.max())
    return moved / objective if objective > 0 else 0.0


def _pair(found: ArrayLike, expected: ArrayLike) -> tuple[Floats, Floats]:
    return np.asarray(found, dtype=float), np.asarray(expected, dtype=float)
