"""The sections of colour tiles and residuals: measured and predicted values of each patch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from camssf.grid import CHANNELS, Floats
from camssf.report.sections.drawings import fitting, round_up
from camssf.report.sections.text import BAND, Json, signed

MOST_ROWS = 48
"""Largest number of patches in one table."""


def hexed(srgb: Sequence[float]) -> str:
    """A display colour in CSS notation."""
    return "#" + "".join(f"{round(255 * v):02x}" for v in srgb)


# Tiles


@dataclass(frozen=True)
class Tiles:
    """Name, measured and synthetic colour of each patch, and the number of the chart's columns."""

    columns: int
    tiles: tuple[tuple[str, str, str], ...]


def tiles_of(shot: Json) -> Tiles | None:
    """The tiles of a shot; None if a patch has no colour."""
    patches = shot["patches"]
    if not patches or any(patch["measured_srgb"] is None or patch["synthetic_srgb"] is None for patch in patches):
        return None
    found = ((patch["name"], hexed(patch["measured_srgb"]), hexed(patch["synthetic_srgb"])) for patch in patches)
    return Tiles(columns(shot["pose"]["patches"]), tuple(found))


def columns(quadrangles: Sequence[Any]) -> int:
    """Patches in a row of the chart: the first step between neighbours that points backwards ends the row."""
    centres = np.asarray(quadrangles, dtype=np.float64).mean(axis=1)
    for i, (a, b) in enumerate(pairwise(centres), 1):
        if np.dot(b - a, centres[1] - centres[0]) < 0:
            return i if len(centres) % i == 0 else len(centres)
    return len(centres)


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


def residuals_of(document: Json) -> Residuals | None:
    """The residuals of a document; None if nothing was predicted."""
    shots = document["shots"]
    found = [errors(shot) for shot in shots]
    sizes = np.concatenate([np.abs(error[np.isfinite(error)]) for error, _ in found] or [np.empty(0)])
    if not sizes.size:
        return None
    patches = [patch for shot in shots for patch in shot["patches"]]
    banded = any(patch.get("unseen_std") or patch.get("predicted_std") for patch in patches)
    # One scale for all shots, so that they can be compared; it holds most bars, unless these are much longer.
    bars = np.concatenate([half[np.isfinite(error)] for error, half in found])
    most = fitting(sizes)
    scale = round_up(1.02 * max(most, min(float(np.quantile(bars, 0.8)), 3.0 * most)))
    inside = []
    for shot, (error, half) in zip(shots, found, strict=True):
        unseen = np.array([patch["unseen"] is not None for patch in shot["patches"]])[:, None] & np.isfinite(error)
        inside.append((np.abs(error) <= half)[unseen])
    held = np.concatenate(inside)
    rows = tuple(_tables(_rows(shot, *each, scale)) for shot, each in zip(shots, found, strict=True))
    return Residuals(scale, banded, held.size, float(held.mean()) if banded and held.size else None, rows)


def _tables(rows: tuple[PatchRow, ...]) -> tuple[tuple[PatchRow, ...], ...]:
    """Split the rows into tables of equal length."""
    count = -(-len(rows) // MOST_ROWS)
    size = -(-len(rows) // max(count, 1))
    return tuple(rows[size * k : size * (k + 1)] for k in range(count))


def errors(shot: Json) -> tuple[Floats, Floats]:
    """Predicted minus measured signal and the half-width of its 95 % interval, (n, 3) in % of the signal."""
    patches = shot["patches"]
    level = np.array([patch.get("level", 1.0) for patch in patches])[:, None]  # the signal under even light
    signal = level * np.array([patch["signal"] for patch in patches], dtype=np.float64)
    guess = [patch["unseen"] or patch["predicted"] or [math.nan] * 3 for patch in patches]
    # A patch without signal has no relative error.
    signal = np.where(signal > 1e-6, signal, math.nan)
    noise = level * np.array([patch["standard_error"] for patch in patches], dtype=np.float64)
    open_ = [patch.get("unseen_std" if patch["unseen"] else "predicted_std") or [0.0] * 3 for patch in patches]
    half = BAND * np.hypot(noise, np.array(open_, dtype=np.float64))
    return 100 * (np.array(guess, dtype=np.float64) - signal) / signal, 100 * half / signal


def _rows(shot: Json, error: Floats, half: Floats, scale: float) -> tuple[PatchRow, ...]:
    return tuple(
        PatchRow(
            patch["name"],
            hexed(patch["reflectance_srgb"]),
            patch["used"],
            tuple(
                _dot(float(error[i, c]), float(half[i, c]), scale, colour, in_fit=patch["unseen"] is None)
                for c, colour in enumerate(CHANNELS)
            ),
        )
        for i, patch in enumerate(shot["patches"])
    )


def _dot(error: float, half: float, scale: float, colour: str, *, in_fit: bool) -> Dot | None:
    if not math.isfinite(error):
        return None

    def at(value: float) -> str:
        return f"{50 + 50 * max(-1.0, min(1.0, value / scale)):.2f}%"

    return Dot(
        signed(error), at(error), at(error - half), at(error + half), abs(error) > scale, in_fit, colour, error > 0
    )
