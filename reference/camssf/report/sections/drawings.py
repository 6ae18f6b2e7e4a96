"""The plots of a result: curves, lights, noise."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from camssf.grid import CHANNELS, WAVELENGTHS, Floats
from camssf.report.sections.bands import possible
from camssf.report.sections.curves import DrawnCurves
from camssf.report.shots import ShownPatches
from camssf.report.svg import Axes, Label, Plot, decades, minus, ticks

SMALL = (420, 230)
"""Size of a plot that fits next to another one."""
DARKEST, LEAST_ERROR = 1e-6, 1e-9
"""Parts of white; smaller signals and errors are not plotted."""
THIN = slice(None, None, 2)
"""Plots use every 1 nm, which is finer than a pixel."""


# The curves


def curve_plot(curves: DrawnCurves, width: int, height: int, step: int, kind: str, head: int = 0) -> Plot:
    """The plot of the curves.

    Args:
        curves: to draw.
        width, height: of the whole, px.
        step: distance of readouts, nm.
        kind: wide or narrow.
        head: height of a title above, px.
    """
    wide = kind == "wide"
    low, high = curves.limits()
    left, top, right, bottom = (52, 46, 12, 46) if wide else (30, 52, 14, 40)
    axes = Axes((width, height), (left, top + head, right, bottom), (380.0, 720.0), (low, high))
    fifths = np.arange(math.ceil(low * 5), math.floor(high * 5) + 1) / 5
    axes.marks(
        ((nm, f"{nm}") for nm in range(400, 721, 40 if wide else 80)),
        ((float(v), minus(f"{v:.1f}")) for v in fifths),
    )
    left, top, right, _ = axes.frame
    axes.texts.append(Label((left + right) / 2, height - 6, "wavelength, nm"))
    axes.texts.append(Label(left if wide else 4, top - 26, "relative response", "start"))
    nm, drawn = WAVELENGTHS[THIN], curves.smooth()
    bands = []
    if drawn.low is not None and drawn.high is not None:
        bands = [
            (f"band {c}", axes.ring(nm, drawn.low[THIN, i], drawn.high[THIN, i])) for i, c in enumerate(CHANNELS)
        ]
    lines = [(f"curve {c}", axes.path(nm, drawn.ssf[THIN, i])) for i, c in enumerate(CHANNELS)]
    if curves.truth is not None:
        lines += [("truth", axes.path(nm, curves.truth[THIN, i])) for i in range(3)]
    names = [
        Label(float(axes.x(at)), float(axes.y(response)), text if wide else c, "middle", f"peak {c}")
        for c, (text, at, response) in zip(CHANNELS, curves.peak_labels(), strict=True)
    ]
    order = curves.ssf.argmax(axis=0)
    peaks = ", ".join(f"{c} at {WAVELENGTHS[k]:.0f} nm" for c, k in zip(CHANNELS, order, strict=True))
    label = f"Three curves of relative response over wavelength, 380 to 720 nm. Peaks: {peaks}."
    return axes.plot(
        f"curves-{kind}",
        kind,
        label,
        bands=tuple(bands),
        lines=tuple(lines),
        names=tuple(names),
        readouts=tuple(_readouts(curves, axes, step, wide)),
    )


def _readouts(curves: DrawnCurves, axes: Axes, step: int, wide: bool) -> Iterable[Any]:
    left, _, right, _ = axes.frame
    slot = step / 340.0 * (right - left)
    for k in range(0, len(WAVELENGTHS), 2 * step):
        at = float(axes.x(WAVELENGTHS[k]))
        texts = [(f"{WAVELENGTHS[k]:.0f} nm", "")]
        for i, colour in enumerate(CHANNELS):
            text = f"{curves.ssf[k, i]:.3f}"
            if wide and curves.low is not None and curves.high is not None:
                text += f" ({curves.low[k, i]:.3f} to {curves.high[k, i]:.3f})"
            texts.append((minus(text), colour))
        yield max(left, at - slot / 2), min(right, at + slot / 2), at, tuple(texts)


# Light


def light_plot(power: Floats, std: Floats, name: str) -> Plot:
    """A light's relative power (681,) and its 95 % band."""
    nm = WAVELENGTHS[THIN]
    power, std = (np.asarray(values, dtype=np.float64)[THIN] for values in (power, std))
    low, high = possible(power, std)
    ceiling = 1.05 * max(float(min(high.max(), 3.0 * power.max())), 1e-9)
    axes = Axes(SMALL, (44, 34, 16, 46), (380.0, 720.0), (0.0, ceiling))
    axes.marks(((nm, f"{nm}") for nm in range(400, 701, 100)), ticks(0.0, ceiling))
    axes.titles("wavelength, nm", "relative power", 4)
    return axes.plot(
        name,
        "small",
        "Relative power of the light over wavelength, 380 to 720 nm, with its 95 % band.",
        bands=(("wash", axes.ring(nm, np.minimum(low, ceiling), np.minimum(high, ceiling))),),
        lines=(("line", axes.path(nm, np.clip(power, 0.0, ceiling))),),
    )


