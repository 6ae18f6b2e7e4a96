"""The convex problem, an elastic net, from rows of unit covariance (docs/maths.md, "The problem").

    min over x of  ½ ‖Σ^-½ (b - A x)‖² + ½ λ₂ ‖x‖² + γ ‖x‖₁        (optionally x ≥ 0)

With H = Aᵀ Σ⁻¹ A, M = H + λ₂ I, g = Aᵀ Σ⁻¹ b this is ½ xᵀ M x - gᵀ x + γ ‖x‖₁ plus a constant.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import solve_triangular

from camssf.grid import Floats


@dataclass(frozen=True)
class ElasticNet:
    """An elastic net: whitened rows and penalties.

    Attributes:
        A, b: (N, r) and (N,) rows of unit covariance.
        l2, gamma: λ₂ and γ.
        nonnegative: whether x ≥ 0 is required.
        H, M, g: (r, r), (r, r) and (r,) as above.
    """

    A: Floats
    b: Floats
    l2: float
    gamma: float
    nonnegative: bool
    H: Floats = field(init=False)
    M: Floats = field(init=False)
    g: Floats = field(init=False)

    def __post_init__(self) -> None:
        H = self.A.T @ self.A
        object.__setattr__(self, "H", H)
        object.__setattr__(self, "M", H + self.l2 * np.eye(self.A.shape[1]))
        object.__setattr__(self, "g", self.A.T @ self.b)

    def residual(self, x: Floats) -> Floats:
        """w = Aᵀ (b - A x) - λ₂ x, (r,), computed from the rows: no cancellation between g and M x."""
        return np.asarray(self.A.T @ (self.b - self.A @ x) - self.l2 * x)


def whiten(A: Floats, b: Floats, sigma: Floats) -> tuple[Floats, Floats, Floats]:
    """Rows of unit covariance, L⁻¹ A and L⁻¹ b with Σ = L Lᵀ, and ln det Σ; Σ⁻¹ would lose twice the digits.

    Args:
        A, b, sigma: (..., N, r), (..., N) and (..., N, N); the leading axes stack problems.
    """
    L = np.linalg.cholesky(sigma)
    white = np.empty((*A.shape[:-1], A.shape[-1] + 1))
    white[..., :-1], white[..., -1] = A, b
    for at in np.ndindex(sigma.shape[:-2]):
        white[at] = solve_triangular(L[at], white[at], lower=True)
    log_det = 2.0 * np.log(np.diagonal(L, axis1=-2, axis2=-1)).sum(axis=-1)
    return white[..., :-1], white[..., -1], log_det
