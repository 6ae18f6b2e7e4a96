"""Code → proof: the objective, and a bound on its distance to the optimum.

With the residual as dual point the duality gap is

    ½ (1 - α)² (‖r‖² + λ₂ ‖x‖²) + γ ‖x‖₁ - α xᵀ w,     w = Aᵀ Σ⁻¹ r - λ₂ x,  r = b - A x,

α ≤ 1 the largest factor that keeps |α w| ≤ γ. It bounds the distance to the optimum from what is measured, not
from what the solver believes. It is given relative to the objective.
"""

from __future__ import annotations

import numpy as np

from camssf.curves.problem import Problem
from camssf.grid import Floats


def prove(problem: Problem, x: Floats) -> tuple[float, float]:
    """Objective and relative duality gap of x."""
    r = problem.b - problem.A @ x
    w = problem.residual(x)
    quadratic = float(r @ r + problem.l2 * x @ x)
    objective = 0.5 * quadratic + problem.gamma * float(np.abs(x).sum())
    worst = float(np.max(w if problem.nonnegative else np.abs(w), initial=0.0))
    if problem.gamma == 0:  # no ball to scale into: strong convexity bounds the gap by the gradient, ½ ‖w‖² / λ₂
        slope = np.where(x == 0, np.maximum(w, 0.0), w) if problem.nonnegative else w
        gap = 0.5 * float(slope @ slope) / problem.l2
    else:
        alpha = min(1.0, problem.gamma / worst) if worst > 0 else 1.0
        gap = 0.5 * (1 - alpha) ** 2 * quadratic + problem.gamma * float(np.abs(x).sum()) - alpha * float(x @ w)
    return objective, max(gap, 0.0) / objective if objective > 0 else 0.0
