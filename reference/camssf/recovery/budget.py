"""Splits the posterior variance of the curves into an uncertainty budget by source."""

from __future__ import annotations

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.recovery.basis import Basis, basis_of, widened
from camssf.recovery.linear_model import anchor, linear_model
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import moves_of_peak_one


def explain(
    observation: Observation,
    *,
    basis: str | Basis = "cameras",
    prior_scale: float = 1.0,
) -> dict[str, Floats]:
    """Uncertainty budget: the share of each source in the variance of each channel, (3,); the shares add up to 1.

    The posterior mean is x = G b with G = (H + I)⁻¹ Aᵀ Σ⁻¹. Its covariance is the sum of G Σ_t Gᵀ over the sources t
    and of (I - G A)(I - G A)ᵀ, the prior variance that the patches do not determine ("unseen"). The variance of a
    channel is that of its curve of peak 1, summed over the grid. `basis` and `prior_scale` are those of the result.

    Raises:
        InvalidArgument: as `recover`; also for a basis without a prior, which has no posterior variance.
    """
    basis = basis_of(basis)
    if not basis.prior:
        raise InvalidArgument(f"The {basis.name} basis has no prior, so no variance.", "Choose the basis cameras.")
    observation.check_for(basis)
    basis = widened(basis, prior_scale)
    linear = linear_model(observation, basis)
    basis = anchor(basis, observation.white_reflectance * observation.lamp[0])
    A, sigma = linear.matrix[0], linear.covariance[0]
    weighted = np.linalg.solve(sigma, A)
    gain = np.linalg.solve(A.T @ weighted + np.eye(A.shape[1]), weighted.T)  # (3 r, N)
    code = (gain @ linear.target[0]).reshape(3, -1)
    curves = basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, code)
    moves = moves_of_peak_one(basis, curves)
    across = moves @ gain.reshape(3, -1, gain.shape[1])  # (3, m, N)
    parts = {source: np.sum((across @ term[0]) * across, axis=(1, 2)) for source, term in linear.terms.items()}
    left = (np.eye(gain.shape[0]) - gain @ A).reshape(3, -1, gain.shape[0])
    parts["unseen"] = np.sum((moves @ left) ** 2, axis=(1, 2))
    whole = np.sum(list(parts.values()), axis=0)
    return {source: part / whole for source, part in parts.items()}
