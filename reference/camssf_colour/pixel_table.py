"""Colours of many pixels in one light: a table over the ratios of their signals, and the uncertainty at its nodes.

Exact signals of one ratio give one colour whatever their level, so the posterior mean (`exact_posteriors`) is
tabulated over ln r/g and ln b/g. Cube roots, of which Lab consists, are bilinear between the nodes. So is the
covariance of the colour, which varies less and has fewer nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from camssf.colorimetry import BEND, SLOPE
from camssf.grid import Floats
from camssf.recovery.arrays import Array, namespace
from camssf.rules import rules
from camssf_colour.light import Light
from camssf_colour.posterior import components_of, exact_posteriors
from camssf_colour.reach import REACH, surface_distances
from camssf_colour.response import surface_response
from camssf_colour.spread import Reference
from camssf_colour.surface_prior import read_prior
from camssf_colour.view import View

EDGE = 3.0
"""Ratios beyond e³ count as e³."""
RATIO_NODES, COVARIANCE_NODES = 129, 17
"""Along each ratio."""
STRIDE = (RATIO_NODES - 1) // (COVARIANCE_NODES - 1)
SQUARE = (RATIO_NODES, RATIO_NODES, 3)
LEVEL = rules().number("colour.level")
SURE = 2.0
"""Standard deviations of their noise by which signals must be out of reach."""
SMALL = 1e-6
"""Least signal over the mean of the three, so that its ratio is finite."""
BLACK = 1e-12
"""Least signal, and least square of a root, that is divided by."""
PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
"""Entries of a symmetric covariance that are stored."""


@dataclass(frozen=True)
class PixelTable:
    """Colours of exact signals of mean 1, at nodes of ln r/g and, varying faster, ln b/g.

    Attributes:
        roots: (RATIO_NODES², 3) cube roots of XYZ over its white.
        covariance: (COVARIANCE_NODES², 6) of XYZ over its white: PAIRS. Without noise.
        distance: (COVARIANCE_NODES²,) of dark signals of this ratio from those that any surface can give, in standard
            deviations (`camssf_colour.reach`).
    """

    roots: Array
    covariance: Array
    distance: Array

    # The coefficients serve all strips of a picture.

    @cached_property
    def bilinear_roots(self) -> tuple[Array, ...]:
        """Of the roots: `_coefficients`."""
        return _coefficients(self.roots, RATIO_NODES)

    @cached_property
    def bilinear_covariance(self) -> tuple[Array, ...]:
        """Of the covariance: `_coefficients`."""
        return _coefficients(self.covariance, COVARIANCE_NODES)

    @cached_property
    def bilinear_distance(self) -> tuple[Array, ...]:
        """Of the distance: `_coefficients`."""
        return _coefficients(self.distance[:, None], COVARIANCE_NODES)


def _coefficients(table: Array, nodes: int) -> tuple[Array, ...]:
    """(k, nodes² - nodes - 1) four times, of a table (nodes², k): its values, and their changes to the next nodes.

    The changes are those to the next ln b/g, to the next ln r/g, and to both beyond their sum.
    """
    first = table[: -nodes - 1, :]
    to_blue, to_red = table[1:-nodes, :] - first, table[nodes:-1, :] - first
    to_both = table[nodes + 1 :, :] - table[nodes:-1, :] - to_blue
    return first.mT, to_blue.mT, to_red.mT, to_both.mT


def node_signals(nodes: int) -> Floats:
    """(nodes², 3) signals of mean 1 at the nodes."""
    ratios = np.exp(np.linspace(-EDGE, EDGE, nodes))
    signals = np.ones((nodes, nodes, 3))
    signals[..., 0], signals[..., 2] = ratios[:, None], ratios
    return np.asarray(signals / signals.mean(axis=2, keepdims=True)).reshape(-1, 3)


def tabulate(
    lights: Sequence[Light], weights: Floats, reference: Reference, view: View, prior: str
) -> tuple[PixelTable, Floats]:
    """The table for lights of these weights, and XYZ (3,) of the view's white, which must not be the light's own.

    Raises:
        LinAlgError: curves, too negative, through which a surface gives no signal.
    """
    means, covariances, far = [], [], []
    for light in lights:
        response, white = surface_response([light], [reference], view, reflectance=False)
        components = components_of(read_prior(prior), response)
        if not (components.scale > 0).all():
            raise np.linalg.LinAlgError("a surface of the prior gives no signal")
        exact = exact_posteriors(
            components, node_signals(RATIO_NODES).reshape(SQUARE), node_signals(COVARIANCE_NODES)
        )
        means.append(exact.means)
        covariances.append(exact.covariance)
        spread = LEVEL**2 * exact.signal_covariance
        far.append(surface_distances(LEVEL * node_signals(COVARIANCE_NODES), spread, light))
    mean = np.tensordot(weights, np.stack(means), axes=1).reshape(-1, 3)
    coarse = np.stack(means)[:, ::STRIDE, ::STRIDE].reshape(len(means), -1, 3)
    apart = coarse - np.tensordot(weights, coarse, axes=1)
    between = np.einsum("l,lni,lnj->nij", weights, apart, apart)
    covariance = np.tensordot(weights, np.stack(covariances), axes=1) + between
    pairs = np.stack([covariance[:, i, j] for i, j in PAIRS], axis=1)
    return PixelTable(np.cbrt(mean), pairs, np.min(far, axis=0)), white


@dataclass(frozen=True)
class Places:
    """Where signals lie between the nodes, and their mean. Channels come first: NumPy is fastest so.

    Attributes:
        signals: (3, n), at least SMALL times their mean.
        level: (n,) mean of the signals, at least 0.
        along_red, along_blue: (n,) ln r/g and ln b/g in nodes of a table of RATIO_NODES.
    """

    signals: Array
    level: Array
    along_red: Array
    along_blue: Array


PER_NODE = (RATIO_NODES - 1) / (2.0 * EDGE)
"""Nodes by unit of a ratio's logarithm."""


