"""The penalties λ₂ and γ: fixed defaults on a whitened basis, the discrepancy principle on the paper's."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.recovery.basis import Basis
from camssf.recovery.elastic_net import ElasticNet
from camssf.recovery.observation import Observation, array_of
from camssf.recovery.optimum import optimum
from camssf.recovery.rows import paper_rows
from camssf.rules import rules

L2, GAMMA = rules().number("calibration.l2"), rules().number("calibration.gamma")
"""Default penalties on a whitened basis: almost the Gaussian posterior mean, a little sparser."""
SMALLEST_GAMMA = rules().number("calibration.smallest_gamma")
"""Smallest γ of the discrepancy principle, as a share of γ_max."""


def penalties(
    observation: Observation, basis: Basis, l2: float | None, gamma: ArrayLike | None, nonnegative: bool
) -> tuple[float, Floats]:
    """λ₂ and γ (3,): as given, else the defaults that `recover` states.

    Raises:
        InvalidArgument: not numbers, negative, both zero, or γ that differ by channel on a basis with a prior.
    """
    weight = (L2 if basis.prior else 0.0) if l2 is None else float(array_of("l2", l2, ()))
    if gamma is not None:
        sparsity = array_of("gamma", gamma)
        if sparsity.shape not in ((), (3,)):
            raise InvalidArgument(f"`gamma` has shape {sparsity.shape}.", "Give one number, or one a channel.")
        sparsity = np.broadcast_to(sparsity, 3)
    elif basis.prior:
        sparsity = np.full(3, GAMMA)
    else:
        sparsity = _discrepancy(observation, basis, weight, nonnegative)
    if basis.prior and np.ptp(sparsity) > 0:
        raise InvalidArgument(
            f"`gamma` is {sparsity.tolist()}, but on the {basis.name} basis the three channels are one problem.",
            "Give one number.",
        )
    if not (np.isfinite(sparsity).all() and (sparsity >= 0).all() and np.isfinite(weight) and weight >= 0):
        raise InvalidArgument(
            f"The penalties l2 = {weight} and gamma = {sparsity.tolist()} must be finite and not negative.",
            "Leave them out to take the defaults.",
        )
    if weight == 0 and (sparsity == 0).any():
        raise InvalidArgument(
            "`gamma` = 0 and `l2` = 0 leave the problem without a unique answer.",
            "Give one of them a positive value, or leave them out to take the defaults.",
        )
    return weight, sparsity


def _discrepancy(observation: Observation, basis: Basis, l2: float, nonnegative: bool) -> Floats:
    """The largest γ of each channel whose residual is not above the measured noise (Morozov 1966).

    rᵀ Σ⁻¹ r grows with γ; if it exceeds the noise even at SMALLEST_GAMMA · γ_max, that γ is returned.
    """
    from scipy.optimize import brentq

    error, used = observation.standard_error, observation.used
    noise = np.zeros_like(observation.signals[0]) if error is None else error[0]
    # A masked signal adds nothing to the residual, so it must add no noise to compare it with.
    noise = noise if used is None else np.where(used[0][:, None], noise, 0.0)
    A, b, variance = paper_rows(
        observation.signals[0], observation.errors(basis)[0], observation.chart_tolerance, observation.reflectance,
        observation.white_reflectance, observation.lamp[0], basis.dictionary[0],
    )  # fmt: skip
    A, b = A / np.sqrt(variance), b / np.sqrt(variance)
    chosen = []
    for c in range(3):
        expected = float(np.sum(noise[:, c] ** 2 / variance[c, :, 0]))
        pull = A[c].T @ b[c]
        largest = float(np.max(pull if nonnegative else np.abs(pull), initial=0.0))
        if largest <= 0:
            chosen.append(1.0)  # nothing to explain: any penalty gives the zero code
            continue
        excess = _excess(A[c : c + 1], b[c : c + 1], expected, l2, nonnegative)
        low, high = np.log(SMALLEST_GAMMA * largest), np.log(largest)
        if expected == 0 or excess(low) >= 0:
            chosen.append(np.exp(low))
        elif excess(high) <= 0:
            chosen.append(np.exp(high))
        else:
            chosen.append(np.exp(brentq(excess, low, high, xtol=0.01)))
    return np.array(chosen)


def _excess(A: Floats, b: Floats, expected: float, l2: float, nonnegative: bool) -> Callable[[float], float]:
    """ln(rᵀ r / expected) as a function of ln γ, for whitened rows A (1, n, r) and b (1, n, 1)."""

    def excess(log_gamma: float) -> float:
        problem = ElasticNet(A, b, np.array(l2), np.array(np.exp(log_gamma)), np.array(nonnegative))
        r = b - A @ optimum(problem).x
        return float(np.log(max(np.sum(r**2), 1e-300) / expected))

    return excess
