"""Posterior of reflectance given signals, for a prior of measured surfaces.

Each surface of the prior is weighed by how well it explains the signals; the answer is the weighted mean of their
linear estimates: `posterior_of`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from camssf.grid import Floats
from camssf.recovery.arrays import Array, chosen, each_block, eye, inverse, namespace
from camssf_colour.surface_prior import SurfacePrior

METAMERS, NOISE = "metamers", "noise"
NEGLIGIBLE = 1e-5
"""Surfaces with less than this share of the largest weight are left out."""
DARKEST = 1e-6
"""Least level that signals are divided by."""

CHANNELS = 3
"""Signals of a photo."""


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
    components = components_of(prior, response)
    if not (components.scale > 0).all():
        raise np.linalg.LinAlgError("a surface of the prior gives no signal")
    given = [posterior_of(components, *pair) for pair in zip(y, error, strict=True)]
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
        scale: (N,) mean signal that s_i was divided by.
        variances: (N, v) of the prior's shared covariances, of s_i so scaled.
        shared: (v, r, r) these covariances, of the c signals and the p outputs after them; r = c + p.
        changes: (N, q, r) the prior's, of signals and outputs.
        expected: (N, r) signals and outputs of s_i.
        of_level: (N, r); its products with `expected` are what the change of the level takes from the covariance.
        crossed: (N, r, c) covariance of signals and outputs with the signals.
        errors: covariance (N, c + 1 + u, c + 1 + u) by source: of the signals over their level, of the level
            (relative) and of the last u outputs.
        prior_variance: (p,) of the outputs of a surface of level 1, without a photo.
    """

    log_weights: Array
    scale: Array
    variances: Array
    shared: Array
    changes: Array
    expected: Array
    of_level: Array
    crossed: Array
    errors: dict[str, Array]
    prior_variance: Array


def components_of(prior: SurfacePrior, response: LinearResponse) -> Components:
    """The surfaces of a prior as a response sees them."""
    xp, a = namespace(response.signals), response.signals
    (n, j), (K, c, _), u = prior.shapes.shape, response.signal_moves.shape, response.output_moves.shape[1]
    rows = xp.concat([a, response.outputs], axis=0)
    scale = xp.mean(prior.shapes @ a.mT, axis=1)
    shapes = prior.shapes / scale[:, None]
    expected = shapes @ rows.mT
    moves, moved = (
        xp.reshape(shapes @ xp.reshape(changes, (K * size, j)).mT, (n, K, size))
        for changes, size in ((response.signal_moves, c), (response.output_moves, u))
    )
    level = xp.mean(moves, axis=2, keepdims=True)
    joint = xp.concat([moves - expected[:, None, :c] * level, level, moved], axis=2)
    errors = {name: joint[:, kept, :].mT @ joint[:, kept, :] for name, kept in response.sources.items()}
    variances = prior.variances / (scale * scale)[:, None]
    shared, changes = rows @ prior.shared @ rows.mT, (shapes[:, None, :] * prior.changes) @ rows.mT
    (v, r, _) = shared.shape
    crossed = xp.reshape(variances @ xp.reshape(shared[:, :, :c], (v, r * c)), (n, r, c))
    crossed = crossed + changes.mT @ changes[:, :, :c]
    # A surface's own change of the level is divided out, too: u - s_i mean(A u) remains of a change u.
    of_level = xp.mean(crossed, axis=2)
    of_level = of_level - 0.5 * xp.mean(of_level[:, :c], axis=1, keepdims=True) * expected
    crossed = crossed - expected[:, :, None] * of_level[:, None, :c] - of_level[:, :, None] * expected[:, None, :c]
    weights = xp.exp(prior.log_weights - xp.max(prior.log_weights))
    weights = weights / xp.sum(weights)
    found = Components(
        prior.log_weights, scale, variances, shared, changes, expected, of_level, crossed, errors, weights
    )
    apart = expected - weights[None, :] @ expected
    variance = xp.sum(_covariance(found, weights) * eye(xp, r), axis=1) + (weights[None, :] @ (apart * apart))[0, :]
    return replace(found, prior_variance=variance[c:])


def _covariance(components: Components, weights: Array) -> Array:
    """(r, r) mean of the surfaces' covariances of signals and outputs by weights (N,)."""
    xp, (v, r, _) = namespace(weights), components.shared.shape
    shared = weights[None, :] @ components.variances @ xp.reshape(components.shared, (v, r * r))
    of_level = _weighed(weights, components.of_level[:, :, None], components.expected[:, :, None])
    changes = _weighed(weights, components.changes.mT, components.changes.mT)
    return xp.reshape(shared, (r, r)) + changes - of_level - of_level.mT


def _weighed(weights: Array, left: Array, right: Array) -> Array:
    """Σ w_i left_i right_iᵀ of (N, any, k) each."""
    xp, (n, rows, size) = namespace(left), left.shape
    columns = xp.permute_dims(left * weights[:, None, None], (1, 0, 2))
    return xp.reshape(columns, (rows, n * size)) @ xp.reshape(right.mT, (n * size, right.shape[1]))


