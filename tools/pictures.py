"""What the pictures of the docs share."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from camssf.colorimetry import BEND, D65, SLOPE, srgb
from camssf.files import write_file
from camssf.grid import BAND, WAVELENGTHS, Floats
from camssf.libraries import prepare_matplotlib

RGB = ("#c0392b", "#1e8449", "#2455a4")
"""Colours of the lines of red, green and blue."""


def subplots(rows: int, columns: int, size: tuple[float, float], **options: Any) -> tuple[Any, Any]:
    """A figure of that size, inches, and its panels."""
    prepare_matplotlib()
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, layout="constrained")
    return figure, figure.subplots(rows, columns, **options)


def save_png(figure: Any, path: Path, colours: int = 160, dpi: int = 90) -> None:
    """Write a figure as a PNG of that many colours."""
    from PIL import Image

    drawn, small = io.BytesIO(), io.BytesIO()
    figure.savefig(drawn, format="png", dpi=dpi)
    Image.open(drawn).convert("RGB").quantize(colours).save(small, format="png", optimize=True)
    write_file(path, small.getvalue())


def legend(panel: Any, entries: dict[str, dict[str, Any]], **options: Any) -> None:
    """A legend of lines that stand for those of all panels: their looks by their words."""
    for label, look in entries.items():
        panel.plot([], [], label=label, **look)
    panel.legend(**{"fontsize": 8} | options)


def draw_band(panel: Any, curve: Floats, std: Floats, shade: str) -> None:
    """The 95 % band of a curve (681,) with that standard deviation."""
    low, high = curve - BAND * std, curve + BAND * std
    panel.fill_between(WAVELENGTHS, low, high, color=shade, alpha=0.15, linewidth=0)


def from_lab(colours: Floats) -> Floats:
    """sRGB (..., 3), inside the display's gamut, of Lab (..., 3) under D65."""
    y = (colours[..., 0] + 16.0) / 116.0
    roots = np.stack([y + colours[..., 1] / 500.0, y, y - colours[..., 2] / 200.0], axis=-1)
    ratio = np.where(roots**3 > BEND, roots**3, (116.0 * roots - 16.0) / SLOPE)
    return np.clip(srgb(ratio * D65), 0.0, 1.0)
