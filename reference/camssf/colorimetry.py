"""Colour spaces (XYZ, Lab, sRGB, u'v', CIEDE2000, adaptation), and transforms from white-balanced signals to XYZ.

XYZ is relative: Y of a perfect white diffuser is 1. The published formulas are implemented here, so that a
calibration loads no library for them; tests/colour/test_transforms.py compares each with colour-science.

The transforms are fitted on the signals of real surfaces under a lamp. A root-polynomial of degree 2 (Finlayson,
Mackiewicz and Hurlbert, IEEE Trans. Image Process. 2015, 24, 1460) uses r, g, b, √(r g), √(g b), √(r b), so a
brighter light scales XYZ and changes no hue; a matrix uses r, g, b alone. Both map white exactly: the coefficients of
each of X, Y, Z sum to white's. They are fitted by least squares in XYZ; in Lab the ΔE00 on surfaces left out was
larger (1.02 instead of 0.97 over five lamps).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from camssf.errors import InvalidArgument
from camssf.grid import Floats
from camssf.spectra.bundled import correlated_temperature, observer, surfaces

D65_XY = (0.3127, 0.3290)
"""CIE 1931 chromaticity of D65, as sRGB rounds it (IEC 61966-2-1)."""
D65: Floats = np.array([D65_XY[0] / D65_XY[1], 1.0, (1.0 - sum(D65_XY)) / D65_XY[1]])
CAT02: Floats = np.array([[0.7328, 0.4296, -0.1624], [-0.7036, 1.6975, 0.0061], [0.0030, 0.0136, 0.9834]])
"""XYZ to the cone signals of CIECAM02 (CIE 159:2004)."""
SRGB: Floats = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
"""XYZ under D65 to linear sRGB (IEC 61966-2-1)."""
STRAIGHT, SLOPE_OF_DARK, OFFSET, GAMMA = 0.0031308, 12.92, 0.055, 2.4
"""The curve of sRGB (IEC 61966-2-1): end of its straight part, the slope there, offset and exponent of the rest."""
for _table in (D65, CAT02, SRGB):
    _table.setflags(write=False)
BEND, SLOPE = 216.0 / 24389.0, 24389.0 / 27.0
"""Lab's transition from cube root to straight line, and the slope of that line (CIE 15)."""


def lab(xyz: Floats, white: Floats) -> Floats:
    """CIE 1976 L*a*b* (..., 3) of XYZ (..., 3) seen under a white (..., 3): CIE 15."""
    t = np.asarray(xyz) / white
    f = np.where(t > BEND, np.cbrt(np.maximum(t, BEND)), (SLOPE * t + 16.0) / 116.0)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)


def under_d65(xyz: Floats, white: Floats) -> Floats:
    """Adapt XYZ (..., 3) from a white (3,) to D65: von Kries with CAT02, complete adaptation."""
    return np.asarray(xyz @ adaptation(white, D65, CAT02).T)


def srgb(xyz: Floats) -> Floats:
    """sRGB (..., 3) of XYZ (..., 3) under D65; 0 to 1 inside the display's gamut."""
    return np.asarray(encoded(np.asarray(xyz) @ SRGB.T))


def encoded(linear: Any, xp: Any = np) -> Any:
    """Numbers by the curve of sRGB (IEC 61966-2-1), in the array library xp."""
    power = (1.0 + OFFSET) * xp.exp(xp.log(xp.maximum(linear, STRAIGHT)) / GAMMA) - OFFSET
    return xp.where(linear > STRAIGHT, power, SLOPE_OF_DARK * linear)


