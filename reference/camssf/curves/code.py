"""Sensing matrix → code: layers, proof, finish where that is not enough, and evidence of each problem."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from camssf.curves.finish import SETTLED, finish_steps
from camssf.curves.finish import finish as walk
from camssf.curves.layers import DEPTH, LAYERS
from camssf.curves.problem import Problem, whiten
from camssf.curves.proof import prove
from camssf.curves.sensing import Sensing
from camssf.grid import Floats


@dataclass(frozen=True)
class Code:
    """The optimum and its proof. First axis: the problems, one of the three channels together or three.

    Attributes:
        values: (p, r) x.
        objective: (p,) of the problem above.
        gap: (p,) relative duality gap.
        layers_gap: (p,) the same of the layers' answer, before the finish.
        finish_steps: (p,) pivots that the finish took; 0 where the layers' own proof was enough.
        precision: (p, r, r) H = Aᵀ Σ⁻¹ A.
        log_evidence: (p,) ln of the density of b under x ~ N(0, I): -½ (bᵀ P⁻¹ b + ln det P), P = Σ + A Aᵀ.
    """

    values: Floats
    objective: Floats
    gap: Floats
    layers_gap: Floats
    finish_steps: NDArray[np.int64]
    precision: Floats
    log_evidence: Floats


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
    """The code of each problem.

    Args:
        sensing: matrix (p, N, r), target (p, N), covariance (p, N, N).
        l2: λ₂ ≥ 0.
        gamma: (p,) γ ≥ 0; not 0 where λ₂ = 0.
        nonnegative: x ≥ 0.
        depth, layers: how many layers, and of which kind, of `camssf.curves.layers.LAYERS`.
        finish: most pivots of one walk of the finish, which starts where the layers' gap is above SETTLED; 0 for
            none, None for `finish_steps`.
    """
    steps = finish_steps(sensing.matrix.shape[2]) if finish is None else finish
    found = []
    for A, b, sigma, weight in zip(sensing.matrix, sensing.target, sensing.covariance, gamma, strict=True):
        rows, target, log_det = whiten(A, b, sigma)
        problem = Problem(rows, target, l2, float(weight), nonnegative)
        z = LAYERS[layers](problem).unroll(depth)
        before = prove(problem, z)[1]
        x, taken = walk(problem, z, steps) if steps and before > SETTLED else (z, 0)
        found.append((x, *prove(problem, x), before, taken, problem.H, _evidence(problem, log_det)))
    return Code(*(np.array(each) for each in zip(*found, strict=True)))


def log_evidence(sensing: Sensing) -> float:
    """The evidence of one problem without its solution, a closed form: `Code.log_evidence`."""
    rows, target, log_det = whiten(sensing.matrix[0], sensing.target[0], sensing.covariance[0])
    return _evidence(Problem(rows, target, 1.0, 0.0, False), log_det)


def _evidence(problem: Problem, log_det: float) -> float:
    """-½ (bᵀ P⁻¹ b + ln det P) from whitened rows: P = L (I + A Aᵀ) Lᵀ, Σ = L Lᵀ.

    With K = H + I and the posterior mean x̂ = K⁻¹ g, bᵀ P⁻¹ b = ‖b - A x̂‖² + ‖x̂‖², which an error of x̂ moves in
    second order only, and ln det P = ln det Σ + ln det K.
    """
    root = cho_factor(problem.H + np.eye(problem.g.size))
    x = cho_solve(root, problem.g)
    r = problem.b - problem.A @ x
    return float(-0.5 * (r @ r + x @ x + log_det) - np.log(np.diag(root[0])).sum())
