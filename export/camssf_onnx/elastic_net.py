"""Whitened rows and penalties as nodes: `camssf.recovery.elastic_net`, for p problems at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf_onnx.algebra import identity, size_of
from camssf_onnx.graph import Graph, Value


@dataclass(frozen=True)
class ElasticNet:
    """min ½ xᵀ M x - gᵀ x + γ ‖x‖₁ for p problems of N rows and r atoms at once.

    Attributes:
        graph: the graph that gets its nodes.
        A, b: (p, N, r) and (p, N). H, M: (p, r, r). g: (p, r, 1).
        l2, gamma: scalars. positive: whether x ≥ 0. free: whether there are no bounds at all.
        count, r: p and the number of atoms.
    """

    graph: Graph
    A: Value
    b: Value
    H: Value
    M: Value
    g: Value
    l2: Value
    gamma: Value
    positive: Value
    free: Value
    count: int
    r: int

    def rest(self, x: Value) -> Value:
        """b - A x, (p, N, 1)."""
        return self.b.unsqueeze(2) - self.A @ x.unsqueeze(2)

    def pull(self, x: Value) -> Value:
        """Aᵀ (b - A x), (p, r, 1), computed from the rows."""
        return self.A.transpose(0, 2, 1) @ self.rest(x)

    def residual(self, x: Value) -> Value:
        """w = Aᵀ (b - A x) - λ₂ x, (p, r)."""
        return self.pull(x).squeeze(2) - self.l2 * x


def mode_posterior(problem: ElasticNet, D: Value, spread: Value, rest: Value) -> tuple[Value, Value]:
    """Posterior mean and covariance of unknowns u ~ N(0, I) other than the code; the problem's Σ contains D Dᵀ.

    û = Dᵀ P⁻¹ b (1, K, 1) and I - Dᵀ P⁻¹ D (1, K, K) with P = I + A Aᵀ of whitened rows, P⁻¹ = I - A S Aᵀ:
    `posterior` of `camssf.recovery.unnamed_light`.

    Args:
        problem: p = 1.
        D: (1, N, K), whitened.
        spread: (1, R, R) S = (H + I)⁻¹.
        rest: (1, N, 1) b - A S Aᵀ b.
    """
    g = problem.graph
    across = D.transpose(0, 2, 1)
    on_code = across @ problem.A  # (1, K, R)
    known = across @ D - on_code @ spread @ on_code.transpose(0, 2, 1)
    return across @ rest, identity(g, size_of(g, D, 2)) - known


def pose(
    rows: tuple[Value, Value], penalties: tuple[Value, Value], nonnegative: Value, shape: tuple[int, int]
) -> ElasticNet:
    """The problems of whitened rows (A, b) and penalties (λ₂, γ); `shape` is (p, r)."""
    (A, b), (l2, gamma), (count, r) = rows, penalties, shape
    g = A.graph
    across = A.transpose(0, 2, 1)
    H = across @ A
    positive = g.op("Greater", nonnegative, 0.5)
    free = g.op("And", g.op("Equal", gamma, 0.0), g.op("Not", positive))
    return ElasticNet(g, A, b, H, H + l2 * np.eye(r), across @ b.unsqueeze(2), l2, gamma, positive, free, count, r)
