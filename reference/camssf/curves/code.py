"""Sensing matrix → code: layers, finish and proof of each channel's problem."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camssf.curves.finish import finish as walk
from camssf.curves.finish import finish_steps
from camssf.curves.layers import DEPTH, LAYERS, soft
from camssf.curves.problem import Problem, whiten
from camssf.curves.proof import prove
from camssf.curves.sensing import Sensing
from camssf.grid import Floats

__all__ = ["DEPTH", "Code", "finish_steps", "soft", "solve", "whiten"]


@dataclass(frozen=True)
class Code:
    """The optimum and its proof. First axis: channels R, G, B.

    Attributes:
        values: (3, r) x.
        objective: (3,) of the problem above.
        gap: (3,) relative duality gap.
        unrolled_gap: (3,) the same before the finish.
        pivots: (3,) steps that the finish took.
        precision: (3, r, r) H = Aᵀ Σ⁻¹ A.
    """

    values: Floats
    objective: Floats
    gap: Floats
    unrolled_gap: Floats
    pivots: NDArray[np.int64]
    precision: Floats


def solve(
    sensing: Sensing,
    l2: float,
    gamma: Floats,
    *,
    nonnegative: bool = False,
    depth: int = DEPTH,
    finish: int | None = None,
    layers: str = "splitting",
) -> Code:
    """The code of each channel.

    Args:
        sensing: matrix (3, k n, r), target (3, k n), covariance (3, k n, k n).
        l2: λ₂ ≥ 0.
        gamma: (3,) γ ≥ 0; not 0 where λ₂ = 0.
        nonnegative: x ≥ 0.
        depth, layers: how many layers, and of which kind, of `camssf.curves.layers.LAYERS`.
        finish: most pivots of one walk of the finish; 0 for none, None for `finish_steps`.
    """
    steps = finish_steps(sensing.matrix.shape[2]) if finish is None else finish
    found = []
    for A, b, sigma, weight in zip(sensing.matrix, sensing.target, sensing.covariance, gamma, strict=True):
        problem = Problem(*whiten(A, b, sigma), l2, float(weight), nonnegative)
        z = LAYERS[layers](problem).unroll(depth)
        x, taken = walk(problem, z, steps) if steps else (z, 0)
        found.append((x, *prove(problem, x), prove(problem, z)[1], taken, problem.H))
    values, objective, gap, before, pivots, precision = (np.array(each) for each in zip(*found, strict=True))
    return Code(values, objective, gap, before, pivots, precision)
