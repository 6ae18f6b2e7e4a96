"""Evidence → budget: where the band comes from, source by source."""

from __future__ import annotations

import numpy as np

from camssf.curves.basis import Basis, read_basis, widened
from camssf.curves.evidence import Evidence
from camssf.curves.sensing import anchor, sense
from camssf.curves.ssf import moves_of_peak_one
from camssf.errors import InvalidArgument
from camssf.grid import Floats


def explain(
    evidence: Evidence,
    *,
    basis: str | Basis = "cameras",
    prior_scale: float = 1.0,
) -> dict[str, Floats]:
    """Uncertainty budget: each source's share in the curves' variance, (3,) a source; they add up to 1.

    The posterior mean is x = G b with G = (H + I)⁻¹ Aᵀ Σ⁻¹, so its covariance is the sum over the sources t of
    G Σ_t Gᵀ, and of (I - G A)(I - G A)ᵀ, what the prior leaves open and no patch has seen: "unseen". Each channel's
    shares are of the sum over the grid of the variances of the curve of peak 1. `basis` and `prior_scale` are
    those of the answer.

    Raises:
        InvalidArgument: as `recover`; also a basis without a prior, which has no variance to share.
    """
    basis = basis if isinstance(basis, Basis) else read_basis(str(basis))
    if not basis.prior:
        raise InvalidArgument(f"The {basis.name} basis has no prior, so no variance.", "Take --basis cameras.")
    evidence.check_for(basis)
    basis = widened(basis, prior_scale)
    sensing = sense(evidence, basis)
    basis = anchor(basis, evidence.white_reflectance * evidence.lamp[0])
    A, sigma = sensing.matrix[0], sensing.covariance[0]
    weighted = np.linalg.solve(sigma, A)
    gain = np.linalg.solve(A.T @ weighted + np.eye(A.shape[1]), weighted.T)  # (3 r, N)
    code = (gain @ sensing.target[0]).reshape(3, -1)
    curves = basis.mean + np.einsum("cmr,cr->cm", basis.dictionary, code)
    moves = moves_of_peak_one(basis, curves)
    across = moves @ gain.reshape(3, -1, gain.shape[1])  # (3, m, N)
    parts = {source: np.sum((across @ term[0]) * across, axis=(1, 2)) for source, term in sensing.terms.items()}
    left = (np.eye(gain.shape[0]) - gain @ A).reshape(3, -1, gain.shape[0])
    parts["unseen"] = np.sum((moves @ left) ** 2, axis=(1, 2))
    whole = np.sum(list(parts.values()), axis=0)
    return {source: part / whole for source, part in parts.items()}
