"""The penalties λ₂ and γ: fixed defaults on a whitened basis, the discrepancy principle on the paper's."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.recovery.basis import Basis
from camssf.recovery.linear_model import LinearModel, linear_model
from camssf.recovery.observation import Observation, array_of
from camssf.recovery.solve import solve
from camssf.rules import rules

L2, GAMMA = rules().number("calibration.l2"), rules().number("calibration.gamma")
"""Default penalties on a whitened basis: almost the Gaussian posterior mean, a little sparser."""
SMALLEST_GAMMA = 1e-5
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
        known = (
            np.zeros_like(observation.signals) if observation.standard_error is None else observation.standard_error
        )
        # A masked signal adds nothing to the residual, so it must add no noise to compare it with.
        noise = known if observation.used is None else np.where(observation.used[:, :, None], known, 0.0)
        sparsity = _discrepancy(linear_model(observation, basis), noise, weight, nonnegative)
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


def _discrepancy(linear: LinearModel, noise: Floats, l2: float, nonnegative: bool) -> Floats:
    """The largest γ of each channel whose residual is not above the measured noise (Morozov 1966).

    rᵀ Σ⁻¹ r grows with γ; if it exceeds the noise even at SMALLEST_GAMMA · γ_max, that γ is returned.
    """
    from scipy.optimize import brentq

    chosen = []
    variances = np.moveaxis(noise**2, -1, 0).reshape(3, -1)
    for A, b, sigma, variance in zip(linear.matrix, linear.target, linear.covariance, variances, strict=True):
        inverse = np.linalg.inv(sigma)
        expected = float(np.sum(variance / np.diag(sigma)))
        pull = A.T @ inverse @ b
        largest = float(np.max(pull if nonnegative else np.abs(pull), initial=0.0))
        if largest <= 0:
            chosen.append(1.0)  # nothing to explain: any penalty gives the zero code
            continue
        channel = LinearModel(A[None], b[None], sigma[None])
        excess = _excess(channel, inverse, expected, l2, nonnegative)
        low, high = np.log(SMALLEST_GAMMA * largest), np.log(largest)
        if expected == 0 or excess(low) >= 0:
            chosen.append(np.exp(low))
        elif excess(high) <= 0:
            chosen.append(np.exp(high))
        else:
            chosen.append(np.exp(brentq(excess, low, high, xtol=0.01)))
    return np.array(chosen)


def _excess(
    channel: LinearModel, inverse: Floats, expected: float, l2: float, nonnegative: bool
) -> Callable[[float], float]:
    """ln(rᵀ Σ⁻¹ r / expected) as a function of ln γ."""

    def excess(log_gamma: float) -> float:
        code = solve(channel, l2, np.array([np.exp(log_gamma)]), nonnegative=nonnegative)
        r = channel.target[0] - channel.matrix[0] @ code.values[0]
        return float(np.log(max(r @ inverse @ r, 1e-300) / expected))

    return excess