def posterior_of(components: Components, y: Array, error: Array) -> SurfacePosterior:
    """The posterior of outputs given the signals y (c,) of a surface, with standard errors (c,); no axis m.

    ℓ is the mean of the signals, at least its standard error, and z = y / ℓ; s_i and C_i are scaled so that A s_i has
    mean 1. With D_i, the errors' changes of A s_i / mean (A s_i), among them the noise's, V_i = A C_i Aᵀ + D_i D_iᵀ
    and G_i = M C_i Aᵀ V_i⁻¹, d_i = z - mean(z) A s_i: the weights are w_i ∝ |V_i|^-½ exp(-½ d_iᵀ V_i⁻¹ d_i) and the
    mean is ℓ Σ w_i (mean(z) M s_i + G_i d_i), where the errors' own changes of M s_i are added to G_i.
    """
    xp, c = namespace(y), y.shape[0]
    count = xp.sum(xp.ones((c,), dtype=xp.float64))
    level = xp.maximum(xp.maximum(xp.mean(y), xp.sqrt(xp.sum(error * error)) / count), DARKEST)
    z, errors = y / level, components.errors | {NOISE: _of_noise(components, (error / level) ** 2)}
    total, inverses, log_dets = _spread(components, errors, c)
    bright = xp.mean(z)
    off = z - bright * components.expected[:, :c]
    squares = xp.sum((off[:, None, :] @ inverses)[:, 0, :] * off, axis=1)
    logarithms = components.log_weights - 0.5 * (log_dets + squares)
    weights = xp.exp(logarithms - xp.max(logarithms))
    weights, total, inverses, off, variances, changes, expected, of_level, crossed, *chosen_errors = chosen(
        weights > NEGLIGIBLE,
        [
            weights, total, inverses, off, components.variances, components.changes, components.expected,
            components.of_level, components.crossed, *errors.values(),
        ],
    )  # fmt: skip
    weights = weights / xp.sum(weights)
    kept = replace(
        components, variances=variances, changes=changes, expected=expected, of_level=of_level, crossed=crossed
    )
    gain, own_slopes = _gain(kept, total, inverses)
    slopes = xp.concat([-gain, own_slopes], axis=2)
    means = bright * expected[:, c:] + (gain @ off[:, :, None])[:, :, 0]
    mean = (weights[None, :] @ means)[0, :]
    both = _weighed(weights, gain, crossed[:, c:, :])
    apart = (means - mean)[:, :, None]
    of_gain = _weighed(weights, gain @ crossed[:, :c, :], gain) + _weighed(weights, apart, apart)
    parts = {
        name: _weighed(weights, slopes @ of_source, slopes)
        for name, of_source in zip(errors, chosen_errors, strict=True)
    }
    parts[METAMERS] = _covariance(kept, weights)[c:, c:] - both - both.mT + of_gain
    # A change of the level moves all signals.
    unit = xp.broadcast_to(eye(xp, c), (off.shape[0], c, c))
    signals = xp.concat([unit, expected[:, :c, None]], axis=2)
    return SurfacePosterior(
        mean=level * mean,
        parts={name: level**2 * part for name, part in parts.items()},
        prior_variance=level**2 * components.prior_variance,
        distance=xp.sqrt(xp.min(squares)),
        signal_covariance=level**2 * _weighed(weights, signals @ total[:, : c + 1, : c + 1], signals),
    )


@dataclass(frozen=True)
class ExactPosteriors:
    """The last three outputs given exact signals of mean 1, as of `posterior_of`.

    Attributes:
        means: (b, m, 3) of the signals `fine`.
        covariance, signal_covariance: (k, 3, 3) and (k, c, c) of the signals `coarse`.
    """

    means: Array
    covariance: Array
    signal_covariance: Array


def exact_posteriors(components: Components, fine: Array, coarse: Array) -> ExactPosteriors:
    """The posteriors of exact signals of mean 1, (b, m, c) and, with covariances, (k, c)."""
    xp, k, c = namespace(fine), coarse.shape[0], fine.shape[2]
    surfaces = _exact_surfaces(components, c)
    (n, p, _), lines = surfaces.affine.shape, _with_one(coarse)
    maps = xp.concat([xp.reshape(surfaces.affine, (n, p * (c + 1))), xp.ones((n, 1), dtype=xp.float64)], axis=1)

    def means_of(z: Array) -> Array:
        mapped, line = _unscaled_weights(surfaces, z) @ maps, _with_one(z)  # the last column sums the weights
        return xp.sum(xp.reshape(mapped[:, :-1], (z.shape[0], p, c + 1)) * line[:, None, :], axis=2) / mapped[:, -1:]

    weights = _unscaled_weights(surfaces, coarse)
    weights = weights / xp.sum(weights, axis=1, keepdims=True)
    means = xp.reshape(lines @ xp.reshape(surfaces.affine, (n * p, c + 1)).mT, (k, n, p))
    apart = means - xp.sum(weights[:, :, None] * means, axis=1, keepdims=True)
    between = (apart * weights[:, :, None]).mT @ apart
    return ExactPosteriors(
        each_block(means_of, fine),
        xp.reshape(weights @ surfaces.covariance, (k, p, p)) + between,
        xp.reshape(weights @ surfaces.signal_covariance, (k, c, c)),
    )


