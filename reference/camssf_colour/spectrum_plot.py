"""Draws reflectances with their 95 % bands."""

from __future__ import annotations

import numpy as np

from camssf.grid import BAND
from camssf.report.svg import Axes, Label, ticks, whole_svg
from camssf.spectra.bundled import SURFACE_NODES
from camssf_colour.reflectance import SurfaceSpectra

SIZE = (760, 440)


def spectrum_svg(spectra: SurfaceSpectra) -> str:
    """An SVG file of the reflectances with their 95 % bands, white behind them."""
    low, high = (spectra.reflectance + sign * BAND * spectra.standard_deviation for sign in (-1.0, 1.0))
    top = float(max(1e-3, 1.05 * high.max()))
    axes = Axes(SIZE, (52, 60, 16, 46), (float(SURFACE_NODES[0]), float(SURFACE_NODES[-1])), (0.0, top))
    axes.marks(((nm, f"{nm}") for nm in range(400, 721, 40)), ticks(0.0, top))
    axes.titles("wavelength, nm", "reflectance")
    axes.texts.append(Label(52, 24, f"reflectance and 95 % band, prior {spectra.prior}", "start", "head"))
    end = float(axes.x(SURFACE_NODES[-1])) - 4
    names = [
        Label(end, float(axes.y(row[-1])) - 4, f"region {number}", "end", f"peak {hue(number)}")
        for number, row in enumerate(spectra.reflectance, 1)
    ]
    ends = np.maximum(low, 0.0), high
    plot = axes.plot(
        "reflectances",
        "",
        "Reflectance of each region over wavelength, with its 95 % band.",
        bands=tuple(
            (f"band {hue(number)}", axes.ring(SURFACE_NODES, bottom, over))
            for number, (bottom, over) in enumerate(zip(*ends, strict=True), 1)
        ),
        lines=tuple(
            (f"curve {hue(number)}", axes.path(SURFACE_NODES, np.maximum(row, 0.0)))
            for number, row in enumerate(spectra.reflectance, 1)
        ),
        names=tuple(names),
    )
    return whole_svg(plot, "white")


def hue(number: int) -> str:
    """The class of a region's colour, from 1; the colours repeat."""
    return ("red", "green", "blue")[(number - 1) % 3]
