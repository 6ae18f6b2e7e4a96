"""Whether a unit's blue curve has moved since its previous result (rule 10 of docs/verdict.md)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from camssf.grid import STEP, WAVELENGTHS, Floats
from camssf.recovery.arrays import solve_lower
from camssf.recovery.basis import Basis
from camssf.recovery.rows import anchor
from camssf.recovery.sensitivity import Ssf
from camssf.rules import rules
from camssf.verdict.goodness_of_fit import VerdictInputs, signal_covariance
from camssf.verdict.reasons import Check, Reason, because

STEPS = round(rules().number("verdict.unit_drift_size") / STEP)
"""One standard deviation of a drift, in steps of the grid."""

BLUE = 2
FIT, DRIFT = "goodness_of_fit", "unit_drift"


def drift_probability(inputs: VerdictInputs, ssf: Ssf, basis: Basis, new: int) -> float:
    """Probability that the blue curve has moved before the first `new` shots, at prior odds of 1 : 1.

    A drift v ~ N(0, 1) moves the blue curve, or its long-wave or short-wave flank, by v · STEPS in these shots; the
    three are equally probable. With Σ of rule 1 and r = y - ŷ at the answer, and d and A the derivatives of ŷ by the
    drift and by the code:

        g = dᵀ (Σ + A Aᵀ)⁻¹ r,   G = dᵀ (Σ + A Aᵀ)⁻¹ d,   ln of the Bayes factor = ½ g² / (1 + G) - ½ ln(1 + G)

    The chart's errors are common to all shots, so that they hide little of a drift.

    Args:
        inputs: all shots, the new ones first.
        ssf: the answer to all of them.
        basis: its basis, with the prior's width.
        new: number of new shots.
    """
    by_curve, channel, shot = _derivatives(inputs, ssf)
    rho = inputs.white_reflectance
    basis = anchor(basis, rho * inputs.lamps[0].values)
    # The answer's curves are the basis's over their white signal under the first lamp, which no atom changes.
    scale = basis.mean @ (rho * inputs.lamps[0].values) * STEP
    by_code = np.zeros((len(channel), basis.dictionary[..., 0].shape[0], basis.dictionary.shape[2]))
    for c in range(3):
        own = channel == c
        by_code[own, c] = by_curve[own] @ basis.dictionary[c] / scale[c]
    moved = ((channel == BLUE) & (shot < new))[:, None]
    A, d = by_code.reshape(len(channel), -1), np.where(moved, by_curve @ moves(ssf.values[:, BLUE]).T, 0.0)
    used = inputs.signals.used
    r = (inputs.signals.values - ssf.predicted)[used].T.ravel()
    root = np.linalg.cholesky(signal_covariance(inputs, ssf))
    whitened = solve_lower(root, np.column_stack([A, d, r]))
    A, d, r = whitened[:, : A.shape[1]], whitened[:, A.shape[1] : -1], whitened[:, -1]
    free = np.linalg.solve(A.T @ A + np.eye(A.shape[1]), A.T @ d)  # Woodbury: what another code would explain
    g, G = d.T @ r - free.T @ (A.T @ r), np.sum(d**2, axis=0) - np.sum(free * (A.T @ d), axis=0)
    nats = 0.5 * g**2 / (1.0 + G) - 0.5 * np.log1p(G)
    return float(np.exp(-np.logaddexp(0.0, np.log(len(nats)) - np.logaddexp.reduce(nats))))


def moves(curve: Floats) -> Floats:
    """(3, 681) changes of a curve (681,) whose whole, long-wave flank or short-wave flank moves STEPS to the red."""
    at, peak = np.arange(WAVELENGTHS.size), int(curve.argmax())
    whole = np.maximum(at - STEPS, 0)
    long = np.where(at > peak, np.maximum(at - STEPS, peak), at)
    short = np.where(at < peak, whole, at)
    return np.stack([curve[at] - curve for at in (whole, long, short)])


def _derivatives(inputs: VerdictInputs, ssf: Ssf) -> tuple[Floats, Floats, Floats]:
    """Of each row the derivative of ŷ by its channel's curve, (R - ŷ ρ_w) L dλ / W, (N, 681); channel; shot."""
    rho, used = inputs.white_reflectance, inputs.signals.used
    shot, patch = np.nonzero(used)
    power = ssf.lamp * STEP  # (k, 681)
    white = (power * rho) @ ssf.values  # (k, 3)
    predicted = ssf.predicted[used].T  # (3, rows)
    rows = (inputs.table.values[patch] - predicted[..., None] * rho) * power[shot] / white[shot].T[..., None]
    return rows.reshape(-1, WAVELENGTHS.size), np.repeat(np.arange(3), len(shot)), np.tile(shot, 3)


def contradiction(joint: Sequence[Check], alone: Sequence[Check]) -> Reason | None:
    """Why new shots and those of a previous result have no common answer: a drift, or a bad fit of both together.

    Args:
        joint, alone: the checks of the answer to all shots, and to the new ones.
    """
    drift, fit, own = (_check(*pair) for pair in ((joint, DRIFT), (joint, FIT), (alone, FIT)))
    if drift is not None and _broken(drift):
        return because("drift", drift.value, {"probability": drift.value}, threshold=drift.limit)
    over = _check(joint, "misfit_refuses")
    if fit is None or over is None or not _broken(fit) or (own is not None and _broken(own)):
        return None
    return because("contradiction", fit.value, {"size": float(np.sqrt(over.value))})


def _check(checks: Sequence[Check], name: str) -> Check | None:
    return next((check for check in checks if check.name == name), None)


def _broken(check: Check) -> bool:
    return check.value > check.limit
