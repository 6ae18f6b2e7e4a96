"""The convex optimum by cvxpy with Clarabel, then exchanges of single atoms: what `certify` holds answers against."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from benchmarks.problems import relative_gap
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.basis import Basis

CURVE_BAR = 1e-6
"""How well a unique optimum's curves are known, in parts of their peak."""


@dataclass(frozen=True)
class Oracle:
    """The convex solutions by another solver. First axis: problems.

    Attributes:
        code: (p, r).
        gap: (p,) relative, of the code.
        determined: (p,) whether the optimum is unique and its curves known to the bar.
        refused: (p,) whether Clarabel ended without an answer; the polish then starts from zero.
    """

    code: Floats
    gap: Floats
    determined: Floats
    refused: Floats


def oracle(A: Floats, b: Floats, basis: Basis, l2: float, gamma: float, nonnegative: bool) -> Oracle:
    """cvxpy and Clarabel on whitened rows (p, N, r), (p, N), polished on the support."""
    codes, found, unique, refused = [], [], [], []
    for rows, target, (mean, atoms) in zip(A, b, curves_of(basis, len(A)), strict=True):
        answer = _clarabel(rows, target, l2, gamma, nonnegative)
        refused.append(answer is None)
        x = np.zeros(A.shape[2]) if answer is None else answer
        gap = _first_order(rows, target, x, l2, gamma, nonnegative)
        for threshold in 10.0 ** np.arange(-12.0, -3.0):
            other = _polish(rows, target, x, l2, gamma, nonnegative, threshold)
            other_gap = _first_order(rows, target, other, l2, gamma, nonnegative)
            if other_gap < gap:
                x, gap = other, other_gap
        codes.append(x)
        found.append(relative_gap(rows, target, x, l2, gamma, nonnegative))
        unique.append(determined(rows, target, x, atoms, mean, l2, gamma, nonnegative))
    return Oracle(np.array(codes), np.array(found), np.array(unique), np.array(refused))


def curves_of(basis: Basis, count: int) -> list[tuple[Floats, Floats]]:
    """For each of so many problems the curves that its code gives: μ (c, 681) and Ψ (c, 681, r)."""
    if count == 3:
        return [(basis.mean[c : c + 1], basis.dictionary[c : c + 1]) for c in range(3)]
    return [(basis.mean, block_diag(*basis.dictionary).reshape(3, WAVELENGTHS.size, -1))]


def _clarabel(A: Floats, b: Floats, l2: float, gamma: float, nonnegative: bool) -> Floats | None:
    """Clarabel's code; None where it gives none, by an error of cvxpy or without."""
    cp: Any = import_module("cvxpy")
    length = np.sqrt((A**2).sum(axis=0) + l2)
    length = np.where(length > 0, length, 1.0)
    size = max(float(np.linalg.norm(b)), 1e-300)
    z = cp.Variable(A.shape[1], nonneg=nonnegative)  # x = size · z / length
    parts = [0.5 * cp.sum_squares(A / length @ z - b / size), gamma / size * (1.0 / length) @ cp.abs(z)]
    if l2 > 0:
        parts.append(0.5 * l2 * cp.sum_squares(cp.multiply(1.0 / length, z)))
    tight = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas", "tol_ktratio"), 1e-12)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # "may be inaccurate": its own gap judges it, and the polish follows
        try:
            cp.Problem(cp.Minimize(sum(parts))).solve(solver=cp.CLARABEL, max_iter=200, **tight)
        except cp.error.SolverError:
            return None
    return None if z.value is None else np.asarray(z.value) * size / length


