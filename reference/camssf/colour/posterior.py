"""Posterior of reflectance given signals, for a prior of measured surfaces.

Each surface of the prior is weighed by how well it explains the signals; the answer is the weighted mean of their
linear estimates. The formulas are in docs/spectrum.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from camssf.colour.surface_prior import SurfacePrior
from camssf.grid import Floats

METAMERS, NOISE = "metamers", "noise"
NEGLIGIBLE = 1e-5
"""Surfaces with less than this share of the largest weight are left out."""
DARKEST = 1e-6
"""Least level that signals are divided by."""


@dataclass(frozen=True)
class LinearResponse:
    """Signals and outputs as linear functions of reflectance at SURFACE_NODES, and K errors of them.

    Attributes:
        signals: (c, 35); a perfect white gives 1 in each, so rows sum to 1.
        signal_moves: (K, c, 35) changes by one standard deviation of each error.
        outputs: (p, 35) what is asked of the reflectance.
        output_moves: (K, u, 35) changes of the last u outputs by the same errors; the others have none.
        sources: names of the sources of error and which of the K belong to each.
    """

    signals: Floats
    signal_moves: Floats
    outputs: Floats
    output_moves: Floats
    sources: Mapping[str, slice]


@dataclass(frozen=True)
class SurfacePosterior:
    """Outputs of m surfaces given their signals.

    Attributes:
        mean: (m, p).
        covariance: (m, p, p).
        parts: its terms by source, (m, p, p) each: those of the response, "noise", and "metamers", surfaces that
            give equal signals.
        prior_variance: (m, p) of a surface of that level, without a photo.
        distance: (m,) from the nearest surface of the prior, in standard deviations.
        signal_covariance: (m, c, c) of the signals by all errors.
    """

    mean: Floats
    covariance: Floats
    parts: dict[str, Floats]
    prior_variance: Floats
    distance: Floats
    signal_covariance: Floats


def surface_posterior(prior: SurfacePrior, response: LinearResponse, y: Floats, error: Floats) -> SurfacePosterior:
    """The posterior of outputs given signals.

    ℓ is the mean of the signals, at least its standard error, and z = y / ℓ; s_i and C_i are scaled so that A s_i has
    mean 1. With D_i, the errors' changes of A s_i / mean (A s_i), among them the noise's, V_i = A C_i Aᵀ + D_i D_iᵀ
    and G_i = M C_i Aᵀ V_i⁻¹, d_i = z - mean(z) A s_i: the weights are w_i ∝ |V_i|^-½ exp(-½ d_iᵀ V_i⁻¹ d_i) and the
    mean is ℓ Σ w_i (mean(z) M s_i + G_i d_i), where the errors' own changes of M s_i are added to G_i.

    Args:
        prior: of reflectance.
        response: A, M and their errors.
        y: (m, c) signals, white-balanced.
        error: (m, c) standard errors.

    Raises:
        LinAlgError: a response of which no posterior can be computed.
    """
    level = np.maximum.reduce([y.mean(axis=1), np.linalg.norm(error, axis=1) / y.shape[1], np.full(len(y), DARKEST)])
    components = _Components.of(prior, response)
    found = [components.given(y[i] / level[i], (error[i] / level[i]) ** 2, level[i]) for i in range(len(y))]
    p = len(response.outputs)
    c = y.shape[1]
    names = (*response.sources, NOISE, METAMERS)
    parts = {name: np.array([each.parts[name] for each in found]).reshape(-1, p, p) for name in names}
    return SurfacePosterior(
        np.array([each.mean for each in found]).reshape(-1, p),
        np.sum([parts[name] for name in names], axis=0),
        parts,
        level[:, None] ** 2 * components.prior_variance(),
        np.array([each.distance for each in found]),
        np.array([each.signal_covariance for each in found]).reshape(-1, c, c),
    )


class _Given(NamedTuple):
    """Mean (p,), parts of the covariance, (p, p) each, distance, and covariance of the signals (c, c)."""

    mean: Floats
    parts: dict[str, Floats]
    distance: float
    signal_covariance: Floats


@dataclass(frozen=True)
class _Components:
    """The prior's surfaces as a response sees them, each scaled so that its signals have mean 1.

    Attributes:
        response: A, M and their errors.
        log_weights: (N,).
        shapes: (N, 35) s_i.
        covariances: (N, 35, 35) C_i.
        expected: (N, c) A s_i.
        covariance_signals: (N, 35, c) C_i Aᵀ.
        own: (N, c, c) A C_i Aᵀ.
        errors: covariance (N, c + 1 + u, c + 1 + u) by source: of the signals over their level, of the level
            (relative) and of the last u outputs.
    """

    response: LinearResponse
    log_weights: Floats
    shapes: Floats
    covariances: Floats
    expected: Floats
    covariance_signals: Floats
    own: Floats
    errors: dict[str, Floats]

    @classmethod
    def of(cls, prior: SurfacePrior, response: LinearResponse) -> _Components:
        """The surfaces of a prior.

        Raises:
            LinAlgError: curves, too negative, through which a surface gives no signal.
        """
        a = response.signals
        scale = (prior.shapes @ a.T).mean(axis=1)
        if not (scale > 0).all():
            raise np.linalg.LinAlgError("a surface of the prior gives no signal")
        shapes = prior.shapes / scale[:, None]
        expected = shapes @ a.T
        moves = np.einsum("kcj,nj->nkc", response.signal_moves, shapes, optimize=True)
        level = moves.mean(axis=2, keepdims=True)
        moved = np.einsum("kuj,nj->nku", response.output_moves, shapes, optimize=True)
        joint = np.concatenate([moves - expected[:, None] * level, level, moved], axis=2)
        errors = {name: np.swapaxes(joint[:, rows], 1, 2) @ joint[:, rows] for name, rows in response.sources.items()}
        # A surface's own change of the level is divided out, too: u - s_i mean(A u) remains of a change u.
        mean = a.mean(axis=0)
        covariances = prior.covariances / scale[:, None, None] ** 2
        share = covariances @ mean
        out = shapes[:, :, None] * (share - 0.5 * (share @ mean)[:, None] * shapes)[:, None]
        covariances = covariances - out - np.swapaxes(out, 1, 2)
        crossed = covariances @ a.T
        own = np.einsum("cj,njd->ncd", a, crossed, optimize=True)
        return cls(response, prior.log_weights, shapes, covariances, expected, crossed, own, errors)

    def given(self, z: Floats, noise: Floats, level: float) -> _Given:
        """The posterior for signals z (c,) over a level.

        Args:
            z: signals over their level.
            noise: (c,) variances of z.
            level: that z was divided by.
        """
        m, c = self.response.outputs, len(z)
        bright = z.mean()
        off = z - bright * self.expected
        errors = self.errors | {NOISE: self._of_noise(noise)}
        # Nothing changes the mean of z, so any variance of it serves.
        spread = self.own + sum(each[:, :c, :c] for each in errors.values()) + 1.0
        inverse = np.linalg.inv(spread)
        squares = np.einsum("nc,ncd,nd->n", off, inverse, off)
        log = self.log_weights - 0.5 * (np.linalg.slogdet(spread)[1] + squares)
        weights = np.exp(log - log.max())
        kept = np.flatnonzero(weights > NEGLIGIBLE)
        weights = weights[kept] / weights[kept].sum()
        centre, crossed = self.shapes[kept] @ m.T, m @ self.covariance_signals[kept]
        errors = {name: each[kept] for name, each in errors.items()}
        # An error of the level scales all outputs. The signals tell of errors, too, and so of what these do.
        slopes = np.zeros((len(kept), len(m), c + 1 + self.response.output_moves.shape[1]))
        slopes[:, :, c] = -centre
        moved = slopes.shape[2] - c - 1
        slopes[:, len(m) - moved :, c + 1 :] = np.eye(moved)
        total = sum(errors.values(), np.zeros(1))
        gain = (crossed + slopes @ total[:, :, :c]) @ inverse[kept]
        slopes[:, :, :c] = -gain
        means = bright * centre + (gain @ off[kept][:, :, None])[:, :, 0]
        mean = weights @ means

        def summed(left: Floats, right: Floats) -> Floats:
            """Σ w_i left_i right_iᵀ of (k, p, any) each."""
            return np.tensordot(left * weights[:, None, None], right, axes=((0, 2), (0, 2)))

        direct = np.tensordot(weights, self.covariances[kept], axes=1)
        both = summed(gain, crossed)
        apart = (means - mean)[:, :, None]
        parts = {name: summed(slopes @ each, slopes) for name, each in errors.items()}
        parts[METAMERS] = (
            m @ direct @ m.T - both - both.T + summed(gain @ self.own[kept], gain) + summed(apart, apart)
        )
        scaled = {name: level**2 * each for name, each in parts.items()}
        # A change of the level moves all signals.
        signals = np.concatenate([np.tile(np.eye(c), (len(kept), 1, 1)), self.expected[kept][:, :, None]], axis=2)
        moved_signals = level**2 * summed(signals @ total[:, : c + 1, : c + 1], signals)
        return _Given(level * mean, scaled, float(np.sqrt(squares.min())), moved_signals)

    def _of_noise(self, variances: Floats) -> Floats:
        """(N, c + 1 + u, c + 1 + u) as in `errors`, of independent errors of z with these variances (c,)."""
        c = len(variances)
        moves = np.zeros((len(self.expected), c + 1 + self.response.output_moves.shape[1], c))
        moves[:, :c] = np.eye(c) - self.expected[:, :, None] / c
        moves[:, c] = 1.0 / c
        return np.asarray((moves * variances) @ np.swapaxes(moves, 1, 2))

    def prior_variance(self) -> Floats:
        """(p,) variance of the outputs of a surface of level 1, without a photo."""
        weights = np.exp(self.log_weights - self.log_weights.max())
        weights /= weights.sum()
        m = self.response.outputs
        centre = self.shapes @ m.T
        mean = weights @ centre
        own = m @ np.tensordot(weights, self.covariances, axes=1) @ m.T
        return np.asarray(np.diagonal(own) + weights @ (centre - mean) ** 2)
