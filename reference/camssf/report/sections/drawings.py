"""The page's plots as plain data: axes, lines and dots in CSS pixels, for the macro `plot` in data/report."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from camssf.grid import CHANNELS, WAVELENGTHS, Floats
from camssf.report.sections.bands import possible
from camssf.report.sections.curves import DrawnCurves
from camssf.report.sections.text import Json

SMALL = (420, 230)
"""Size of a plot that fits next to another one."""
DARKEST, LEAST_ERROR = 1e-6, 1e-9
"""Parts of white; smaller signals and errors are not plotted."""
THIN = slice(None, None, 2)
"""Plots use every 1 nm, which is finer than a pixel."""


@dataclass(frozen=True)
class Label:
    """Text at a position; `side` is SVG's text-anchor."""

    x: float
    y: float
    text: str
    side: str = "middle"
    kind: str = ""


@dataclass(frozen=True)
class Plot:
    """One drawing.

    Attributes:
        name: unique on the page, for ids.
        kind: CSS classes in addition to "plot".
        width, height: of the whole. left, top, right, bottom: of the frame, from the whole's top left.
        label: text for screen readers.
        rules: y of each horizontal line, and whether it is the zero line.
        texts: titles and numbers at the axes.
        bands, lines: paths, each with its class. dots: x, y, and class.
        names: labels inside the frame.
        readouts: texts for the pointer's position: x from, x to, x, and texts with their classes.
    """

    name: str
    kind: str
    width: int
    height: int
    left: int
    top: int
    right: int
    bottom: int
    label: str
    rules: tuple[tuple[float, bool], ...] = ()
    texts: tuple[Label, ...] = ()
    bands: tuple[tuple[str, str], ...] = ()
    lines: tuple[tuple[str, str], ...] = ()
    dots: tuple[tuple[float, float, str], ...] = ()
    names: tuple[Label, ...] = ()
    readouts: tuple[tuple[float, float, float, tuple[tuple[str, str], ...]], ...] = ()


@dataclass
class _Axes:
    """A frame and the ranges of its axes."""

    size: tuple[int, int]
    margins: tuple[int, int, int, int]
    x_range: tuple[float, float]
    y_range: tuple[float, float]
    x_log: bool = False
    y_log: bool = False
    rules: list[tuple[float, bool]] = field(default_factory=list)
    texts: list[Label] = field(default_factory=list)

    @property
    def frame(self) -> tuple[int, int, int, int]:
        """Left, top, right, bottom."""
        left, top, right, bottom = self.margins
        return left, top, self.size[0] - right, self.size[1] - bottom

    def x(self, value: Any) -> Any:
        left, _, right, _ = self.frame
        return left + _part(value, self.x_range, self.x_log) * (right - left)

    def y(self, value: Any) -> Any:
        _, top, _, bottom = self.frame
        return bottom - _part(value, self.y_range, self.y_log) * (bottom - top)

    def path(self, x: Floats, y: Floats) -> str:
        return "M" + "L".join(f"{a:.1f},{b:.1f}" for a, b in zip(self.x(x), self.y(y), strict=True))

    def ring(self, x: Floats, low: Floats, high: Floats) -> str:
        return self.path(np.r_[x, x[::-1]], np.r_[high, low[::-1]]) + "Z"

    def marks(self, xs: Iterable[tuple[float, str]], ys: Iterable[tuple[float, str]]) -> None:
        """Add numbers along both axes, and a horizontal line at each number of the y axis."""
        left, _, _, bottom = self.frame
        for value, text in xs:
            self.texts.append(Label(self.x(value), bottom + 18, text))
        for value, text in ys:
            self.rules.append((self.y(value), value == 0))
            self.texts.append(Label(left - 7, self.y(value) + 4, text, "end"))

    def titles(self, x: str, y: str, at: float | None = None) -> None:
        left, top, right, _ = self.frame
        self.texts.append(Label((left + right) / 2, self.size[1] - 6, x))
        self.texts.append(Label(left if at is None else at, top - (26 if self.size[0] > 720 else 14), y, "start"))

    def plot(self, name: str, kind: str, label: str, **drawn: Any) -> Plot:
        return Plot(name, kind, *self.size, *self.frame, label, tuple(self.rules), tuple(self.texts), **drawn)


def _part(value: Any, ends: tuple[float, float], log: bool) -> Any:
    low, high = (math.log(ends[0]), math.log(ends[1])) if log else ends
    value = np.log(np.asarray(value, dtype=np.float64)) if log else np.asarray(value, dtype=np.float64)
    return (value - low) / (high - low)


def _minus(text: str) -> str:
    return text.replace("-", "\u2212")


# The curves