def delta_e00(one: Floats, other: Floats) -> Floats:
    """CIEDE2000 (...) of Lab (..., 3) and Lab (..., 3): CIE 142, in the form of Sharma, Wu and Dalal (2005)."""
    (l1, a1, b1), (l2, a2, b2) = (np.moveaxis(np.asarray(colour, dtype=np.float64), -1, 0) for colour in (one, other))
    mean_c7 = ((np.hypot(a1, b1) + np.hypot(a2, b2)) / 2.0) ** 7
    g = 0.5 * (1.0 - np.sqrt(mean_c7 / (mean_c7 + 25.0**7)))
    a1, a2 = (1.0 + g) * a1, (1.0 + g) * a2
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = (np.degrees(np.arctan2(b, a)) % 360.0 for a, b in ((a1, b1), (a2, b2)))
    grey = c1 * c2 == 0.0
    turn = np.where(grey, 0.0, (h2 - h1 + 180.0) % 360.0 - 180.0)
    turn = np.where(turn == -180.0, np.where(h2 > h1, 180.0, -180.0), turn)
    big = 2.0 * np.sqrt(c1 * c2) * np.sin(np.radians(turn) / 2.0)
    mean_l, mean_c = (l1 + l2) / 2.0, (c1 + c2) / 2.0
    apart, total = np.abs(h1 - h2) > 180.0, h1 + h2
    mean_h = np.where(apart, np.where(total < 360.0, total + 360.0, total - 360.0), total) / 2.0
    mean_h = np.where(grey, total, mean_h)
    t = (
        1.0
        - 0.17 * np.cos(np.radians(mean_h - 30.0))
        + 0.24 * np.cos(np.radians(2.0 * mean_h))
        + 0.32 * np.cos(np.radians(3.0 * mean_h + 6.0))
        - 0.20 * np.cos(np.radians(4.0 * mean_h - 63.0))
    )
    rotation = 30.0 * np.exp(-(((mean_h - 275.0) / 25.0) ** 2))
    rc = 2.0 * np.sqrt(mean_c**7 / (mean_c**7 + 25.0**7))
    far = (mean_l - 50.0) ** 2
    light = (l2 - l1) / (1.0 + 0.015 * far / np.sqrt(20.0 + far))
    chroma = (c2 - c1) / (1.0 + 0.045 * mean_c)
    hue = big / (1.0 + 0.015 * mean_c * t)
    square = light**2 + chroma**2 + hue**2 - np.sin(np.radians(2.0 * rotation)) * rc * chroma * hue
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))


CAT16: Floats = np.array(
    [[0.401288, 0.650173, -0.051461], [-0.250268, 1.204414, 0.045854], [-0.002079, 0.048952, 0.953127]]
)
"""XYZ to the sharpened cone signals of CAT16 (Li et al., Color Res. Appl. 2017, 42, 703)."""
BRADFORD: Floats = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
"""XYZ to the sharpened cone signals that ICC (ICC.1:2010, annex E) and DNG use for adaptation."""
for _each in (CAT16, BRADFORD):
    _each.setflags(write=False)


def xyz_of(reflectance: Floats, lamp: Floats, functions: Floats) -> Floats:
    """XYZ of reflectances (..., 681) under a lamp (681,), with colour-matching functions (681, 3): (..., 3)."""
    light = lamp[:, None] * functions
    return np.asarray(reflectance @ light / light[:, 1].sum())


def white_of(lamp: Floats, name: str = "1931") -> Floats:
    """XYZ (3,) of a perfect white diffuser under a lamp (681,), for the observer of that name."""
    light = lamp @ observer(name)
    return np.asarray(light / light[1])


def lab_slopes(xyz: Floats, white: Floats) -> Floats:
    """∂ Lab / ∂ XYZ, (..., 3, 3)."""
    t = np.asarray(xyz) / white
    f = np.where(t > BEND, np.cbrt(np.maximum(t, BEND)) ** -2 / 3.0, SLOPE / 116.0) / white
    x, y, z = np.moveaxis(f, -1, 0)
    none = np.zeros_like(x)
    rows = ([none, 116.0 * y, none], [500.0 * x, -500.0 * y, none], [none, 200.0 * y, -200.0 * z])
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def adaptation(source: Any, target: Any, cones: Floats = CAT16) -> Any:
    """(..., 3, 3) matrix that adapts XYZ from one white (..., 3) to another, with complete adaptation.

    `cones`, (3, 3), converts XYZ to the cone signals that are scaled.
    """
    scale = (target @ cones.T) / (source @ cones.T)
    # The inverse by cofactors: LAPACK's differs from processor to processor, and it is a constant of a shipped model.
    a, b, c = cones
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    first = cofactors[:, 0]
    return (cofactors / (a[0] * first[0] + a[1] * first[1] + a[2] * first[2])) @ (scale[..., :, None] * cones)


