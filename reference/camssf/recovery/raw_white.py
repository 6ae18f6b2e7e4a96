"""Narrows the kinds of an unnamed light by the chromaticity of the raw white (docs/maths.md, "Unnamed light").

A file's colour matrices turn the white's raw values into CIE XYZ, so into the chromaticity of the light. Makers fit
them to other surfaces and other cameras of the model, so they may be wrong: a kind whose chromaticities do not reach
the white's keeps its lamp, and has the probability of a wrong matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from camssf.colorimetry import chromaticity, uv
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.covariance import LAMP_CORRELATION, smooth_errors
from camssf.recovery.rows import DARKEST
from camssf.rules import rules
from camssf.spectra import Lamp
from camssf.spectra.bundled import observer
from camssf.spectra.lights import PossibleLamps, plain_kind

_NUMBER = rules().number
Light = TypeVar("Light", bound=PossibleLamps)
RIGHT = _NUMBER("lamp.matrix_right")
"""Prior probability that a file's colour matrices give the white's chromaticity."""
AREA = _NUMBER("lamp.white_area")
"""Area of u'v' over which the white of a wrong matrix is spread."""
EXPANSIONS = rules().whole("lamp.expansions")
"""Linearisations of the chromaticity of a lamp by its modes."""


def given_raw_white(
    light: Light, white: Floats, matrices: Sequence[tuple[float, Floats]], white_reflectance: Floats
) -> Light:
    """The light with its possible lamps narrowed by the raw white; as it was if the file has no usable matrix.

    Args:
        light: the possible lamps, with their prior probabilities.
        white: (3,) raw values of the white, black level subtracted, any scale.
        matrices: of the file, one or two: temperature of the matrix's illuminant, K, and (3, 3) XYZ to raw.
        white_reflectance: (681,) of the white.
    """
    measured = chromaticity(white, matrices)
    if measured is None:
        return light
    lamps, priors = [], []
    for lamp, prior in zip(light.lamps, light.log_prior, strict=True):
        narrowed, log_density = narrow(lamp, measured, white_reflectance)
        right, wrong = np.log(RIGHT) + log_density, np.log((1.0 - RIGHT) / AREA)
        lamps.append(narrowed if right > wrong else lamp)
        priors.append(float(prior + np.logaddexp(right, wrong)))
    return replace(light, lamps=tuple(lamps), log_prior=tuple(priors))


def narrow(lamp: Lamp, measured: Floats, white_reflectance: Floats) -> tuple[Lamp, float]:
    """The lamp given u'v' (2,) of its white, and ln of the probability density of these.

    L = L₀ (1 + Σ u m), u ~ N(0, I), and u'v' = f(L) + e with e ~ N(0, E), E = σ² I plus the part of the lamp's smooth
    tolerance. Linearised at its own answer: H = ∂f / ∂u, S = H Hᵀ + E, û = Hᵀ S⁻¹ (u'v' - f + H û), and u has the
    covariance I - Hᵀ S⁻¹ H.
    """
    modes = lamp.modes
    smooth = lamp.tolerance * smooth_errors(LAMP_CORRELATION, WAVELENGTHS).T
    functions = white_reflectance[:, None] * observer("1931")
    error = _NUMBER(f"lamp.white_error_{plain_kind(lamp.name)}")
    code = np.zeros(len(modes))
    factor = np.ones(WAVELENGTHS.size)
    for _ in range(EXPANSIONS):
        at, slope = _uv_of(lamp.values * factor, lamp.values * modes, functions)
        smooth_slope = _uv_of(lamp.values * factor, lamp.values * factor * smooth, functions)[1]
        spread = slope.T @ slope + smooth_slope.T @ smooth_slope + error**2 * np.eye(2)
        off = measured - at + code @ slope
        gain = np.linalg.solve(spread, slope.T).T  # (q, 2)
        code = gain @ off
        factor = np.maximum(1.0 + code @ modes, DARKEST)
    narrowing = np.linalg.cholesky(np.eye(len(modes)) - gain @ slope.T)
    power = lamp.values * factor
    log_density = -0.5 * float(off @ np.linalg.solve(spread, off) + np.log(np.linalg.det(2.0 * np.pi * spread)))
    return replace(lamp, values=power / power.mean(), modes=narrowing.T @ (modes / factor)), log_density


def _uv_of(power: Floats, changes: Floats, functions: Floats) -> tuple[Floats, Floats]:
    """u'v' (2,) of a power (681,), and its change (q, 2) by each of the changes (q, 681)."""
    xyz, moved = power @ functions, changes @ functions
    weights = np.array([1.0, 15.0, 3.0])
    at = uv(xyz)
    return at, (moved[:, :2] * np.array([4.0, 9.0]) - at * (moved @ weights)[:, None]) / (xyz @ weights)
