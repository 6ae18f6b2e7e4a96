"""Errors of a surface's signals, and of a transform on similar surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from camssf.colorimetry import level, signals_of
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.recovery.covariance import CHART_CORRELATION, DRIFT, smooth_errors
from camssf.rules import rules
from camssf.spectra.bundled import surfaces
from camssf_colour.light import Light

REFERENCE_TOLERANCE = rules().number("colour.reference")
"""Default relative error of a white or grey reference."""
NEARBY = 0.25
"""Surfaces whose ln r/g and ln b/g differ by about this much count as similar: the width of the weights."""
COMMON = 5.0
"""The mean over all surfaces counts as much as this number of similar ones."""


@dataclass(frozen=True)
class Reference:
    """The white or grey surface, in the same light, that signals were divided by.

    Attributes:
        tolerance: relative error of its reflectance.
        raw: (3,) its raw signals, black subtracted, used to estimate the lamp; None if they shall not be used.
        error: relative error of `raw`.
        modes: (s, 681) errors of its reflectance over `tolerance`; smooth ones unless given.
    """

    tolerance: float = REFERENCE_TOLERANCE
    raw: Floats | None = None
    error: float = 0.0
    modes: Floats | None = None


def checked_signals(signals: ArrayLike, standard_error: ArrayLike) -> tuple[Floats, Floats]:
    """Signals and their standard errors, (m, 3) each.

    Raises:
        InvalidArgument: invalid shapes or values.
    """
    y = np.atleast_2d(np.asarray(signals, dtype=np.float64))
    if y.ndim != 2 or y.shape[1] != 3 or not np.isfinite(y).all():
        raise InvalidArgument(f"Signals have shape {y.shape}; (m, 3) is needed.", "Give finite signals (m, 3).")
    error = np.broadcast_to(np.asarray(standard_error, dtype=np.float64), y.shape)
    if not (np.isfinite(error).all() and (error >= 0).all()):
        raise InvalidArgument("A standard error is negative or not finite.", "Give standard errors ≥ 0.")
    return y, error


def of_reference(light: Light, given: Reference) -> Floats:
    """Relative changes (K, 3) of the signals by the reference's smooth error and by light that varies with place."""
    seen = light.power[:, None] * light.curves
    smooth = smooth_errors(CHART_CORRELATION, WAVELENGTHS).T @ (seen / seen.sum(axis=0))
    return np.concatenate([given.tolerance * smooth, np.full((1, 3), DRIFT)])


def signal_moves(y: Floats, error: Floats, light: Light, given: Reference) -> Floats:
    """Changes (K, m, 3) of the signals by errors of lamp and curves, by noise, and by the reference."""
    seen = light.power[:, None] * light.curves
    moved = light.power_modes[:, :, None] * light.curves + light.power[:, None] * light.curve_modes
    # the relative change by an error of lamp or curves is a weighted mean over similar surfaces of the set
    table = surfaces()
    sensed = signals_of(table, light.power, light.curves)
    nearest = likeness(sensed, y)
    nearest = nearest / nearest.sum(axis=1, keepdims=True)
    shift = np.einsum("nm,kmc->knc", table, moved, optimize=True) / seen.sum(axis=0)
    shift = shift - sensed * (moved.sum(axis=1) / seen.sum(axis=0))[:, None]  # (K, n, 3)
    relative = shift / level(sensed)
    of_light = np.einsum("yn,knc->kyc", nearest, relative) * level(y)
    return np.concatenate([of_light, error[None] * np.eye(3)[:, None], y * of_reference(light, given)[:, None]])


def metamers(signals: Floats, residual: Floats, y: Floats) -> Floats:
    """Covariance (m, 3, 3) of a transform's error on surfaces that look similar to the camera.

    It is a weighted mean over cross-validated surfaces: those near in ln r/g and ln b/g count most, and all together
    count as much as COMMON near ones. Errors are proportional to the level of the signals.

    Args:
        signals: (n, 3) of these surfaces.
        residual: (n, 3) cross-validation error of each, divided by `level`.
        y: (m, 3) signals to give the covariance for.
    """
    missed = residual[:, :, None] * residual[:, None]
    weights = likeness(signals, y)
    near = np.einsum("yn,ncd->ycd", weights, missed) + COMMON * missed.mean(axis=0)
    near = near / (weights.sum(axis=1) + COMMON)[:, None, None]
    return np.asarray(near * level(y)[..., None] ** 2)


def likeness(references: Floats, y: Floats) -> Floats:
    """(m, n) weights of similarity, 1 for a surface of the same ratios."""
    apart = _ratios(y)[:, None] - _ratios(references)
    return np.asarray(np.exp(-0.5 * np.sum((apart / NEARBY) ** 2, axis=2)) + 1e-12)


def _ratios(y: Floats) -> Floats:
    logs = np.log(np.maximum(y, 1e-3 * level(y)))
    return np.asarray(logs[:, [0, 2]] - logs[:, 1:2])


def outer(steps: Floats) -> Floats:
    """Covariance (m, c, c) of steps (K, m, c), each one standard deviation long."""
    return np.asarray(np.einsum("kmc,kmd->mcd", steps, steps))