def adapt(xyz: Floats, source: Floats, target: Floats) -> Floats:
    """XYZ (..., 3) adapted by CAT16 from one white (3,) to another (3,)."""
    return np.asarray(np.asarray(xyz) @ adaptation(source, target).T)


STEPS = 30
"""Steps of the interpolation between two matrices, as in the DNG specification."""
COOLEST, HOTTEST = 1500.0, 25_000.0
"""Limits of the temperature that interpolates the matrices, and ends of Planck's locus, K."""
POINTS = 200
"""Points of the locus, evenly spaced in 1 / T."""


def chromaticity(white: Floats, matrices: Sequence[tuple[float, Floats]]) -> Floats | None:
    """u'v' (2,), CIE 1976, of a raw white (3,); None if the matrices give no chromaticity.

    Two matrices are interpolated by the inverse of the white's own temperature (DNG 1.7, chapter 6), which iteration
    finds.
    """
    balanced = white_and_matrix(white, matrices)
    return None if balanced is None else uv(balanced[0])


def white_and_matrix(white: Floats, matrices: Sequence[tuple[float, Floats]]) -> tuple[Floats, Floats] | None:
    """XYZ (3,) of a raw white (3,), and the matrix (3, 3), XYZ to raw, that gives it; None as `chromaticity`."""
    if not matrices:
        return None
    (cool, first), (hot, second) = matrices[0], matrices[-1]
    kelvin, xyz, matrix = 5000.0, np.zeros(3), first
    for _ in range(STEPS):
        share = 1.0 if cool == hot else np.clip((1.0 / kelvin - 1.0 / hot) / (1.0 / cool - 1.0 / hot), 0.0, 1.0)
        matrix = share * first + (1.0 - share) * second
        try:
            xyz = np.linalg.solve(matrix, white)
        except np.linalg.LinAlgError:
            return None
        if not (np.isfinite(xyz).all() and (xyz > 0).all()):
            return None
        kelvin = float(np.clip(correlated_temperature(xyz), COOLEST, HOTTEST))
    return xyz, matrix


def uv(xyz: Floats) -> Floats:
    """u' = 4 X / D and v' = 9 Y / D with D = X + 15 Y + 3 Z, (..., 2) of XYZ (..., 3)."""
    return np.asarray(xyz[..., :2] * np.array([4.0, 9.0]) / (xyz @ np.array([1.0, 15.0, 3.0]))[..., None])


def off_locus(white: Floats) -> float:
    """Distance of u'v' (2,) from Planck's locus in CIE 1960 u, v (Krystek, Color Res. Appl. 1985, 10, 38)."""
    t = 1.0 / np.linspace(1.0 / HOTTEST, 1.0 / COOLEST, POINTS)
    u = (0.860117757 + 1.54118254e-4 * t + 1.28641212e-7 * t**2) / (1 + 8.42420235e-4 * t + 7.08145163e-7 * t**2)
    v = (0.317398726 + 4.22806245e-5 * t + 4.20481691e-8 * t**2) / (1 - 2.89741816e-5 * t + 1.61456053e-7 * t**2)
    return float(np.hypot(white[0] - u, white[1] * 2.0 / 3.0 - v).min())


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
        predicted = {name: unseen(y, target, white, name) for name in (KINDS if kind is None else (kind,))}
    except np.linalg.LinAlgError as fault:
        raise InvalidArgument("Two of the curves are alike.", "Check that they are red, green and blue.") from fault
    delta = {
        name: float(np.mean(delta_e00(lab(target, white), lab(measured, white))))
        for name, measured in predicted.items()
    }
    best = min(delta, key=lambda each: (delta[each], KINDS[each]))
    coefficients = fit(y, target, white, best)
    return Transform(best, coefficients, white, delta, (predicted[best] - target) / level(y), y)


def unseen(y: Floats, target: Floats, white: Floats, kind: str) -> Floats:
    """Cross-validated predictions (n, 3) of the target (n, 3): each fold by a fit to the other folds."""
    fold = np.arange(len(y)) % FOLDS
    predicted = np.empty_like(target)
    for number in range(FOLDS):
        left = fold == number
        predicted[left] = terms(y[left], kind) @ fit(y[~left], target[~left], white, kind)
    return predicted
