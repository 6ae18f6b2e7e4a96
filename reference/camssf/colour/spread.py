"""How far signals of a surface may be off, and what a fit misses on surfaces that look like it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from camssf.colour.light import Light
from camssf.colour.transforms import level, signals_of
from camssf.curves.covariance import CHART_CORRELATION, DRIFT, smooth_errors
from camssf.errors import InvalidArgument
from camssf.grid import WAVELENGTHS, Floats
from camssf.spectra.surfaces import surfaces

REFERENCE_TOLERANCE = 0.01
"""Relative error of a white or grey reference of which nothing else is said."""
NEARBY = 0.25
"""Surfaces whose ln r/g and ln b/g differ by so much are alike: what their colours miss tells of this one."""
COMMON = 5.0
"""Surfaces that stand for all others, where few are alike."""


@dataclass(frozen=True)
class Reference:
    """The white or grey surface, in the same light, that signals were divided by.

    Attributes:
        tolerance: relative error of its reflectance.
        raw: (3,) its raw signals, black subtracted: what they say of the lamp. None to leave it unasked.
        error: relative error of these.
    """

    tolerance: float = REFERENCE_TOLERANCE
    raw: Floats | None = None
    error: float = 0.0


def checked_signals(signals: ArrayLike, standard_error: ArrayLike) -> tuple[Floats, Floats]:
    """Signals and their standard errors, (m, 3) each.

    Raises:
        InvalidArgument: shapes or values that are none of signals.
    """
    y = np.atleast_2d(np.asarray(signals, dtype=np.float64))
    if y.ndim != 2 or y.shape[1] != 3 or not np.isfinite(y).all():
        raise InvalidArgument(f"Signals of shape {y.shape} are no colours.", "Give finite signals (m, 3).")
    error = np.broadcast_to(np.asarray(standard_error, dtype=np.float64), y.shape)
    if not (np.isfinite(error).all() and (error >= 0).all()):
        raise InvalidArgument("A standard error is negative or not finite.", "Give standard errors ≥ 0.")
    return y, error


def of_reference(light: Light, given: Reference) -> Floats:
    """Relative moves (K, 3) of the signals: the reference's smooth error, and light that differs between places."""
    seen = light.power[:, None] * light.curves
    smooth = smooth_errors(CHART_CORRELATION, WAVELENGTHS).T @ (seen / seen.sum(axis=0))
    return np.concatenate([given.tolerance * smooth, np.full((1, 3), DRIFT)])


def signal_moves(y: Floats, error: Floats, light: Light, given: Reference) -> Floats:
    """Moves (K, m, 3) of the signals by noise, by the reference, and by what lamp and curves leave open."""
    seen = light.power[:, None] * light.curves
    moved = light.power_modes[:, :, None] * light.curves + light.power[:, None] * light.curve_modes
    # of a surface like those of the set that look most like it: its signals answer to an error as theirs do
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
    """Covariance (m, 3, 3) of what a fit misses on surfaces that look alike to the camera.

    From surfaces that the fit had not seen: those near in ln r/g and ln b/g count most, and all of them as much as
    COMMON near ones; the errors grow with the level of the signals.

    Args:
        signals: (n, 3) of these surfaces.
        residual: (n, 3) what was missed on each, over `level`.
        y: (m, 3) signals that are asked about.
    """
    missed = residual[:, :, None] * residual[:, None]
    weights = likeness(signals, y)
    near = np.einsum("yn,ncd->ycd", weights, missed) + COMMON * missed.mean(axis=0)
    near = near / (weights.sum(axis=1) + COMMON)[:, None, None]
    return np.asarray(near * level(y)[..., None] ** 2)


def likeness(known: Floats, y: Floats) -> Floats:
    """(m, n) weights, 1 for a surface of the very same ratios."""
    apart = _ratios(y)[:, None] - _ratios(known)
    return np.asarray(np.exp(-0.5 * np.sum((apart / NEARBY) ** 2, axis=2)) + 1e-12)


def _ratios(y: Floats) -> Floats:
    logs = np.log(np.maximum(y, 1e-3 * level(y)))
    return np.asarray(logs[:, [0, 2]] - logs[:, 1:2])


def outer(steps: Floats) -> Floats:
    """Covariance (m, c, c) of steps (K, m, c), each one standard deviation long."""
    return np.asarray(np.einsum("kmc,kmd->mcd", steps, steps))
