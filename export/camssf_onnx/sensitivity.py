"""The curves, their bands and what follows from them as nodes: `camssf.recovery.sensitivity`, same names."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.recovery.basis import NODES
from camssf_onnx.graph import Graph, Value


@dataclass(frozen=True)
class Answer:
    """Curves (m, 3), their standard deviations (m, 3), predicted signals (k, n, 3), lamp (k, m).

    `response` (k, 3) is that to white, relative to that of the basis's mean under the first lamp.
    """

    ssf: Value
    std: Value
    predicted: Value
    lamp: Value
    response: Value


def own_blocks(covariance: Value, r: int) -> Value:
    """Diagonal blocks (..., 3, r, r), one a channel, of covariances (..., 3 r, 3 r) of the three channels' codes."""
    blocks = [covariance.slice(c * r, c * r + r, -1).slice(c * r, c * r + r, -2).unsqueeze(-3) for c in range(3)]
    return covariance.graph.op("Concat", *blocks, axis=-3)


def moves_of_peak_one(g: Graph, s: Value, atoms: Value) -> Value:
    """Derivative of the curves (3, v) of peak 1 by the code, times the peak, (3, v, r)."""
    v = NODES.size
    shape = s / s.max(1, keep=True)
    top = g.op("ArgMax", s, axis=1, keepdims=1)
    peak = g.op("Equal", top, g.constant(np.arange(v), np.int64)).real()  # (3, v)
    return atoms - shape.unsqueeze(2) * (peak.unsqueeze(1) @ atoms)


def variance_of_curves(g: Graph, moves: Value, spread: Value) -> tuple[Value, Value]:
    """Variance of curves, moves (3, v, r) times a code of covariance (..., 3, r, r).

    At the nodes (..., 3, v), and at the grid's points from each node to the next (..., 3, v - 1, 10).
    """
    v = NODES.size
    reach = moves.here(spread.graph) @ spread
    here = (reach * moves).sum(-1)
    next_ = (reach.slice(0, v - 1, -2) * moves.slice(1, v, 1)).sum(-1)
    left = 1.0 - np.arange(10) / 10.0
    right = 1.0 - left
    between = (
        here.slice(0, v - 1, -1).unsqueeze(-1) * left**2
        + next_.unsqueeze(-1) * (2.0 * left * right)
        + here.slice(1, v, -1).unsqueeze(-1) * right**2
    )
    return here, between
