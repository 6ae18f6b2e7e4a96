"""The convex problems of one observation with whole matrices: for tests, golden vectors, benchmarks.

The product whitens the rows without making Σ (`camssf.recovery.whitening`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camssf.grid import Floats
from camssf.recovery.arrays import whiten
from camssf.recovery.basis import Basis
from camssf.recovery.elastic_net import ElasticNet
from camssf.recovery.linear_rows import linear_rows
from camssf.recovery.observation import Observation
from camssf.recovery.rows import paper_rows


@dataclass(frozen=True)
class LinearModel:
    """Linear models b = A x + error, error ~ N(0, Σ), of p problems.

    On a basis with a mean p = 1: x = (x_R, x_G, x_B) and N = 3 k n rows, channel by channel, shot by shot, patch by
    patch. On the paper's basis p = 3, one problem a channel, of N = n rows.

    Attributes:
        matrix: (p, N, r) A.
        target: (p, N) b.
        covariance: (p, N, N) Σ.
    """

    matrix: Floats
    target: Floats
    covariance: Floats

    def whitened(self, l2: float, gamma: float, nonnegative: bool = False) -> ElasticNet:
        """The elastic nets (p,)."""
        columns = np.concatenate([self.matrix, self.target[..., None]], axis=-1)
        rows, _ = whiten(self.covariance, columns)
        penalty = np.full((len(rows), 1, 1), float(gamma))
        return ElasticNet(rows[..., :-1], rows[..., -1:], np.array(float(l2)), penalty, np.array(nonnegative))


def linear_model(observation: Observation, basis: Basis) -> LinearModel:
    """The rows and their covariance: of `linear_rows`, or the paper's, one problem a channel."""
    if basis.prior:
        rows = linear_rows(observation, basis=basis)
        k, n, _ = observation.signals.shape
        order = np.moveaxis(np.arange(3 * k * n).reshape(n, 3, k), 0, -1).ravel()  # by channel, shot, patch
        return LinearModel(rows.A[None, order], rows.b[None, order], rows.covariance[None, order][:, :, order])
    matrix, target, variance = paper_rows(
        observation.signals[0], observation.errors(basis)[0], observation.chart_tolerance, observation.reflectance,
        observation.white_reflectance, observation.lamp[0], basis.dictionary[0],
    )  # fmt: skip
    return LinearModel(np.repeat(matrix, 3, axis=0), target[..., 0], variance * np.eye(variance.shape[-2]))