@dataclass(frozen=True)
class _ExactSurfaces:
    """What the prior's N surfaces say of any exact signals z (c,): without noise only their weights differ.

    Attributes:
        forms: (N, c² + c + 1) products with z zᵀ, z and 1 that make ln w_i.
        affine: (N, 3, c + 1) means of the last three outputs, of z and 1.
        covariance, signal_covariance: (N, 9) and (N, c²), row-major.
    """

    forms: Array
    affine: Array
    covariance: Array
    signal_covariance: Array


def _exact_surfaces(components: Components, c: Any) -> _ExactSurfaces:
    total, inverses, log_dets = _spread(components, components.errors, c)
    expected, last = components.expected, components.expected.shape[1] - 3
    xp, (n, _), v, seen = namespace(expected), expected.shape, components.shared.shape[0], expected[:, :c, None]
    towards = (inverses @ seen)[:, :, 0]
    constant = components.log_weights - 0.5 * (log_dets + xp.sum(towards * expected[:, :c], axis=1))
    forms = xp.concat([-0.5 * xp.reshape(inverses, (n, c * c)), towards, constant[:, None]], axis=1)

    gain, own_slopes = (of_outputs[:, last - c :, :] for of_outputs in _gain(components, total, inverses))
    base = expected[:, last:] - (gain @ seen)[:, :, 0]
    changes, crossed = (array[:, last:, :] for array in (components.changes.mT, components.crossed))
    shared = xp.reshape(components.variances @ xp.reshape(components.shared[:, last:, last:], (v, 9)), (n, 3, 3))
    taken = components.of_level[:, last:, None] * expected[:, None, last:] + gain @ crossed.mT
    slopes = xp.concat([-gain, own_slopes], axis=2)
    covariance = shared + changes @ changes.mT - taken - taken.mT + gain @ components.crossed[:, :c, :] @ gain.mT
    moves = xp.concat([xp.broadcast_to(eye(xp, c), (n, c, c)), seen], axis=2)
    return _ExactSurfaces(
        forms,
        xp.concat([gain, base[:, :, None]], axis=2),
        xp.reshape(covariance + slopes @ total @ slopes.mT, (n, 9)),
        xp.reshape(moves @ total[:, : c + 1, : c + 1] @ moves.mT, (n, c * c)),
    )


def _with_one(z: Array) -> Array:
    xp = namespace(z)
    return xp.concat([z, xp.ones((z.shape[0], 1), dtype=xp.float64)], axis=1)


def _unscaled_weights(surfaces: _ExactSurfaces, z: Array) -> Array:
    """(m, N) weights of the surfaces given signals (m, c), the largest 1."""
    xp, (m, c) = namespace(z), z.shape
    products = xp.reshape(z[:, :, None] * z[:, None, :], (m, c * c))
    logarithms = xp.concat([products, _with_one(z)], axis=1) @ surfaces.forms.mT
    return xp.exp(logarithms - xp.max(logarithms, axis=1, keepdims=True))


def _spread(components: Components, errors: Mapping[str, Array], c: Any) -> tuple[Array, Array, Array]:
    """The sum of the errors' covariances, V_i⁻¹ (N, c, c) and ln |V_i| (N,)."""
    xp = namespace(components.expected)
    total = sum(errors.values(), xp.zeros((), dtype=xp.float64))
    # Nothing changes the mean of z, so any variance of it serves.
    return total, *inverse(components.crossed[:, :c, :] + total[:, :c, :c] + 1.0, panel=CHANNELS)


def _gain(components: Components, total: Array, inverses: Array) -> tuple[Array, Array]:
    """G_i (N, p, c), and the changes (N, p, 1 + u) of the outputs by errors of the level and by their own."""
    xp, (n, r), c = namespace(total), components.expected.shape, inverses.shape[1]
    u = total.shape[1] - c - 1
    # An error of the level scales all outputs. The signals tell of errors, too, and so of what these do.
    last = xp.concat([xp.zeros((r - c - u, u), dtype=xp.float64), eye(xp, u)], axis=0)
    own = xp.broadcast_to(last, (n, r - c, u))
    own_slopes = xp.concat([-components.expected[:, c:, None], own], axis=2)
    return (components.crossed[:, c:, :] + own_slopes @ total[:, c:, :c]) @ inverses, own_slopes


def _of_noise(components: Components, variances: Array) -> Array:
    """(N, c + 1 + u, c + 1 + u) as in `Components.errors`, of independent errors of z with these variances (c,)."""
    xp, c = namespace(variances), variances.shape[0]
    expected = components.expected[:, :c]
    n, size = expected.shape[0], next(iter(components.errors.values())).shape[1]
    mean = xp.ones((n, 1, c), dtype=xp.float64) / xp.sum(xp.ones((c,), dtype=xp.float64))
    rest = xp.zeros((n, size - c - 1, c), dtype=xp.float64)
    moves = xp.concat([eye(xp, c) - expected[:, :, None] * mean, mean, rest], axis=1)
    return (moves * variances) @ moves.mT
