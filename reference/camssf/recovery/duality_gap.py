"""Bounds the distance of a solution from the optimal objective by the duality gap, whatever the solver was.

With r = b - A x and g = Aᵀ Σ⁻¹ r:

- λ₂ > 0: r itself is a dual point, and the gap follows from the penalty's conjugate (Fenchel and Young, by atom),

      Σ_j ½ λ₂ x_j² + γ |x_j| + (|g_j| - γ)₊² / (2 λ₂) - x_j g_j
        = Σ_j ½ λ₂ (x_j - soft(g_j, γ) / λ₂)² + γ |x_j| - x_j clip(g_j, -γ, γ),

  each term at least 0. The second form has no cancellation. The gap is of second order in the error of x. For x ≥ 0
  soft(g, γ) = (g - γ)₊ and the clip has no lower bound.
- λ₂ = 0: r is scaled by α, the largest α ≤ 1 with |α g| ≤ γ, and the gap is

      ½ (1 - α)² ‖r‖² + γ ‖x‖₁ - α xᵀ g,

  of first order in the error where γ is small.

The gap is given relative to the objective.
"""

from __future__ import annotations

from camssf.recovery.arrays import Array, namespace
from camssf.recovery.elastic_net import ElasticNet, clip, soft


def duality_gap(problem: ElasticNet, x: Array) -> tuple[Array, Array]:
    """Objective and relative duality gap of x (..., r, 1), both (..., 1, 1)."""
    xp = namespace(x)
    r = problem.b - problem.A @ x
    g = problem.A.mT @ r
    l1 = problem.gamma * _total(xp.abs(x))
    objective = 0.5 * (_total(r * r) + problem.l2 * _total(x * x)) + l1
    gap = xp.maximum(xp.where(problem.l2 > 0.0, _by_conjugate(problem, x, g), _by_scaling(problem, x, g, r)), 0.0)
    known = objective > 0.0
    return objective, xp.where(known, gap / xp.where(known, objective, 1.0), 0.0)


def _total(terms: Array) -> Array:
    """The sum of each problem's terms, (..., 1, 1)."""
    return namespace(terms).sum(terms, axis=(-2, -1), keepdims=True)


def _by_conjugate(problem: ElasticNet, x: Array, g: Array) -> Array:
    """The gap with λ₂ > 0."""
    xp, gamma = namespace(x), problem.gamma
    l2 = xp.where(problem.l2 > 0.0, problem.l2, 1.0)
    short = x - soft(g, gamma, problem.nonnegative) / l2
    return _total(0.5 * l2 * short**2 + (gamma * xp.abs(x) - x * clip(g, gamma, problem.nonnegative)))


def _by_scaling(problem: ElasticNet, x: Array, g: Array, r: Array) -> Array:
    """The gap with λ₂ = 0."""
    xp, gamma = namespace(x), problem.gamma
    worst = xp.max(xp.where(problem.nonnegative, g, xp.abs(g)), axis=(-2, -1), keepdims=True)
    some = worst > 0.0
    alpha = xp.where(some, xp.minimum(gamma / xp.where(some, worst, 1.0), 1.0), 1.0)
    return 0.5 * (1.0 - alpha) ** 2 * _total(r * r) + gamma * _total(xp.abs(x)) - alpha * _total(x * g)
