"""Posterior of reflectance given signals, for a prior of measured surfaces.

Each surface of the prior is weighed by how well it explains the signals; the answer is the weighted mean of their
linear estimates. The formulas are in docs/spectrum.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from camssf.grid import Floats
from camssf.recovery.arrays import Array, chosen, eye, inverse, namespace
from camssf_colour.surface_prior import SurfacePrior

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

    signals: Array
    signal_moves: Array
    outputs: Array
    output_moves: Array
    sources: Mapping[str, slice]


@dataclass(frozen=True)
class SurfacePosterior:
    """Outputs of m surfaces given their signals.

    Attributes:
        mean: (m, p).
        parts: terms of its covariance by source, (m, p, p) each: those of the response, "noise", and "metamers",
            surfaces that give equal signals.
        prior_variance: (m, p) of a surface of that level, without a photo.
        distance: (m,) from the nearest surface of the prior, in standard deviations.
        signal_covariance: (m, c, c) of the signals by all errors.
    """

    mean: Array
    parts: dict[str, Array]
    prior_variance: Array
    distance: Array
    signal_covariance: Array

    @cached_property
    def covariance(self) -> Floats:
        """(m, p, p), the sum of its parts."""
        return np.asarray(np.sum(list(self.parts.values()), axis=0))


def surface_posterior(prior: SurfacePrior, response: LinearResponse, y: Floats, error: Floats) -> SurfacePosterior:
    """The posterior of outputs given the signals of each of m surfaces, `posterior_of`.

    Args:
        prior: of reflectance.
        response: A, M and their errors.
        y: (m, c) signals, white-balanced.
        error: (m, c) standard errors.

    Raises:
        LinAlgError: a response of which no posterior can be computed: curves, too negative, through which a surface
            gives no signal.
    """
    if not ((prior.shapes @ response.signals.T).mean(axis=1) > 0).all():
        raise np.linalg.LinAlgError("a surface of the prior gives no signal")
    components = components_of(prior.log_weights, prior.shapes, prior.covariances, response)
    given = [posterior_of(components, response, *pair) for pair in zip(y, error, strict=True)]
    p, c = len(response.outputs), y.shape[1]
    names = (*response.sources, NOISE, METAMERS)
    return SurfacePosterior(
        np.array([one.mean for one in given]).reshape(-1, p),
        {name: np.array([one.parts[name] for one in given]).reshape(-1, p, p) for name in names},
        np.array([one.prior_variance for one in given]).reshape(-1, p),
        np.array([one.distance for one in given]),
        np.array([one.signal_covariance for one in given]).reshape(-1, c, c),
    )


@dataclass(frozen=True)
class Components:
    """The prior's N surfaces as a response sees them, each scaled so that its signals have mean 1.

    Attributes:
        log_weights: (N,).
        shapes: (N, 35) s_i.
        covariances: (N, 35, 35) C_i.
        expected: (N, c) A s_i.
        covariance_signals: (N, 35, c) C_i Aᵀ.
        own: (N, c, c) A C_i Aᵀ.
        errors: covariance (N, c + 1 + u, c + 1 + u) by source: of the signals over their level, of the level
            (relative) and of the last u outputs.
        prior_variance: (p,) of the outputs of a surface of level 1, without a photo.
    """

    log_weights: Array
    shapes: Array
    covariances: Array
    expected: Array
    covariance_signals: Array
    own: Array
    errors: dict[str, Array]
    prior_variance: Array


def components_of(log_weights: Array, shapes: Array, covariances: Array, response: LinearResponse) -> Components:
    """The surfaces of a prior, with its fields (N,), (N, 35) and (N, 35, 35)."""
    xp, a = namespace(response.signals), response.signals
    (n, j), (K, c, _), u = shapes.shape, response.signal_moves.shape, response.output_moves.shape[1]
    scale = xp.mean(shapes @ a.mT, axis=1)
    shapes = shapes / scale[:, None]
    expected = shapes @ a.mT
    moves, moved = (
        xp.reshape(shapes @ xp.reshape(changes, (K * size, j)).mT, (n, K, size))
        for changes, size in ((response.signal_moves, c), (response.output_moves, u))
    )
    level = xp.mean(moves, axis=2, keepdims=True)
    joint = xp.concat([moves - expected[:, None, :] * level, level, moved], axis=2)
    errors = {name: joint[:, rows, :].mT @ joint[:, rows, :] for name, rows in response.sources.items()}
    # A surface's own change of the level is divided out, too: u - s_i mean(A u) remains of a change u.
    mean = xp.mean(a, axis=0)[:, None]
    covariances = covariances / (scale * scale)[:, None, None]
    share = covariances @ mean  # (n, 35, 1)
    out = shapes[:, :, None] * (share[:, :, 0] - 0.5 * (share.mT @ mean)[:, :, 0] * shapes)[:, None, :]
    covariances = covariances - out - out.mT
    crossed = covariances @ a.mT
    variance = _prior_variance(log_weights, shapes, covariances, response.outputs)
    return Components(log_weights, shapes, covariances, expected, crossed, a @ crossed, errors, variance)


def posterior_of(components: Components, response: LinearResponse, y: Array, error: Array) -> SurfacePosterior:
    """The posterior of outputs given the signals y (c,) of a surface, with standard errors (c,); no axis m.

    ℓ is the mean of the signals, at least its standard error, and z = y / ℓ; s_i and C_i are scaled so that A s_i has
    mean 1. With D_i, the errors' changes of A s_i / mean (A s_i), among them the noise's, V_i = A C_i Aᵀ + D_i D_iᵀ
    and G_i = M C_i Aᵀ V_i⁻¹, d_i = z - mean(z) A s_i: the weights are w_i ∝ |V_i|^-½ exp(-½ d_iᵀ V_i⁻¹ d_i) and the
    mean is ℓ Σ w_i (mean(z) M s_i + G_i d_i), where the errors' own changes of M s_i are added to G_i.
    """
    xp, m, c = namespace(y), response.outputs, y.shape[0]
    p, u = m.shape[0], response.output_moves.shape[1]
    count = xp.sum(xp.ones((c,), dtype=xp.float64))
    level = xp.maximum(xp.maximum(xp.mean(y), xp.sqrt(xp.sum(error * error)) / count), DARKEST)
    z, noise = y / level, (error / level) ** 2
    bright = xp.mean(z)
    off = z - bright * components.expected
    errors = components.errors | {NOISE: _of_noise(components.expected, noise, u)}
    total = sum(errors.values(), xp.zeros((), dtype=xp.float64))
    # Nothing changes the mean of z, so any variance of it serves.
    inverses, log_dets = inverse(components.own + total[:, :c, :c] + 1.0)
    squares = xp.sum((off[:, None, :] @ inverses)[:, 0, :] * off, axis=1)
    logarithms = components.log_weights - 0.5 * (log_dets + squares)
    weights = xp.exp(logarithms - xp.max(logarithms))
    weights, shapes, covariances, crossed, own, inverses, off, expected, total, *kept = chosen(
        weights > NEGLIGIBLE,
        [
            weights, components.shapes, components.covariances, components.covariance_signals, components.own,
            inverses, off, components.expected, total, *errors.values(),
        ],
    )  # fmt: skip
    weights = weights / xp.sum(weights)
    centre, crossed = shapes @ m.mT, m @ crossed
    # An error of the level scales all outputs. The signals tell of errors, too, and so of what these do.
    last = xp.concat([xp.zeros((p - u, u), dtype=xp.float64), eye(xp, u)], axis=0)
    own_slopes = xp.concat([-centre[:, :, None], xp.broadcast_to(last, (*centre.shape, u))], axis=2)
    gain = (crossed + own_slopes @ total[:, c:, :c]) @ inverses
    slopes = xp.concat([-gain, own_slopes], axis=2)
    means = bright * centre + (gain @ off[:, :, None])[:, :, 0]
    mean = (weights[None, :] @ means)[0, :]

    def summed(left: Array, right: Array) -> Array:
        """Σ w_i left_i right_iᵀ of (k, p, any) each."""
        k, rows, size = left.shape
        weighed = xp.permute_dims(left * weights[:, None, None], (1, 0, 2))
        return xp.reshape(weighed, (rows, k * size)) @ xp.reshape(right.mT, (k * size, right.shape[1]))

    k, j = shapes.shape
    direct = xp.reshape(weights[None, :] @ xp.reshape(covariances, (k, j * j)), (j, j))
    both = summed(gain, crossed)
    apart = (means - mean)[:, :, None]
    parts = {name: summed(slopes @ of_source, slopes) for name, of_source in zip(errors, kept, strict=True)}
    parts[METAMERS] = m @ direct @ m.mT - both - both.mT + summed(gain @ own, gain) + summed(apart, apart)
    # A change of the level moves all signals.
    signals = xp.concat([xp.broadcast_to(eye(xp, c), (k, c, c)), expected[:, :, None]], axis=2)
    return SurfacePosterior(
        mean=level * mean,
        parts={name: level**2 * part for name, part in parts.items()},
        prior_variance=level**2 * components.prior_variance,
        distance=xp.sqrt(xp.min(squares)),
        signal_covariance=level**2 * summed(signals @ total[:, : c + 1, : c + 1], signals),
    )


def _of_noise(expected: Array, variances: Array, u: Any) -> Array:
    """(N, c + 1 + u, c + 1 + u) as in `Components.errors`, of independent errors of z with these variances (c,)."""
    xp, (n, c) = namespace(expected), expected.shape
    mean = xp.ones((n, 1, c), dtype=xp.float64) / xp.sum(xp.ones((c,), dtype=xp.float64))
    moves = xp.concat([eye(xp, c) - expected[:, :, None] * mean, mean, xp.zeros((n, u, c), dtype=xp.float64)], axis=1)
    return (moves * variances) @ moves.mT


def _prior_variance(log_weights: Array, shapes: Array, covariances: Array, m: Array) -> Array:
    """(p,) variance of the outputs M of the prior's surfaces."""
    xp, (n, j) = namespace(m), shapes.shape
    weights = xp.exp(log_weights - xp.max(log_weights))
    weights = (weights / xp.sum(weights))[None, :]
    centre = shapes @ m.mT
    covariance = xp.reshape(weights @ xp.reshape(covariances, (n, j * j)), (j, j))
    spread = weights @ (centre - weights @ centre) ** 2
    return xp.sum((m @ covariance) * m, axis=1) + spread[0, :]
