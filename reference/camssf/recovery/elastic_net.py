"""The convex problem, an elastic net, from rows of unit covariance (docs/maths.md, "The problem").

    min over x of  ½ ‖Σ^-½ (b - A x)‖² + ½ λ₂ ‖x‖² + γ ‖x‖₁        (optionally x ≥ 0)

With H = Aᵀ Σ⁻¹ A, M = H + λ₂ I, g = Aᵀ Σ⁻¹ b this is ½ xᵀ M x - gᵀ x + γ ‖x‖₁ plus a constant.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from camssf.recovery.arrays import Array, eye, namespace

BIG = 1e280
"""Stands for a missing bound: a model has no infinities."""


@dataclass(frozen=True)
class ElasticNet:
    """One elastic net, or a stack of p: whitened rows and penalties.

    Attributes:
        A, b: (..., N, r) and (..., N, 1) rows of unit covariance.
        l2, gamma: λ₂ and γ, numbers or (p, 1, 1).
        nonnegative: whether x ≥ 0 is required.
        H, M, g: (..., r, r), (..., r, r) and (..., r, 1) as above.
    """

    A: Array
    b: Array
    l2: Array
    gamma: Array
    nonnegative: Array
    H: Array = field(init=False)
    M: Array = field(init=False)
    g: Array = field(init=False)

    def __post_init__(self) -> None:
        H = self.A.mT @ self.A
        object.__setattr__(self, "H", H)
        object.__setattr__(self, "M", H + self.l2 * eye(namespace(H), H.shape[-1]))
        object.__setattr__(self, "g", self.A.mT @ self.b)

    def pull(self, x: Array) -> Array:
        """Aᵀ (b - A x), (..., r, 1), computed from the rows: no cancellation between g and H x."""
        return self.A.mT @ (self.b - self.A @ x)

    def residual(self, x: Array) -> Array:
        """w = Aᵀ (b - A x) - λ₂ x, (..., r, 1)."""
        return self.pull(x) - self.l2 * x


def clip(v: Array, threshold: Array, nonnegative: Array) -> Array:
    """v limited to [-threshold, threshold], or to at most `threshold` where x ≥ 0."""
    xp = namespace(v)
    return xp.minimum(xp.maximum(v, xp.where(nonnegative, -BIG, -threshold)), threshold)


def soft(v: Array, threshold: Array, nonnegative: Array) -> Array:
    """Soft thresholding: the proximal step of γ‖x‖₁, optionally with x ≥ 0."""
    return v - clip(v, threshold, nonnegative)