def places_of(signals: Array) -> Places:
    """Places of signals (3, n) relative to white; those below black count as black."""
    xp = namespace(signals)
    positive = xp.maximum(signals, 0.0)
    level = (positive[0, :] + positive[1, :] + positive[2, :]) / 3.0  # a mean along so short an axis is slow
    raised = xp.maximum(positive, xp.maximum(SMALL * level, BLACK))
    logarithms = xp.log(raised)

    def along(channel: int) -> Array:
        ratio = (logarithms[channel, :] - logarithms[1, :] + EDGE) * PER_NODE
        return xp.minimum(xp.maximum(ratio, 0.0), RATIO_NODES - 1.0)

    return Places(raised, level, along(0), along(2))


@dataclass(frozen=True)
class _Between:
    """A table (k, nodes²) between its nodes.

    Attributes:
        value, to_blue, to_red, to_both: (k, n) `_coefficients` of the cells that the places lie in.
        u, v: (n,) way to the next ln r/g and to the next ln b/g, in distances of nodes.
        per_ratio: nodes by unit of a ratio's logarithm.
    """

    value: Array
    to_blue: Array
    to_red: Array
    to_both: Array
    u: Array
    v: Array
    per_ratio: float

    @property
    def values(self) -> Array:
        """(k, n), bilinear."""
        return self.value + self.u * (self.to_red + self.v * self.to_both) + self.v * self.to_blue

    @property
    def slopes(self) -> tuple[Array, Array]:
        """(k, n) by ln r/g, and by ln b/g."""
        by_red, by_blue = self.to_red + self.v * self.to_both, self.to_blue + self.u * self.to_both
        return self.per_ratio * by_red, self.per_ratio * by_blue


def _between(coefficients: tuple[Array, ...], places: Places, nodes: int) -> _Between:
    """A table at these places."""
    xp, scale = namespace(places.level), (nodes - 1.0) / (RATIO_NODES - 1.0)
    red, blue = places.along_red * scale, places.along_blue * scale
    i, j = (xp.astype(xp.minimum(along, nodes - 1.5), xp.int64) for along in (red, blue))  # a node follows each
    u, v = red - xp.astype(i, red.dtype), blue - xp.astype(j, red.dtype)
    value, to_blue, to_red, to_both = (xp.take(part, i * nodes + j, axis=1) for part in coefficients)
    return _Between(value, to_blue, to_red, to_both, u, v, scale * PER_NODE)


def xyz_of(table: PixelTable, places: Places) -> Array:
    """(3, n) XYZ over white."""
    roots = _between(table.bilinear_roots, places, RATIO_NODES).values
    return places.level * (roots * roots * roots)


def lab_variances(table: PixelTable, places: Places, noise: Array) -> Array:
    """(3, n) variances of L*, a*, b* of pixels, given the covariance (6, n) of their signals by noise: PAIRS.

    The table's covariance and that of the noise are propagated to Lab linearly; the noise by the table's own slopes.
    """
    xp = namespace(places.level)
    level = xp.maximum(places.level, BLACK)
    root, between = xp.exp(xp.log(level) / 3.0), _between(table.bilinear_roots, places, RATIO_NODES)
    roots, (by_red, by_blue) = root * between.values, (root * slope for slope in between.slopes)
    # Lab is made of cube roots of t, and where t is small of a straight line, whose slope by the root is smaller.
    chain = xp.where(roots > BEND ** (1.0 / 3.0), 1.0, (3.0 * SLOPE / 116.0) * roots * roots)

    by_xyz = chain * level / (3.0 * xp.maximum(roots * roots, BLACK))
    pairs = _between(table.bilinear_covariance, places, COVARIANCE_NODES).values
    xx, xy, _, yy, yz, zz = (by_xyz[i, :] * by_xyz[j, :] * pairs[k, :] for k, (i, j) in enumerate(PAIRS))
    known = xp.stack([116.0**2 * yy, 500.0**2 * (xx - 2.0 * xy + yy), 200.0**2 * (yy - 2.0 * yz + zz)], axis=0)

    of_level = roots / (9.0 * level)
    turns = (by_red, -by_red - by_blue, by_blue)
    moves = [_lab_moves(chain * (of_level + turn / places.signals[c, :])) for c, turn in enumerate(turns)]
    for k, (i, j) in enumerate(PAIRS):
        known = known + (1.0 if i == j else 2.0) * noise[k, :] * moves[i] * moves[j]
    return known


def _lab_moves(roots: Array) -> Array:
    """(3, n) changes of L*, a*, b* by those of the roots."""
    x, y, z = (roots[i, :] for i in range(3))
    return namespace(roots).stack([116.0 * y, 500.0 * (x - y), 200.0 * (y - z)], axis=0)


def out_of_reach(table: PixelTable, places: Places, noise: Array) -> Array:
    """(n,) whether no surface gives such signals, even if their noise (6, n) has moved them away from grey."""
    xp = namespace(places.level)
    from_grey = places.signals - places.level
    moved = SURE * xp.sqrt(xp.stack([noise[PAIRS.index((c, c)), :] for c in range(3)], axis=0))
    nearer = places.level + xp.sign(from_grey) * xp.maximum(xp.abs(from_grey) - moved, 0.0)
    return _between(table.bilinear_distance, places_of(nearer), COVARIANCE_NODES).values[0, :] > REACH