def curve_plot(
    curves: DrawnCurves, width: int, height: int, step: int, kind: str, nearest: Floats | None = None
) -> Plot:
    """The plot of the curves; `step` is the distance of readouts in nm, `kind` is wide or narrow.

    `nearest` (681, 3) are a known camera's curves, drawn dotted.
    """
    wide = kind == "wide"
    low, high = curves.limits()
    axes = _Axes((width, height), (52, 46, 12, 46) if wide else (30, 52, 14, 40), (380.0, 720.0), (low, high))
    fifths = np.arange(math.ceil(low * 5), math.floor(high * 5) + 1) / 5
    axes.marks(
        ((nm, f"{nm}") for nm in range(400, 721, 40 if wide else 80)),
        ((float(v), _minus(f"{v:.1f}")) for v in fifths),
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
    if nearest is not None:
        lines += [(f"nearest {c}", axes.path(nm, nearest[THIN, i])) for i, c in enumerate(CHANNELS)]
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


def _readouts(curves: DrawnCurves, axes: _Axes, step: int, wide: bool) -> Iterable[Any]:
    left, _, right, _ = axes.frame
    slot = step / 340.0 * (right - left)
    for k in range(0, len(WAVELENGTHS), 2 * step):
        at = float(axes.x(WAVELENGTHS[k]))
        texts = [(f"{WAVELENGTHS[k]:.0f} nm", "")]
        for i, colour in enumerate(CHANNELS):
            text = f"{curves.ssf[k, i]:.3f}"
            if wide and curves.low is not None and curves.high is not None:
                text += f" ({curves.low[k, i]:.3f} to {curves.high[k, i]:.3f})"
            texts.append((_minus(text), colour))
        yield max(left, at - slot / 2), min(right, at + slot / 2), at, tuple(texts)


# Light


def light_plot(power: Floats, std: Floats, name: str) -> Plot:
    """A light's relative power (681,) and its 95 % band."""
    nm = WAVELENGTHS[THIN]
    power, std = (np.asarray(each, dtype=np.float64)[THIN] for each in (power, std))
    low, high = possible(power, std)
    ceiling = 1.05 * max(float(min(high.max(), 3.0 * power.max())), 1e-9)
    axes = _Axes(SMALL, (44, 34, 16, 46), (380.0, 720.0), (0.0, ceiling))
    axes.marks(((nm, f"{nm}") for nm in range(400, 701, 100)), _ticks(0.0, ceiling))
    axes.titles("wavelength, nm", "relative power", 4)
    return axes.plot(
        name,
        "small",
        "Relative power of the light over wavelength, 380 to 720 nm, with its 95 % band.",
        bands=(("wash", axes.ring(nm, np.minimum(low, ceiling), np.minimum(high, ceiling))),),
        lines=(("line", axes.path(nm, np.clip(power, 0.0, ceiling))),),
    )


def _ticks(low: float, high: float, least: int = 3) -> list[tuple[float, str]]:
    """At least `least` round numbers between two ends."""
    step = 10.0 ** math.ceil(math.log10(max(high - low, 1e-12)))
    while math.floor(high / step) - math.ceil(low / step) + 1 < least:
        step /= 2 if f"{step:e}"[0] != "5" else 2.5
    decimals = max(0, -math.floor(math.log10(step) + 1e-9) + (f"{step:.1e}"[2] == "5"))
    marks = np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1) * step
    return [(float(v), _minus(f"{v:.{decimals}f}")) for v in marks]


