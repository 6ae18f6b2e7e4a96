"""The linear model of one observation with whole matrices, and its solution: for tests, golden vectors, benchmarks.

The product whitens the rows without making Σ (`camssf.recovery.whitening`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.arrays import inverse, whiten
from camssf.recovery.basis import Basis, interpolate
from camssf.recovery.covariance import SOURCES
from camssf.recovery.duality_gap import duality_gap
from camssf.recovery.elastic_net import ElasticNet
from camssf.recovery.inputs import hypotheses_of
from camssf.recovery.layers import DEPTH, LAYERS
from camssf.recovery.observation import Observation
from camssf.recovery.optimum import optimum
from camssf.recovery.posterior import log_evidence
from camssf.recovery.rows import fold_hypotheses, paper_rows
from camssf.recovery.whitening import linearise, target_at


@dataclass(frozen=True)
class LinearModel:
    """Linear models b = A x + error, error ~ N(0, Σ), of p problems.

    On a basis with a mean p = 1: x = (x_R, x_G, x_B) and N = 3 k n rows, channel by channel, shot by shot, patch by
    patch. On the paper's basis p = 3, one problem a channel, of N = n rows.

    Attributes:
        matrix: (p, N, r) A.
        target: (p, N) b.
        covariance: (p, N, N) Σ.
        terms: the summands of Σ by source, (p, N, N) each.
        lamp: (k, 681) each shot's lamp in the rows: the given lamp, changed by the estimate of its modes.
        modes: (N, k q) D, derivatives of the rows by the lamp modes; D Dᵀ is included in `terms`.
        gains: (N, k g) D of the gain modes; also included in `terms`.
    """

    matrix: Floats
    target: Floats
    covariance: Floats
    terms: dict[str, Floats] = field(default_factory=dict)
    lamp: Floats = field(default_factory=lambda: np.zeros((0, WAVELENGTHS.size)))
    modes: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    gains: Floats = field(default_factory=lambda: np.zeros((0, 0)))


def linear_model(observation: Observation, basis: Basis) -> LinearModel:
    """The rows and their covariance: formulas in `camssf.recovery.whitening.whitened_model`."""
    if not basis.prior:
        return _paper_model(observation, basis)
    folded = fold_hypotheses(hypotheses_of([observation], basis))
    k, n, q, g, _ = folded.sizes
    rows, modes, point = linearise(folded)
    q, g = min(q, observation.lamp_modes.shape[1]), min(g, observation.gain_modes.shape[1])
    D, gains = modes.lamps[..., : k * q], modes.gains[..., : k * g]
    order = np.moveaxis(np.arange(3 * k * n).reshape(n, 3, k), 0, -1).ravel()  # by channel, shot, patch
    parts = (
        rows.covariance.noise_term,
        rows.covariance.chart_term,
        rows.covariance.white @ rows.covariance.white.mT,
        rows.covariance.lamp @ rows.covariance.lamp.mT,
        D @ D.mT + modes.curvature,
        gains @ gains.mT + modes.by_channel @ modes.by_channel.mT,
    )
    terms = {source: part[:, order][:, :, order] for source, part in zip(SOURCES, parts, strict=True)}
    return LinearModel(
        matrix=rows.A[:, order],
        target=target_at(rows, modes, point)[:, order, 0],
        covariance=np.sum(list(terms.values()), axis=0),
        terms=terms,
        lamp=observation.lamp * interpolate(point.lamp[0].mT).mT,
        modes=D[0, order],
        gains=gains[0, order],
    )


def _paper_model(observation: Observation, basis: Basis) -> LinearModel:
    """The paper's rows, one problem a channel."""
    matrix, target, variance = paper_rows(
        observation.signals[0], observation.errors(basis)[0], observation.chart_tolerance, observation.reflectance,
        observation.white_reflectance, observation.lamp[0], basis.dictionary[0],
    )  # fmt: skip
    sigma = variance * np.eye(variance.shape[-2])
    return LinearModel(np.repeat(matrix, 3, axis=0), target[..., 0], sigma, {"noise": sigma}, observation.lamp)


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
    layers: str = "splitting",
) -> Code:
    """The code of each problem.

    Args:
        linear: matrix (p, N, r), target (p, N), covariance (p, N, N).
        l2: λ₂ ≥ 0.
        gamma: (p,) γ ≥ 0; not 0 where λ₂ = 0.
        nonnegative: x ≥ 0.
        depth, layers: number of layers, and their name in `camssf.recovery.layers.LAYERS`.
    """
    problem, log_det = whitened_problem(linear, l2, gamma, nonnegative)
    solution = optimum(problem, LAYERS[layers](problem), depth=depth)
    objective, _ = duality_gap(problem, solution.x)
    spread, more = inverse(problem.H + np.eye(solution.x.shape[-2]))
    evidence = log_evidence(problem.A, problem.b, spread @ problem.g, log_det + more)
    numbers = (matrix[:, 0, 0] for matrix in (objective, solution.gap, solution.layers_gap, solution.pivots))
    objective, gap, layers_gap, pivots = numbers
    return Code(solution.x[..., 0], objective, gap, layers_gap, np.rint(pivots).astype(np.int64), problem.H, evidence)


def whitened_problem(
    linear: LinearModel, l2: float, gamma: Floats, nonnegative: bool = False
) -> tuple[ElasticNet, Floats]:
    """The elastic nets (p,) of a linear model, and ln det Σ (p,)."""
    columns = np.concatenate([linear.matrix, linear.target[..., None]], axis=-1)
    rows, log_det = whiten(linear.covariance, columns)
    penalty = np.asarray(gamma, float).reshape(-1, 1, 1)
    return ElasticNet(rows[..., :-1], rows[..., -1:], np.array(float(l2)), penalty, np.array(nonnegative)), log_det
