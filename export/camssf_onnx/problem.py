"""Whitened rows and penalties as nodes: `camssf.curves.problem`, three channels side by side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf_onnx.graph import Graph, Value


@dataclass(frozen=True)
class Problem:
    """min ½ xᵀ M x - gᵀ x + γ ‖x‖₁ for three channels at once.

    Attributes:
        graph: that its nodes go into.
        A, b: (3, N, r) and (3, N). M: (3, r, r).
        l2, gamma: scalars. positive: x ≥ 0. free: no bounds at all.
        scale: (3, r) that gives M a unit diagonal.
        r: number of atoms.
    """

    graph: Graph
    A: Value
    b: Value
    M: Value
    l2: Value
    gamma: Value
    positive: Value
    free: Value
    scale: Value
    r: int

    def rest(self, x: Value) -> Value:
        """b - A x, (3, N, 1)."""
        return self.b.unsqueeze(2) - self.A @ x.unsqueeze(2)

    def residual(self, x: Value) -> Value:
        """w = Aᵀ (b - A x) - λ₂ x, (3, r)."""
        return (self.A.transpose(0, 2, 1) @ self.rest(x)).squeeze(2) - self.l2 * x

    def pulled(self, W: Value, pull: Value, rho: Value) -> Value:
        """W g, (3, r, 1), refined on the residual (`splitting`)."""
        u = W @ pull.unsqueeze(2)
        first = u.squeeze(2)
        return u + W @ (self.residual(first) - rho * first).unsqueeze(2)


def pose(
    rows: tuple[Value, Value], quadratic: Value, penalties: tuple[Value, Value], nonnegative: Value, r: int
) -> Problem:
    """The problem of whitened rows (A, b), M and (λ₂, γ)."""
    (A, b), (l2, gamma), g = rows, penalties, quadratic.graph
    positive = g.op("Greater", nonnegative, 0.5)
    free = g.op("And", g.op("Equal", gamma, 0.0), g.op("Not", positive))
    diagonal = (quadratic * np.eye(r)).sum(2)
    scale = 1.0 / g.op("Sqrt", g.op("Where", g.op("Greater", diagonal, 0.0), diagonal, 1.0))
    return Problem(g, A, b, quadratic, l2, gamma, positive, free, scale, r)
