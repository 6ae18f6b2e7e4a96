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

import numpy as np

from camssf.grid import Floats
from camssf.recovery.elastic_net import ElasticNet
from camssf.recovery.layers import soft


def duality_gap(problem: ElasticNet, x: Floats) -> tuple[float, float]:
    """Objective and relative duality gap of x."""
    r = problem.b - problem.A @ x
    g = problem.A.T @ r
    l1 = problem.gamma * float(np.abs(x).sum())
    objective = 0.5 * float(r @ r + problem.l2 * x @ x) + l1
    gap = _by_conjugate(problem, x, g) if problem.l2 > 0 else _by_scaling(problem, x, g, r)
    return objective, 0.0 if objective == 0 else max(gap, 0.0) / objective


def _by_conjugate(problem: ElasticNet, x: Floats, g: Floats) -> float:
    """The gap with λ₂ > 0."""
    gamma, l2 = problem.gamma, problem.l2
    short = x - soft(g, gamma, problem.nonnegative) / l2
    inside = np.minimum(g, gamma) if problem.nonnegative else np.clip(g, -gamma, gamma)
    return float(np.sum(0.5 * l2 * short**2 + (gamma * np.abs(x) - x * inside)))


def _by_scaling(problem: ElasticNet, x: Floats, g: Floats, r: Floats) -> float:
    """The gap with λ₂ = 0."""
    worst = float(np.max(g if problem.nonnegative else np.abs(g), initial=0.0))
    alpha = min(1.0, problem.gamma / worst) if worst > 0 else 1.0
    return 0.5 * (1 - alpha) ** 2 * float(r @ r) + problem.gamma * float(np.abs(x).sum()) - alpha * float(x @ g)
