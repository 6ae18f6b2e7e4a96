"""Solves an elastic net: layers, their duality gap, and a walk where that is too large."""

from __future__ import annotations

from dataclasses import dataclass

from camssf.recovery.arrays import Array
from camssf.recovery.duality_gap import duality_gap
from camssf.recovery.elastic_net import ElasticNet
from camssf.recovery.layers import DEPTH, Layer, splitting
from camssf.recovery.pivoting import pivot_to_optimum


@dataclass(frozen=True)
class Optimum:
    """The solution of a stack of p elastic nets, and how near it is to the optimum.

    Attributes:
        x: (p, r, 1).
        gap: (p, 1, 1) relative duality gap.
        layers_gap: (p, 1, 1) the same of the layers' solution.
        pivots: (p, 1, 1) of the walk; 0 where the layers' gap was small enough.
    """

    x: Array
    gap: Array
    layers_gap: Array
    pivots: Array


def optimum(
    problem: ElasticNet, layer: Layer | None = None, *, depth: int = DEPTH, steps: int | None = None
) -> Optimum:
    """The optimum by `depth` layers, and at most `steps` pivots a walk (0: no walk, None: `finish_steps`)."""
    z = (splitting(problem) if layer is None else layer).unroll(depth)
    layers_gap = duality_gap(problem, z)[1]
    if steps == 0:
        return Optimum(z, layers_gap, layers_gap, 0.0 * layers_gap)
    x, gap, pivots = pivot_to_optimum(problem, z, layers_gap, steps)
    return Optimum(x, gap, layers_gap, pivots)
