"""Fits transforms of white-balanced signals to XYZ under a lamp, on the signals of real surfaces.

A root-polynomial of degree 2 (Finlayson, Mackiewicz and Hurlbert, IEEE Trans. Image Process. 2015, 24, 1460) uses
r, g, b, √(r g), √(g b), √(r b), so a brighter light scales XYZ and changes no hue; a matrix uses r, g, b alone. Both
map white exactly: the coefficients of each of X, Y, Z sum to white's. They are fitted by least squares in XYZ; in Lab
the ΔE00 on surfaces left out was larger (1.02 instead of 0.97 over five lamps).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from camssf.colour.spaces import xyz_of
from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.spectra.appearance import delta_e00, lab
from camssf.spectra.surfaces import observer, surfaces

KINDS = {"matrix": 3, "root-polynomial": 6}
"""Number of coefficients for each of X, Y, Z."""
FOLDS = 5
DEPENDENT = 1e-10
"""A term counts as linearly dependent if a smaller share of its norm is orthogonal to the terms before it."""


@dataclass(frozen=True)
class Transform:
    """A transform of white-balanced signals to XYZ under a lamp.

    Attributes:
        kind: one of KINDS.
        coefficients: (p, 3) for X, Y, Z; each column sums to white's.
        white: (3,) XYZ of a perfect white under the lamp.
        delta_e00: mean in cross-validation, of each kind.
        residual: (n, 3) XYZ of each surface in cross-validation minus the true one, divided by `level`.
        signals: (n, 3) of the surfaces.
    """

    kind: str
    coefficients: Floats
    white: Floats
    delta_e00: dict[str, float]
    residual: Floats
    signals: Floats

    def apply(self, signals: Floats) -> Floats:
        """XYZ (..., 3) of signals (..., 3) in which white is 1, 1, 1."""
        return terms(signals, self.kind) @ self.coefficients


def terms(signals: Floats, kind: str) -> Floats:
    """The terms (..., p) that the coefficients multiply; negative signals count as 0."""
    y = np.maximum(signals, 0.0)
    if kind == "matrix":
        return np.asarray(y)
    r, g, b = np.moveaxis(y, -1, 0)
    return np.stack([r, g, b, np.sqrt(r * g), np.sqrt(g * b), np.sqrt(r * b)], axis=-1)


def level(signals: Floats) -> Floats:
    """Mean of signals (..., 3) over the channels, (..., 1); a surface's errors are proportional to it."""
    return np.asarray(np.maximum(np.mean(signals, axis=-1, keepdims=True), 1e-9))


def signals_of(reflectance: Floats, lamp: Floats, curves: Floats) -> Floats:
    """White-balanced signals (n, 3) of reflectances (n, 681) under a lamp (681,) through curves (681, 3)."""
    light = lamp[:, None] * curves
    return np.asarray(reflectance @ light / light.sum(axis=0))


def fit(signals: Floats, xyz: Floats, white: Floats, kind: str) -> Floats:
    """Coefficients (..., p, 3) by least squares, subject to Σ coefficients = white.

    Args:
        signals: (..., n, 3), white-balanced.
        xyz: (..., n, 3) of the same surfaces.
        white: (..., 3).
        kind: one of KINDS.

    Raises:
        LinAlgError: linearly dependent signals.
    """
    p = KINDS[kind]
    rows, free = terms(signals, kind), _free(p)
    start = np.broadcast_to(np.asarray(white)[..., None, :] / p, (*np.shape(white)[:-1], p, 3))
    reduced = rows @ free
    # QR, not normal equations: covariances are differences of fits and need the digits that squaring loses.
    q, r = np.linalg.qr(reduced)
    own = np.abs(np.diagonal(r, axis1=-2, axis2=-1))
    if not (own > DEPENDENT * np.linalg.norm(reduced, axis=-2)).all():
        raise np.linalg.LinAlgError("signals depend on each other")
    pull = np.swapaxes(q, -1, -2) @ (xyz - rows @ start)
    return np.asarray(start + free @ np.linalg.solve(r, pull))


@cache
def _free(p: int) -> Floats:
    """(p, p - 1) orthonormal directions that do not change the sum of the coefficients."""
    return np.asarray(np.linalg.svd(np.ones((1, p)))[2][1:].T)


def choose(
    curves: Floats, lamp: Floats, name: str = "1931", kind: str | None = None, among: Floats | None = None
) -> Transform:
    """The transform with the smallest cross-validation error.

    Args:
        curves: (681, 3), each channel on any scale.
        lamp: (681,).
        name: of the observer.
        kind: one of KINDS; the better one by cross-validation unless given.
        among: (n, 681) reflectances; `surfaces()` unless given.

    Raises:
        InvalidArgument: an unknown kind or observer, or curves without a response to the lamp.
    """
    if kind is not None and kind not in KINDS:
        raise InvalidArgument(f"There is no transform {kind!r}.", f"Take one of {', '.join(KINDS)}.")
    seen = lamp @ curves
    if not (np.isfinite(seen).all() and (seen > 0).all()):
        raise InvalidArgument("A curve has no response to this lamp.", "Check the lamp's spectrum, and the curves.")
    functions = observer(name)
    table = surfaces() if among is None else among
    y, target = signals_of(table, lamp, curves), xyz_of(table, lamp, functions)
    white = xyz_of(np.ones(lamp.shape), lamp, functions)
    try:
        foretold = {each: unseen(y, target, white, each) for each in (KINDS if kind is None else (kind,))}
    except np.linalg.LinAlgError as fault:
        raise InvalidArgument("Two of the curves are alike.", "Check that they are red, green and blue.") from fault
    delta = {
        each: float(np.mean(delta_e00(lab(target, white), lab(found, white)))) for each, found in foretold.items()
    }
    best = min(delta, key=lambda each: (delta[each], KINDS[each]))
    coefficients = fit(y, target, white, best)
    return Transform(best, coefficients, white, delta, (foretold[best] - target) / level(y), y)


def unseen(y: Floats, target: Floats, white: Floats, kind: str) -> Floats:
    """Cross-validated predictions (n, 3) of the target (n, 3): each fold by a fit to the other folds."""
    fold = np.arange(len(y)) % FOLDS
    found = np.empty_like(target)
    for each in range(FOLDS):
        left = fold == each
        found[left] = terms(y[left], kind) @ fit(y[~left], target[~left], white, kind)
    return found