# Noise


@dataclass(frozen=True)
class Scatter:
    """A plot of all signals of a shot, and its result for each channel."""

    plot: Plot
    median: tuple[float, float, float]


def noise_plot(patches: ShownPatches | None, name: str) -> Scatter | None:
    """Plot the standard error against the signal, with a fit of the photon-noise model; None if there is no fit.

    The model is se² = a + b y + c y² with a, b, c ≥ 0: noise of the dark, of the chart's light, and of the white's.

    `median` is that ratio of measured to fitted variance.
    """
    if patches is None:
        return None
    signal, error = patches.signal, patches.standard_error
    sound = (signal > DARKEST) & (error > LEAST_ERROR)
    if (sound.sum(axis=0) < 3).any():
        return None
    share = np.where(sound, 100.0 * error / np.where(sound, signal, 1.0), np.nan)
    ends = (0.8 * float(signal[sound].min()), 1.25 * float(signal[sound].max()))
    sides = (0.7 * float(np.nanmin(share)), 1.5 * float(np.nanmax(share)))
    axes = Axes(SMALL, (50, 34, 16, 46), ends, sides, True, True)
    axes.marks(decades(*ends), decades(*sides))
    axes.titles("signal, share of white", "standard error, %", 4)
    at = np.geomspace(*ends, 40)
    lines, median = [], []
    for i, colour in enumerate(CHANNELS):
        y, se = signal[sound[:, i], i], error[sound[:, i], i]
        # Rows are relative to se², so that bright and dark patches count equally.
        terms = _nonnegative(np.vander(y, 3, increasing=True) / (se**2)[:, None], np.ones_like(y))
        line = 100.0 * np.sqrt(np.maximum(np.vander(at, 3, increasing=True) @ terms, 1e-300)) / at
        lines.append((f"line {colour}", axes.path(at, np.clip(line, *sides))))
        median.append(float(np.median(se**2 / np.maximum(np.vander(y, 3, increasing=True) @ terms, 1e-300))))
    dots = [
        (float(axes.x(signal[i, c])), float(axes.y(share[i, c])), colour)
        for i, c in np.argwhere(sound)
        for colour in CHANNELS[c : c + 1]
    ]
    label = "Standard error of each patch's signal over the signal, both logarithmic, and the noise of counted light."
    drawn = axes.plot(name, "small", label, lines=tuple(lines), dots=tuple(dots))
    return Scatter(drawn, (median[0], median[1], median[2]))


def _nonnegative(A: Floats, b: Floats) -> Floats:
    """Least squares with x ≥ 0 for a few columns: of all supports the feasible one with the smallest residual."""
    best, least = np.zeros(A.shape[1]), float(b @ b)
    for number in range(1, 1 << A.shape[1]):
        support = [j for j in range(A.shape[1]) if number >> j & 1]
        x = np.linalg.lstsq(A[:, support], b, rcond=None)[0]
        rest = float(np.sum((b - A[:, support] @ x) ** 2))
        if (x >= 0).all() and rest < least:
            best, least = np.zeros(A.shape[1]), rest
            best[support] = x
    return best


# Scales


def fitting(sizes: Floats) -> float:
    """Largest value that a scale must hold: the maximum, or less if a few values lie far beyond the others."""
    most = float(sizes.max())
    usual = float(np.quantile(sizes, 0.9))
    return most if most <= 2.5 * usual else max(1.5 * usual, float(np.quantile(sizes, 0.95)))


def round_up(value: float) -> float:
    """Round up to 1, 1.5, 2, 3, 4, 6 or 8 times a power of ten."""
    if value <= 0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return float(next(step * power for step in (1, 1.5, 2, 3, 4, 6, 8, 10) if step * power >= value * (1 - 1e-12)))
