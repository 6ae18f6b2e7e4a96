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
exact rows, not this problem's optimum. tests/recovery/test_layers.py tests what `splitting` and `ista` are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from camssf.recovery.arrays import Array, eye, inverse, loop, namespace
from camssf.recovery.elastic_net import ElasticNet, soft

DEPTH = 40
RELAXATION = 1.5
SETTLING = 8
"""Number of last layers that use `Layer.exact`, in a net of at least twice as many layers."""


@dataclass(frozen=True)
class Layer:
    """v ← W1b + W2 soft(v, θ) + W3 v.

    Attributes:
        W1b: (..., r, 1) W₁ b.
        W2, W3: (..., r, r).
        theta: θ, a number or (p, 1, 1).
        nonnegative: whether soft() also removes negative values.
        exact: the same step with the residual computed from the rows, or None. W₂ and W₃ lose digits to their
            condition number, so the last layers of a net use it (`settling`).
    """

    W1b: Array
    W2: Array
    W3: Array
    theta: Array
    nonnegative: Array
    exact: Callable[[Array], Array] | None = None

    def __call__(self, v: Array) -> Array:
        """The next state, (..., r, 1)."""
        return self.W1b + self.W2 @ self.answer(v) + self.W3 @ v

    def answer(self, v: Array) -> Array:
        """x = soft(v, θ), (..., r, 1)."""
        return soft(v, self.theta, self.nonnegative)

    def unroll(self, depth: int) -> Array:
        """x after `depth` layers, from v = 0."""
        last = 0 if self.exact is None else settling(depth)
        state = _repeat(self, depth - last, 0.0 * self.W1b)
        if self.exact is not None:
            state = _repeat(self.exact, last, state)
        return self.answer(state)


def _repeat(layer: Callable[[Array], Array], times: int, v: Array) -> Array:
    """The state after so many equal layers."""

    def step(_: Array, state: Sequence[Array]) -> list[Array]:
        return [layer(state[0])]

    return loop(times, [v], step)[0] if times else v


def splitting(problem: ElasticNet, W: Array | None = None) -> Layer:
    """The default layer; W = (H + ρ I)⁻¹ if it is known already."""
    one, rho, l2 = eye(namespace(problem.A), problem.A.shape[-1]), weight(problem), problem.l2
    W = inverse(problem.H + rho * one)[0] if W is None else W
    u = W @ problem.g
    # g is large where A is, and W loses digits to its condition number: one refinement step with the residual.
    Wg = u + W @ (problem.pull(u) - rho * u)
    share = rho / (rho + l2)
    step, theta = RELAXATION * share, problem.gamma / (rho + l2)

    def exact(v: Array) -> Array:
        """v + α β W (Aᵀ (b - A x) + ρ (x - v / β)), which is v + α β (W (g + ρ (2 x - v / β)) - x)."""
        x = soft(v, theta, problem.nonnegative)
        return v + step * (W @ (problem.pull(x) + rho * (x - v / share)))

    return Layer(
        step * Wg,
        step * (2.0 * rho * W - one),
        one - RELAXATION * rho * W,
        theta,
        problem.nonnegative,
        exact,
    )


def weight(problem: ElasticNet) -> Array:
    """ρ of `splitting`; with λ₂ = 0 its threshold θ is then 1, which suits codes of order 1."""
    return problem.gamma + 2.0 * problem.l2


def settling(depth: int) -> int:
    """Number of last layers that use `Layer.exact`; 0 in a shallow net."""
    return SETTLING if depth >= 2 * SETTLING else 0


def ista(problem: ElasticNet) -> Layer:
    """Iterative soft thresholding with the step 1 / ‖M‖."""
    xp = namespace(problem.A)
    one = eye(xp, problem.A.shape[-1])
    norm = xp.linalg.matrix_norm(problem.M, ord=2, keepdims=len(problem.M.shape) > 2)
    return Layer(problem.g / norm, one - problem.M / norm, 0.0 * problem.M, problem.gamma / norm, problem.nonnegative)


LAYERS: dict[str, Callable[[ElasticNet], Layer]] = {"splitting": splitting, "ista": ista}
"""Constructors by name."""
