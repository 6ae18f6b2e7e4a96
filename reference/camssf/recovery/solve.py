"""Solves each problem of a linear model: layers, duality gap, finish where that is too large, and evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camssf.grid import Floats
from camssf.recovery.basis import Basis
from camssf.recovery.duality_gap import duality_gap
from camssf.recovery.elastic_net import ElasticNet, whiten
from camssf.recovery.layers import DEPTH, LAYERS
from camssf.recovery.linear_model import LinearModel, linear_models
from camssf.recovery.observation import Observation
from camssf.recovery.pivoting import SETTLED, finish_steps
from camssf.recovery.pivoting import pivot_to_optimum as walk


@dataclass(frozen=True)
class Code:
    """The optimum and its duality gap, for p problems: one of the three channels together, or three.

    Attributes:
        values: (p, r) x.
        objective: (p,) of the `ElasticNet`.
        gap: (p,) relative duality gap.
        layers_gap: (p,) the same of the layers' solution, before the finish.
        finish_steps: (p,) pivots of the finish; 0 where the layers' gap was small enough.
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
    linear: LinearModel,
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
        linear: matrix (p, N, r), target (p, N), covariance (p, N, N).
        l2: λ₂ ≥ 0.
        gamma: (p,) γ ≥ 0; not 0 where λ₂ = 0.
        nonnegative: x ≥ 0.
        depth, layers: number of layers, and their name in `camssf.recovery.layers.LAYERS`.
        finish: largest number of pivots of one walk, which is taken where the layers' gap is above SETTLED; 0 for no
            walk, None for `finish_steps`.
    """
    steps = finish_steps(linear.matrix.shape[2]) if finish is None else finish
    found = []
    for A, b, sigma, weight in zip(linear.matrix, linear.target, linear.covariance, gamma, strict=True):
        rows, target, log_det = whiten(A, b, sigma)
        problem = ElasticNet(rows, target, l2, float(weight), nonnegative)
        z = LAYERS[layers](problem).unroll(depth)
        before = duality_gap(problem, z)[1]
        x, taken = walk(problem, z, steps) if steps and before > SETTLED else (z, 0)
        evidence = _evidences(rows, target, log_det)
        found.append((x, *duality_gap(problem, x), before, taken, problem.H, evidence))
    return Code(*(np.array(each) for each in zip(*found, strict=True)))


def log_evidences(observations: Sequence[Observation], basis: Basis) -> Floats:
    """`Code.log_evidence` of each observation in closed form, without solving it."""
    models = linear_models(observations, basis)
    matrix, target, covariance = (
        np.concatenate([getattr(each, name) for each in models]) for name in ("matrix", "target", "covariance")
    )
    return _evidences(*whiten(matrix, target, covariance))


def _evidences(A: Floats, b: Floats, log_det: Floats) -> Floats:
    """-½ (bᵀ P⁻¹ b + ln det P) from whitened rows (..., N, r): P = L (I + A Aᵀ) Lᵀ, Σ = L Lᵀ.

    With K = H + I and the posterior mean x̂ = K⁻¹ g, bᵀ P⁻¹ b = ‖b - A x̂‖² + ‖x̂‖², which an error of x̂ changes in
    second order only, and ln det P = ln det Σ + ln det K.
    """
    across, b = np.swapaxes(A, -1, -2), b[..., None]
    K = across @ A + np.eye(A.shape[-1])
    x = np.linalg.solve(K, across @ b)
    squares = np.sum((b - A @ x) ** 2, axis=(-2, -1)) + np.sum(x**2, axis=(-2, -1))
    return np.asarray(-0.5 * (squares + log_det + np.linalg.slogdet(K)[1]))
