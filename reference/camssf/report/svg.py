"""Draws plots as SVG, for the page, a notebook and files: axes, bands, lines, dots and texts."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
from markupsafe import Markup

from camssf.grid import Floats

HUES = {"red": "#c8352b", "green": "#268a54", "blue": "#3a63d0"}
"""Colours of the channels that are legible on white and on black."""


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
class Axes:
    """A frame and the ranges of its axes; a plot is made of paths in them."""

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
        """Pixels of values on the x axis."""
        left, _, right, _ = self.frame
        return left + _part(value, self.x_range, self.x_log) * (right - left)

    def y(self, value: Any) -> Any:
        """Pixels of values on the y axis."""
        _, top, _, bottom = self.frame
        return bottom - _part(value, self.y_range, self.y_log) * (bottom - top)

    def path(self, x: Floats, y: Floats) -> str:
        """A line through points."""
        return "M" + "L".join(f"{a:.1f},{b:.1f}" for a, b in zip(self.x(x), self.y(y), strict=True))

    def ring(self, x: Floats, low: Floats, high: Floats) -> str:
        """The area between two lines."""
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
        """Add the titles of both axes; `at` is where the y axis's begins, px."""
        left, top, right, _ = self.frame
        self.texts.append(Label((left + right) / 2, self.size[1] - 6, x))
        self.texts.append(Label(left if at is None else at, top - (26 if self.size[0] > 720 else 14), y, "start"))

    def plot(self, name: str, kind: str, label: str, **drawn: Any) -> Plot:
        """The plot of what was drawn; `drawn` are fields of `Plot`."""
        return Plot(name, kind, *self.size, *self.frame, label, tuple(self.rules), tuple(self.texts), **drawn)


def _part(value: Any, ends: tuple[float, float], log: bool) -> Any:
    low, high = (math.log(ends[0]), math.log(ends[1])) if log else ends
    value = np.log(np.asarray(value, dtype=np.float64)) if log else np.asarray(value, dtype=np.float64)
    return (value - low) / (high - low)


def minus(text: str) -> str:
    """The text with true minus signs."""
    return text.replace("-", "\u2212")


def ticks(low: float, high: float, least: int = 3) -> list[tuple[float, str]]:
    """At least `least` round numbers between two ends."""
    step = 10.0 ** math.ceil(math.log10(max(high - low, 1e-12)))
    while math.floor(high / step) - math.ceil(low / step) + 1 < least:
        step /= 2 if f"{step:e}"[0] != "5" else 2.5
    decimals = max(0, -math.floor(math.log10(step) + 1e-9) + (f"{step:.1e}"[2] == "5"))
    marks = np.arange(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1) * step
    return [(float(v), minus(f"{v:.{decimals}f}")) for v in marks]


def decades(low: float, high: float) -> list[tuple[float, str]]:
    """1, 2 and 5 times the powers of ten between two ends; fewer multiples for wide ranges."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for steps in ((1, 2, 5), (1, 3), (1,)):
        ticks = [step * 10.0**power for power in powers for step in steps if low <= step * 10.0**power <= high]
        if len(ticks) <= 8:
            break
    return [(value, f"{value:g}" if 1e-4 < value < 1e5 else f"{value:.0e}") for value in ticks]


# The file


def svg(plot: Plot) -> Markup:
    """The plot as an SVG element, for a page whose style sheet has its classes (data/report/report.css)."""
    return Markup(_element(plot, f'<svg class="plot {plot.kind}"'))


def whole_svg(plot: Plot, ground: str = "none") -> str:
    """The plot as an SVG file, which brings its own style; `ground` is the colour behind it."""
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="camssf-plot" width="{plot.width}" height="{plot.height}" '
        f'style="max-width:100%;height:auto;background:{ground}"'
    )
    style = _STYLE + "".join(_HUED.replace("HUE", hue).replace("NAME", name) for name, hue in HUES.items())
    return _element(plot, head, f"<style>{style.replace('|', '.camssf-plot ')}</style>")


_STYLE = (
    "|text{font:13px sans-serif;fill:currentColor}|.head{font-size:19px;font-weight:600}|.peak{font-weight:600}"
    "|.grid{stroke:currentColor;stroke-opacity:.15}|.zero{stroke:currentColor;stroke-opacity:.5}"
    "|.curve{fill:none;stroke-width:2.25;stroke-linejoin:round}|.band{fill-opacity:.17}"
    "|.truth{fill:none;stroke:currentColor;stroke-width:1.3;stroke-dasharray:5 4}"
)
_HUED = "|.curve.NAME{stroke:HUE}|.band.NAME,|.peak.NAME{fill:HUE}"
"""Not by variables of CSS, which other programs than browsers do not know."""


def _element(plot: Plot, head: str, style: str = "") -> str:
    width, height = plot.right - plot.left, plot.bottom - plot.top
    frame = f'x="{plot.left}" y="{plot.top}" width="{width}" height="{height}"'
    lines = [
        f'{head} id="{plot.name}" viewBox="0 0 {plot.width} {plot.height}" role="img" '
        f'aria-label="{escape(plot.label)}">{style}',
        f'<clipPath id="frame-{plot.name}"><rect {frame}/></clipPath>',
        *(
            f'<line class="{"zero" if zero else "grid"}" '
            f'x1="{plot.left}" x2="{plot.right}" y1="{y:.1f}" y2="{y:.1f}"/>'
            for y, zero in plot.rules
        ),
        *map(_text, plot.texts),
        f'<g clip-path="url(#frame-{plot.name})">',
        *(f'<path class="{kind}" d="{way}"/>' for kind, way in (*plot.bands, *plot.lines)),
        *(f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="2.6"/>' for x, y, kind in plot.dots),
        *map(_text, plot.names),
        "</g>",
        *(_readout(plot, *readout) for readout in plot.readouts),
        "</svg>\n",
    ]
    return "\n".join(lines)


def _text(label: Label) -> str:
    kind = f' class="{label.kind}"' if label.kind else ""
    place = f'x="{label.x:.1f}" y="{label.y:.1f}" text-anchor="{label.side}"'
    return f"<text{kind} {place}>{escape(label.text)}</text>"


def _readout(plot: Plot, start: float, end: float, at: float, texts: Iterable[tuple[str, str]]) -> str:
    """What is shown while the pointer is over a slot of the plot."""
    spans = "".join(
        f'<tspan class="{kind}" dx="10">{escape(text)}</tspan>' if kind else escape(text) for text, kind in texts
    )
    slot = f'x="{start:.1f}" y="{plot.top}" width="{end - start:.1f}" height="{plot.bottom - plot.top}"'
    return (
        f'<g class="readout"><rect {slot}/><line x1="{at:.1f}" x2="{at:.1f}" y1="{plot.top}" y2="{plot.bottom}"/>'
        f'<text x="{plot.right}" y="{plot.top - 26}" text-anchor="end">{spans}</text></g>'
    )
