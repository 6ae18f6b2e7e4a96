"""Problem → layers → code: the unrolled net, a fixed number of equal layers with analytic weights.

A layer is v ← W₁ b + W₂ soft(v, θ) + W₃ v, its answer x = soft(v, θ). Two constructors give its weights in closed
form from A, Σ and λ₂; nothing is trained.

- `splitting`: ½ xᵀ H x - gᵀ x on one side, ½ λ₂ ‖x‖² + γ ‖x‖₁ on the other, their proximal steps in turn (Douglas
  and Rachford; the same sequence as the over-relaxed ADMM of Boyd et al. 2011, Sec. 6.4). The penalty's step is
  x = soft(v, γ / (ρ + λ₂)), with the usual state times ρ / (ρ + λ₂); with W = (H + ρ I)⁻¹, relaxation α

      v ← v + α ρ / (ρ + λ₂) (W g + ρ W (2 x - v (ρ + λ₂) / ρ) - x),

  that is W₁ b = α β W g, W₂ = α β (2 ρ W - I), W₃ = I - α ρ W, θ = γ / (ρ + λ₂), β = ρ / (ρ + λ₂). The state v keeps
  what soft() cut away (ADMM's multiplier): LISTA's layer (Gregor and LeCun 2010) with one linear skip more. With
  ρ = 2 λ₂ and α = 3/2 a layer's matrix on the support, 1 - α β + α (2 β - 1) ρ W, is ½ ρ W with eigenvalues
  between 0 and 1/2, whatever H is: there the error halves, or better, in each layer. γ moves that bound a little
  (docs/solver.md, "How fast").
- `ista`: the iterative soft thresholding itself: W₁ b = g / ‖M‖, W₂ = I - M / ‖M‖, W₃ = 0, θ = γ / ‖M‖. LISTA's form
  without a skip, its weights not learned.

ALISTA (Liu et al. 2019) takes its weights from A alone by a criterion of coherence, and looks for the sparsest code
of exact rows, not for this problem's optimum. Each of these relations is a test in tests/test_layers.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from camssf.curves.problem import Problem
from camssf.grid import Floats

DEPTH = 32
RELAXATION = 1.5
SETTLING = 8
"""So many layers at the end of a net of at least twice as many take the residual from the rows themselves."""


@dataclass(frozen=True)
class Layer:
    """v ← W1b + W2 soft(v, θ) + W3 v.

    Attributes:
        W1b: (r,) W₁ b.
        W2, W3: (r, r).
        theta: θ.
        nonnegative: soft() gives no negative values.
        exact: the same step with the residual taken from the rows, where the constructor has one: W₂ and W₃ keep only
            the digits that their condition leaves, so the last layers of a net are taken by it (`settling`).
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
        """x after so many layers, from v = 0."""
        v = np.zeros(self.W1b.size)
        last = 0 if self.exact is None else settling(depth)
        for _ in range(depth - last):
            v = self(v)
        for _ in range(last):
            assert self.exact is not None
            v = self.exact(v)
        return self.answer(v)


def splitting(problem: Problem) -> Layer:
    """The product's layer."""
    one = np.eye(problem.g.size)
    # Codes are of order 1, so a threshold of order 1 suits them with the l1 part alone.
    rho = problem.gamma + 2.0 * problem.l2
    W = np.linalg.inv(problem.H + rho * one)
    u = W @ problem.g
    # g is large where A is, and W keeps only the digits that its condition leaves: one step on the residual.
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
    """How many layers of a net take the residual from the rows: its last ones, none of a shallow net."""
    return SETTLING if depth >= 2 * SETTLING else 0


def ista(problem: Problem) -> Layer:
    """Iterative soft thresholding with the step 1 / ‖M‖."""
    one = np.eye(problem.g.size)
    norm = float(np.linalg.norm(problem.M, 2))
    return Layer(
        problem.g / norm, one - problem.M / norm, np.zeros_like(one), problem.gamma / norm, problem.nonnegative
    )


LAYERS = {"splitting": splitting, "ista": ista}
"""Constructors by name."""


def soft(v: Floats, threshold: float, nonnegative: bool) -> Floats:
    """Soft thresholding: the proximal step of γ‖x‖₁, with x ≥ 0 where asked."""
    shrunk = np.maximum(v - threshold, 0.0)
    return shrunk if nonnegative else shrunk - np.maximum(-v - threshold, 0.0)