def _polish(A: Floats, b: Floats, x: Floats, l2: float, gamma: float, nonnegative: bool, threshold: float) -> Floats:
    """From the signs that x has above the threshold to those of the optimum, one atom out or in at a time.

    Least squares by QR, less its shrinkage; an atom of the wrong sign leaves, else the worst one beyond its bound
    enters. It may circle: the gap judges, and the steps are counted.
    """
    length = np.sqrt((A**2).sum(axis=0) + l2)
    weight = np.abs(x) * length
    signs = np.where(weight > threshold * weight.max(initial=0.0), np.sign(x), 0.0)
    signs = np.maximum(signs, 0.0) if nonnegative else signs
    best, least = x, np.inf
    for _ in range(2 * x.size):
        made = _least_squares(A, b, signs, l2, gamma)
        if made is None:
            break
        gap = _first_order(A, b, made, l2, gamma, nonnegative) if (made * signs >= 0).all() else np.inf
        if gap < least:
            best, least = made, gap
        wrong = np.where(made * signs < 0, np.abs(made) * length, 0.0)
        w = A.T @ (b - A @ made) - l2 * made
        beyond = np.where(signs == 0, (w if nonnegative else np.abs(w)) - gamma, 0.0) / length
        if wrong.any():
            signs[wrong.argmax()] = 0.0
        elif (beyond > 1e-12 * gamma / length).any():
            signs[beyond.argmax()] = np.sign(w[beyond.argmax()])
        else:
            break
    return best


def _first_order(A: Floats, b: Floats, x: Floats, l2: float, gamma: float, nonnegative: bool) -> float:
    """The gap with √λ₂ I among the rows, by scaling: it tells apart codes that the conjugate's rounds to nought."""
    rows = np.concatenate([A, np.sqrt(l2) * np.eye(x.size)])
    return relative_gap(rows, np.concatenate([b, np.zeros(x.size)]), x, 0.0, gamma, nonnegative)


def _least_squares(A: Floats, b: Floats, signs: Floats, l2: float, gamma: float) -> Floats | None:
    """The optimum among codes of these signs, wherever they lead; None where their atoms are dependent."""
    on = signs != 0
    made = np.zeros_like(signs)
    if not on.any():
        return made
    if l2 == 0 and on.sum() > len(b):
        return None
    stacked = np.concatenate([A[:, on], np.sqrt(l2) * np.eye(int(on.sum()))]) if l2 > 0 else A[:, on]
    target = np.concatenate([b, np.zeros(len(stacked) - len(b))])
    Q, R = np.linalg.qr(stacked)
    if np.abs(np.diag(R)).min() <= 1e-15 * np.abs(np.diag(R)).max():
        return None
    made[on] = np.linalg.solve(R, Q.T @ target - gamma * np.linalg.solve(R.T, signs[on]))
    return made


def determined(
    A: Floats, b: Floats, x: Floats, atoms: Floats, mean: Floats, l2: float, gamma: float, nonnegative: bool
) -> bool:
    """Whether the optimum is unique, and so well that its curves are known to 1e-6 of their peaks in float64.

    atoms is (c, 681, r), mean (c, 681), of the c curves that the code gives. E = the atoms at their bound, |w| >=
    γ (1 - 1e-6). Unique where the columns of E (with √λ₂ below them) are independent; strictly complementary where
    every atom of E serves. Known where each curve's worst error s_E M_EE⁻¹ s_Eᵀ, for a change of the objective by one
    rounding, 2⁻⁵² of it, stays below the bar.
    """
    r = b - A @ x
    w = A.T @ r - l2 * x
    at_bound = (w if nonnegative else np.abs(w)) >= gamma * (1.0 - 1e-6)
    serves = x != 0
    if (serves & ~at_bound).any() or (at_bound & ~serves).any():
        return False
    if not serves.any():
        return True
    stacked = np.concatenate([A[:, serves], np.sqrt(l2) * np.eye(int(serves.sum()))])
    R: Floats = np.linalg.qr(stacked)[1]
    if np.abs(np.diag(R)).min() <= 1e-14 * np.abs(np.diag(R)).max():
        return False
    reach = np.linalg.solve(R.T, atoms[:, :, serves].reshape(-1, int(serves.sum())).T)
    objective = 0.5 * float(r @ r + l2 * x @ x) + gamma * float(np.abs(x).sum())
    loose = np.sqrt(2.0 * 2.0**-52 * objective * (reach**2).sum(axis=0).reshape(mean.shape).max(axis=1))
    return bool((loose <= CURVE_BAR * np.abs(mean + atoms @ x).max(axis=1)).all())