def _decades(low: float, high: float) -> list[tuple[float, str]]:
    """1, 2 and 5 times the powers of ten between two ends; fewer multiples for wide ranges."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in ((1, 2, 5), (1, 3), (1,)):
        found = [step * 10.0**power for power in powers for step in steps if low <= step * 10.0**power <= high]
        if len(found) <= 8:
            break
    return [(value, f"{value:g}" if 1e-4 < value < 1e5 else f"{value:.0e}") for value in found]


# Noise and linearity


@dataclass(frozen=True)
class Scatter:
    """A plot of all signals of a shot, and its result for each channel."""

    plot: Plot
    found: tuple[float, float, float]


def noise_plot(patches: Sequence[Json], name: str) -> Scatter | None:
    """Plot the standard error against the signal, with a fit of the photon-noise model; None if there is no fit.

    The model is se² = a + b y + c y² with a, b, c ≥ 0: noise of the dark, of the chart's light, and of the white's.

    `found` is the median ratio of measured to fitted variance.
    """
    from scipy.optimize import nnls

    if not patches:
        return None
    signal, error = (np.array([patch[key] for patch in patches], dtype=float) for key in ("signal", "standard_error"))
    sound = (signal > DARKEST) & (error > LEAST_ERROR)
    if (sound.sum(axis=0) < 3).any():
        return None
    share = np.where(sound, 100.0 * error / np.where(sound, signal, 1.0), np.nan)
    ends = (0.8 * float(signal[sound].min()), 1.25 * float(signal[sound].max()))
    sides = (0.7 * float(np.nanmin(share)), 1.5 * float(np.nanmax(share)))
    axes = _Axes(SMALL, (50, 34, 16, 46), ends, sides, True, True)
    axes.marks(_decades(*ends), _decades(*sides))
    axes.titles("signal, share of white", "standard error, %", 4)
    at = np.geomspace(*ends, 40)
    lines, found = [], []
    for i, colour in enumerate(CHANNELS):
        y, se = signal[sound[:, i], i], error[sound[:, i], i]
        # Rows are relative to se², so that bright and dark patches count equally.
        try:
            terms, _ = nnls(np.vander(y, 3, increasing=True) / (se**2)[:, None], np.ones_like(y))
        except RuntimeError:  # no convergence, for numbers that no camera gives
            return None
        line = 100.0 * np.sqrt(np.maximum(np.vander(at, 3, increasing=True) @ terms, 1e-300)) / at
        lines.append((f"line {colour}", axes.path(at, np.clip(line, *sides))))
        found.append(float(np.median(se**2 / np.maximum(np.vander(y, 3, increasing=True) @ terms, 1e-300))))
    dots = [
        (float(axes.x(signal[i, c])), float(axes.y(share[i, c])), colour)
        for i, c in np.argwhere(sound)
        for colour in CHANNELS[c : c + 1]
    ]
    label = "Standard error of each patch's signal over the signal, both logarithmic, and the noise of counted light."
    drawn = axes.plot(name, "small", label, lines=tuple(lines), dots=tuple(dots))
    return Scatter(drawn, (found[0], found[1], found[2]))


def linearity_plot(patches: Sequence[Json], name: str) -> Scatter | None:
    """Plot measured against predicted signals; `found` is p in measured ∝ predicted^p, 1 for a linear sensor."""
    if not patches:
        return None
    signal = np.array([np.multiply(patch.get("level", 1.0), patch["signal"]) for patch in patches], dtype=float)
    nothing = [math.nan] * 3
    guess = np.array([patch["unseen"] or patch["predicted"] or nothing for patch in patches], dtype=float)
    with np.errstate(invalid="ignore"):
        sound = (signal > DARKEST) & (guess > DARKEST)
    if (sound.sum(axis=0) < 3).any():
        return None
    off = np.where(sound, 100.0 * (signal / np.where(sound, guess, 1.0) - 1.0), np.nan)
    ends = (0.8 * float(guess[sound].min()), 1.25 * float(guess[sound].max()))
    scale = round_up(1.05 * fitting(np.abs(off[sound])))
    axes = _Axes(SMALL, (50, 34, 16, 46), ends, (-scale, scale), x_log=True)
    axes.marks(_decades(*ends), _ticks(-scale, scale))
    axes.titles("predicted signal, share of white", "measured less predicted, %", 4)
    at = np.geomspace(*ends, 40)
    lines, found = [], []
    for i, colour in enumerate(CHANNELS):
        x, y = np.log(guess[sound[:, i], i]), np.log(signal[sound[:, i], i])
        # A line robust to outliers: Siegel's repeated medians.
        slope, level = _median_line(x, y)
        found.append(slope)
        bent = 100.0 * np.expm1(np.clip(level + (slope - 1.0) * np.log(at), -50.0, 50.0))
        lines.append((f"line {colour}", axes.path(at, np.clip(bent, -scale, scale))))
    dots = [
        (float(axes.x(guess[i, c])), float(axes.y(np.clip(off[i, c], -scale, scale))), CHANNELS[c])
        for i, c in np.argwhere(sound)
    ]
    label = "Measured less predicted signal of each patch over the predicted one; zero is a linear sensor's."
    drawn = axes.plot(name, "small", label, lines=tuple(lines), dots=tuple(dots))
    return Scatter(drawn, (found[0], found[1], found[2]))


def _median_line(x: Floats, y: Floats) -> tuple[float, float]:
    from scipy.stats import siegelslopes

    slope, level = siegelslopes(y, x)
    return float(slope), float(level)


# Comparison


def difference_plot(off: Floats, half: Floats | None, name: str) -> Plot:
    """Plot the difference of two results' curves, (681, 3), with the half-width of its 95 % interval."""
    thin = off[THIN]
    size = float(np.abs(thin).max())
    if half is not None:
        size = max(size, float(np.quantile(half[THIN], 0.95)))
    scale = round_up(1.05 * max(size, 1e-3))
    axes = _Axes((720, 300), (52, 34, 16, 46), (380.0, 720.0), (-scale, scale))
    axes.marks(((nm, f"{nm}") for nm in range(400, 701, 50)), _ticks(-scale, scale))
    axes.titles("wavelength, nm", "this less the other, peak = 1", 4)
    nm, bands = WAVELENGTHS[THIN], []
    if half is not None:
        ends = (np.clip(thin - half[THIN], -scale, scale), np.clip(thin + half[THIN], -scale, scale))
        bands = [(f"band {c}", axes.ring(nm, ends[0][:, i], ends[1][:, i])) for i, c in enumerate(CHANNELS)]
    return axes.plot(
        name,
        "",
        "Difference of the two results' curves over wavelength, 380 to 720 nm, with its 95 % interval.",
        bands=tuple(bands),
        lines=tuple((f"curve {c}", axes.path(nm, thin[:, i])) for i, c in enumerate(CHANNELS)),
    )


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
