"""The sections of colour tiles and residuals: measured and predicted values of each patch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camssf.grid import BAND, CHANNELS, Floats
from camssf.report.sections.drawings import fitting, round_up
from camssf.report.sections.text import signed
from camssf.report.shots import ShownPatches, ShownShot

MOST_ROWS = 48
"""Largest number of patches in one table."""


def hexed(srgb: Sequence[float] | Floats) -> str:
    """A display colour in CSS notation."""
    return "#" + "".join(f"{round(255 * v):02x}" for v in srgb)


# Tiles


@dataclass(frozen=True)
class Tiles:
    """Name, measured and synthetic colour of each patch, and the number of the chart's columns."""

    columns: int
    tiles: tuple[tuple[str, str, str], ...]


def tiles_of(shot: ShownShot, columns: int) -> Tiles | None:
    """The tiles of a shot of a chart with so many columns; None if it has no predicted colours."""
    patches = shot.patches
    if patches is None or patches.measured_srgb is None or patches.synthetic_srgb is None:
        return None
    rows = zip(patches.names, patches.measured_srgb, patches.synthetic_srgb, strict=True)
    return Tiles(columns, tuple((name, hexed(measured), hexed(synthetic)) for name, measured, synthetic in rows))


# Residuals


@dataclass(frozen=True)
class Dot:
    """One residual.

    Attributes:
        text: the residual in %.
        at, low, high: positions of the dot and the ends of its bar, in % of the cell's width.
        beyond: whether it lies beyond the scale.
        in_fit: whether the patch was in the fit that predicted it.
        colour: the channel.
    """

    text: str
    at: str
    low: str
    high: str
    beyond: bool
    in_fit: bool
    colour: str
    positive: bool


@dataclass(frozen=True)
class PatchRow:
    """One patch; a dot is None if the signal is too small for a relative residual."""

    name: str
    colour: str
    used: bool
    dots: tuple[Dot | None, ...]


@dataclass(frozen=True)
class Residuals:
    """The residuals of all shots.

    Attributes:
        scale: residual at the end of each cell, %.
        banded: whether the bars include the uncertainty of the prediction.
        unseen, within: number of values left out of their fits, and the share inside their bars (None without bands).
        shots: the rows of each shot, in tables of at most `MOST_ROWS`.
    """

    scale: float
    banded: bool
    unseen: int
    within: float | None
    shots: tuple[tuple[tuple[PatchRow, ...], ...], ...]


def residuals_of(shots: Sequence[ShownShot]) -> Residuals | None:
    """The residuals of a result; None if nothing was predicted."""
    measured = [shot.patches for shot in shots if shot.patches is not None]
    residuals = [errors(patches) for patches in measured]
    sizes = np.concatenate([np.abs(error[np.isfinite(error)]) for error, _ in residuals] or [np.empty(0)])
    if not sizes.size:
        return None
    banded = any(np.isfinite(patches.predicted_std).any() for patches in measured)
    # One scale for all shots, so that they can be compared; it holds most bars, unless these are much longer.
    bars = np.concatenate([half[np.isfinite(error)] for error, half in residuals])
    most = fitting(sizes)
    scale = round_up(1.02 * max(most, min(float(np.quantile(bars, 0.8)), 3.0 * most)))
    inside = []
    for patches, (error, half) in zip(measured, residuals, strict=True):
        unseen = _seen(patches)[:, None] & np.isfinite(error)
        inside.append((np.abs(error) <= half)[unseen])
    held = np.concatenate(inside)
    rows = tuple(_tables(_rows(patches, *pair, scale)) for patches, pair in zip(measured, residuals, strict=True))
    return Residuals(scale, banded, held.size, float(held.mean()) if banded and held.size else None, rows)


def _tables(rows: tuple[PatchRow, ...]) -> tuple[tuple[PatchRow, ...], ...]:
    """Split the rows into tables of equal length."""
    count = -(-len(rows) // MOST_ROWS)
    size = -(-len(rows) // max(count, 1))
    return tuple(rows[size * k : size * (k + 1)] for k in range(count))


def _seen(patches: ShownPatches) -> NDArray[np.bool_]:
    """(n,) whether each patch has a prediction by fits without it."""
    return np.asarray(np.isfinite(patches.unseen).all(axis=1))


def errors(patches: ShownPatches) -> tuple[Floats, Floats]:
    """Predicted minus measured signal and the half-width of its 95 % interval, (n, 3) in % of the signal."""
    level, unseen = patches.level[:, None], _seen(patches)[:, None]
    signal = level * patches.signal  # under even light
    guess = np.where(unseen, patches.unseen, patches.predicted)
    # A patch without signal has no relative error.
    signal = np.where(signal > 1e-6, signal, math.nan)
    std = np.nan_to_num(np.where(unseen, patches.unseen_std, patches.predicted_std))
    half = BAND * np.hypot(level * patches.standard_error, std)
    return 100 * (guess - signal) / signal, 100 * half / signal


def _rows(patches: ShownPatches, error: Floats, half: Floats, scale: float) -> tuple[PatchRow, ...]:
    unseen = _seen(patches)
    return tuple(
        PatchRow(
            name,
            hexed(patches.reflectance_srgb[i]),
            bool(patches.used[i]),
            tuple(
                _dot(float(error[i, c]), float(half[i, c]), scale, colour, in_fit=not unseen[i])
                for c, colour in enumerate(CHANNELS)
            ),
        )
        for i, name in enumerate(patches.names)
    )


def _dot(error: float, half: float, scale: float, colour: str, *, in_fit: bool) -> Dot | None:
    if not math.isfinite(error):
        return None

    def at(value: float) -> str:
        return f"{50 + 50 * max(-1.0, min(1.0, value / scale)):.2f}%"

    return Dot(
        signed(error), at(error), at(error - half), at(error + half), abs(error) > scale, in_fit, colour, error > 0
    )
