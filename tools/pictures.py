"""Draws pictures of the docs into docs/images: `python -m tools.pictures`, which overwrites them.

picture-story.png: two measured cameras, each recovered without its maker, photograph the 99 surfaces of
benchmarks.claims.pictures under a bulb. Each tile is one surface, its left half by the first camera and its right
half by the second: through the colour matrix that LibRaw holds of each (Adobe's), and through the curves. Where the
two agree the tile has no seam.

real-d70.png: the D70's curves beside both passes, of docs/real.md.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.claims.colour import cases
from benchmarks.claims.pictures import SEED, show
from benchmarks.claims.real import CLAIM, MEASURED, PAPER, TOLERANCES, d70, solve
from benchmarks.shared import one_thread
from camssf.colorimetry import delta_e00
from camssf.files import write_file
from camssf.grid import BAND, WAVELENGTHS, Floats
from camssf.spectra import colour_science

NAMES = ("Canon EOS 600D", "Nikon Z f")
"""A pair of two makers about as far apart as their median pair under this light, by either way."""
UNDER = "A"
COLUMNS, TILE = 11, 40
TITLES = {"stored": "through the cameras' colour matrices", "camssf": "through the recovered curves"}
RGB = ("#c0392b", "#1e8449", "#2455a4")
"""Colours of the lines of red, green and blue."""
PLACE = Path(__file__).parents[1] / "docs" / "images"


def save_png(figure: Figure, name: str, colours: int, dpi: int) -> None:
    """Write a figure as a PNG of that many colours."""
    drawn, small = io.BytesIO(), io.BytesIO()
    figure.savefig(drawn, format="png", dpi=dpi)
    Image.open(drawn).convert("RGB").quantize(colours).save(small, format="png", optimize=True)
    write_file(PLACE / name, small.getvalue())


def tiles(first: Floats, second: Floats) -> Floats:
    """The tiles in rows of COLUMNS, of two sRGB (99, 3)."""
    halves = np.stack([first, second], axis=1).repeat(TILE // 2, axis=1)  # (99, TILE, 3)
    rows = halves.reshape(-1, COLUMNS, 1, TILE, 3).repeat(TILE, axis=2)
    return np.asarray(rows.transpose(0, 2, 1, 3, 4).reshape(-1, COLUMNS * TILE, 3))


def draw_story() -> None:
    """Two cameras' pictures of 99 surfaces."""
    science, by_name = colour_science(), {case.name: case for case in cases(52, None)}
    shown = [show(by_name[name], UNDER, np.random.default_rng([SEED, i])) for i, name in enumerate(NAMES)]
    figure = Figure(figsize=(9.0, 4.4), layout="constrained")
    for panel, (way, title) in zip(figure.subplots(1, 2), TITLES.items(), strict=True):
        first, second = (one.by[way].mean(axis=1) for one in shown)
        seen = (science.XYZ_to_sRGB(science.Lab_to_XYZ(each)).clip(0.0, 1.0) for each in (first, second))
        panel.imshow(tiles(*seen))
        panel.set_title(f"{title}: ΔE00 {np.median(delta_e00(first, second)):.1f}", fontsize=10)
        panel.set_axis_off()
    save_png(figure, "picture-story.png", 250, dpi=110)


def draw_real() -> None:
    """The D70's curves by two bases, with their bands, and those that were measured."""
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    at = d70().at
    titles = {CLAIM: "camssf, no Nikon in its basis", PAPER: "l1 on Gaussians (the paper)"}
    for panel, (basis, title) in zip(panels, titles.items(), strict=True):
        curves, std = solve(basis, MEASURED, TOLERANCES[1])[1].peak()
        for c, shade in enumerate(RGB):
            panel.plot(WAVELENGTHS, curves[:, c], color=shade, linewidth=1.5)
            if std is not None:
                low, high = curves[:, c] - BAND * std[:, c], curves[:, c] + BAND * std[:, c]
                panel.fill_between(WAVELENGTHS, low, high, color=shade, alpha=0.15, linewidth=0)
            for truth, mark in zip(d70().truth.values(), ("o", "x"), strict=True):
                points = {"color": shade, "markersize": 3.5, "markeredgewidth": 0.8, "fillstyle": "none"}
                panel.plot(WAVELENGTHS[at], truth[at, c], mark, **points)
        panel.set_title(title, fontsize=10)
        panel.set(xlabel="nm", xlim=(390, 710), ylim=(-0.12, 1.3))
        panel.grid(alpha=0.3)
    point: dict[str, Any] = {"color": "black", "markersize": 3.5, "fillstyle": "none", "linestyle": ""}
    panels[0].plot([], [], label="recovered from the chart", color="black")
    panels[0].plot([], [], label="monochromator 2011", marker="o", **point)
    panels[0].plot([], [], label="monochromator 2010", marker="x", **point)
    panels[0].set_ylabel("Nikon D70, peak 1")
    panels[0].legend(fontsize=8, loc="upper right")
    save_png(figure, "real-d70.png", 160, dpi=90)


if __name__ == "__main__":
    one_thread(__spec__)
    draw_story()
    draw_real()
