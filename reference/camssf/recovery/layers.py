"""Solves an elastic net approximately by an unrolled net of identical layers with analytic weights.

A layer is v ← W₁ b + W₂ soft(v, θ) + W₃ v, its solution x = soft(v, θ). Two constructors give its weights in closed
form from A, Σ and λ₂; nothing is trained.

- `splitting`: the proximal steps of ½ xᵀ H x - gᵀ x and of ½ λ₂ ‖x‖² + γ ‖x‖₁ in turn (Douglas and Rachford; the
  same sequence as the over-relaxed ADMM of Boyd et al. 2011, Sec. 6.4). The penalty's step is
  x = soft(v, γ / (ρ + λ₂)), with the usual state times ρ / (ρ + λ₂); with W = (H + ρ I)⁻¹ and relaxation α

      v ← v + α ρ / (ρ + λ₂) (W g + ρ W (2 x - v (ρ + λ₂) / ρ) - x),

  that is W₁ b = α β W g, W₂ = α β (2 ρ W - I), W₃ = I - α ρ W, θ = γ / (ρ + λ₂), β = ρ / (ρ + λ₂). The state v keeps
  what soft() removes (ADMM's multiplier): LISTA's layer (Gregor and LeCun 2010) with one more linear skip. With
  ρ = 2 λ₂ and α = 3/2 a layer's matrix on the support, 1 - α β + α (2 β - 1) ρ W, is ½ ρ W with eigenvalues
  between 0 and 1/2, whatever H is: there each layer at least halves the error. γ changes that bound a little
  (docs/solver.md, "How fast").
- `ista`: iterative soft thresholding: W₁ b = g / ‖M‖, W₂ = I - M / ‖M‖, W₃ = 0, θ = γ / ‖M‖. LISTA's form without a
  skip, its weights not learned.

ALISTA (Liu et al. 2019) computes its weights from A alone by a coherence criterion, and seeks the sparsest code of
exact rows, not this problem's optimum. tests/test_layers.py tests what `splitting` and `ista` are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from camssf.grid import Floats
from camssf.recovery.elastic_net import ElasticNet

DEPTH = 40
RELAXATION = 1.5
SETTLING = 8
"""Number of last layers that use `Layer.exact`, in a net of at least twice as many layers."""


@dataclass(frozen=True)
class Layer:
    """v ← W1b + W2 soft(v, θ) + W3 v.

    Attributes:
        W1b: (r,) W₁ b.
        W2, W3: (r, r).
        theta: θ.
        nonnegative: whether soft() also removes negative values.
        exact: the same step with the residual computed from the rows, or None. W₂ and W₃ lose digits to their
            condition number, so the last layers of a net use it (`settling`).
    """

    W1b: Floats
    W2: Floats
    W3: Floats
    theta: float
    nonnegative: bool
    exact: Callable[[Floats], Floats] | None = None

    def __call__(self, v: Floats) -> Floats:
        """The next state."""
        return np.asarray(self.W1b + self.W2 @ self.answer(v) + self.W3 @ v)

    def answer(self, v: Floats) -> Floats:
        """x = soft(v, θ), (r,)."""
        return soft(v, self.theta, self.nonnegative)

    def unroll(self, depth: int) -> Floats:
        """x after `depth` layers, from v = 0."""
        v = np.zeros(self.W1b.size)
        last = 0 if self.exact is None else settling(depth)
        for _ in range(depth - last):
            v = self(v)
        for _ in range(last):
            assert self.exact is not None
            v = self.exact(v)
        return self.answer(v)


def splitting(problem: ElasticNet) -> Layer:
    """The default layer."""
    one = np.eye(problem.g.size)
    # With λ₂ = 0 the threshold θ is then 1, which suits codes of order 1.
    rho = problem.gamma + 2.0 * problem.l2
    W = np.linalg.inv(problem.H + rho * one)
    u = W @ problem.g
    # g is large where A is, and W loses digits to its condition number: one refinement step with the residual.
    Wg = u + W @ (problem.A.T @ (problem.b - problem.A @ u) - rho * u)
    share = rho / (rho + problem.l2)
    step, theta = RELAXATION * share, problem.gamma / (rho + problem.l2)

    def exact(v: Floats) -> Floats:
        """v + α β W (Aᵀ (b - A x) + ρ (x - v / β)), which is v + α β (W (g + ρ (2 x - v / β)) - x)."""
        x = soft(v, theta, problem.nonnegative)
        return np.asarray(v + step * W @ (problem.A.T @ (problem.b - problem.A @ x) + rho * (x - v / share)))

    return Layer(
        step * Wg,
        step * (2.0 * rho * W - one),
        one - RELAXATION * rho * W,
        theta,
        problem.nonnegative,
        exact,
    )


def settling(depth: int) -> int:
    """Number of last layers that use `Layer.exact`; 0 in a shallow net."""
    return SETTLING if depth >= 2 * SETTLING else 0


def ista(problem: ElasticNet) -> Layer:
    """Iterative soft thresholding with the step 1 / ‖M‖."""
    one = np.eye(problem.g.size)
    norm = float(np.linalg.norm(problem.M, 2))
    return Layer(
        problem.g / norm, one - problem.M / norm, np.zeros_like(one), problem.gamma / norm, problem.nonnegative
    )


LAYERS = {"splitting": splitting, "ista": ista}
"""Constructors by name."""


def soft(v: Floats, threshold: float, nonnegative: bool) -> Floats:
    """Soft thresholding: the proximal step of γ‖x‖₁, optionally with x ≥ 0."""
    shrunk = np.maximum(v - threshold, 0.0)
    return shrunk if nonnegative else shrunk - np.maximum(-v - threshold, 0.0)
