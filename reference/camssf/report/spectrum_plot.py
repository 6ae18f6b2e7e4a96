"""Draws reflectances with their 95 % bands."""

from __future__ import annotations

import io
from typing import Any

from camssf.colour.reflectance import SurfaceSpectra
from camssf.errors import InvalidArgument
from camssf.report.plots import require_matplotlib
from camssf.spectra.surfaces import SURFACE_NODES

PICTURES = {".png": "png", ".svg": "svg", ".pdf": "pdf"}
"""Formats of a picture by the ending of its file."""


def draw_spectra(spectra: SurfaceSpectra, ax: Any) -> None:
    """Draw the reflectances with their 95 % bands on matplotlib axes."""
    for i, (row, std) in enumerate(zip(spectra.reflectance, spectra.standard_deviation, strict=True)):
        hue = f"C{i % 10}"
        ax.fill_between(SURFACE_NODES, row - 1.96 * std, row + 1.96 * std, color=hue, alpha=0.16, linewidth=0)
        ax.plot(SURFACE_NODES, row, color=hue, label=f"region {i + 1}")
    ax.set_xlim(SURFACE_NODES[0], SURFACE_NODES[-1])
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel("wavelength, nm")
    ax.set_ylabel("reflectance")
    ax.set_title(f"reflectance and 95 % band, prior {spectra.prior}", parse_math=False)
    ax.legend(frameon=False)


def check_picture(ending: str) -> None:
    """Check that a picture can be written to a file of this ending.

    Raises:
        InvalidArgument: it is none of PICTURES.
    """
    if ending.casefold() not in PICTURES:
        raise InvalidArgument(f"No picture can be written as {ending!r}.", f"Take one of {', '.join(PICTURES)}.")


def spectrum_picture(spectra: SurfaceSpectra, ending: str) -> bytes:
    """The drawing as a file's content.

    Args:
        spectra: to draw.
        ending: of the file, one of PICTURES.

    Raises:
        InvalidArgument: another ending, or no matplotlib.
    """
    check_picture(ending)
    require_matplotlib()
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    draw_spectra(spectra, figure.subplots())
    data = io.BytesIO()
    figure.savefig(data, format=PICTURES[ending.casefold()], dpi=144)
    return data.getvalue()
