"""Shared functions for tables of lamps, charts and cameras: checks of wavelengths, interpolation to the grid."""

from __future__ import annotations

import warnings
from contextlib import suppress
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from camssf.errors import CalibrationError, InvalidArgument
from camssf.files import check_local
from camssf.fonts import prepare_matplotlib
from camssf.grid import WAVELENGTHS, Floats
from camssf.libraries import library
from camssf.spectra.bundled import sprague

# A table must cover this range without a larger gap, nm.
_FIRST, _LAST, _GAP = 400.0, 700.0, 20.0


@cache
def colour_science() -> Any:
    """Import colour-science on first use, without its warnings about optional packages that camssf does not use.

    Raises:
        InvalidArgument: it is not installed.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with suppress(ImportError):
            prepare_matplotlib()  # colour-science loads it
        return library("colour", "An object of colour-science needs", "colour-science")


def smooth(wavelengths: Floats, values: Floats) -> Floats:
    """Interpolate to the grid, (681,): Sprague (CIE 167:2005) for even steps, else cubic spline; constant outside."""
    first, last = float(wavelengths[0]), float(wavelengths[-1])
    step = (last - first) / (len(wavelengths) - 1)
    if np.allclose(wavelengths, first + step * np.arange(len(wavelengths)), rtol=0, atol=1e-3):
        return sprague(first, step, values)
    from scipy.interpolate import make_interp_spline

    return np.asarray(make_interp_spline(wavelengths, values)(np.clip(WAVELENGTHS, first, last)), dtype=np.float64)


def check_wavelengths(wavelengths: Floats, path: Path, unfit: type[CalibrationError], *, whole: bool = True) -> None:
    """Check wavelengths: increasing, in nm, at least 6, no gap on the grid; with `whole`, covering 400 to 700 nm.

    Raises:
        InvalidArgument: they do not increase or are not in nm. Any other fault raises `unfit`.
    """
    steps = np.diff(wavelengths)
    if len(wavelengths) < 2 or not np.isfinite(wavelengths).all() or steps.min() < 1e-3:
        raise InvalidArgument(f"The wavelengths in {path} do not increase.", "Sort them, in nm, each once.")
    if not 100 <= wavelengths[0] <= wavelengths[-1] <= 20_000:
        raise InvalidArgument(f"The wavelengths in {path} are not in nm.", "Write 550 for green, not 0.55 or 5500.")
    span = f"{wavelengths[0]:g} to {wavelengths[-1]:g} nm"
    if whole and (wavelengths[0] > _FIRST or wavelengths[-1] < _LAST):
        raise unfit(f"{path} covers only {span}.", "It must cover 400 to 700 nm, better 380 to 720 nm.")
    inside = np.where((wavelengths[:-1] < WAVELENGTHS[-1]) & (wavelengths[1:] > WAVELENGTHS[0]), steps, 0.0)
    widest = int(inside.argmax())
    if len(wavelengths) < 6:
        raise unfit(
            f"{path} has only {len(wavelengths)} wavelengths from {span}.",
            "Give a spectrum every 20 nm or finer; 5 nm is usual.",
            value=float(steps.max()),
            threshold=_GAP,
        )
    if steps[widest] > _GAP:
        raise unfit(
            f"{path} has a gap of {steps[widest]:g} nm: nothing from {wavelengths[widest]:g} to "
            f"{wavelengths[widest + 1]:g} nm.",
            "Give a spectrum every 20 nm or finer; 5 nm is usual. A list of lines alone is no spectrum.",
            value=float(steps[widest]),
            threshold=_GAP,
        )


def held(wavelengths: Floats) -> str:
    """A note for `source` if a table does not cover the grid; else an empty text."""
    if wavelengths[0] <= WAVELENGTHS[0] and wavelengths[-1] >= WAVELENGTHS[-1]:
        return ""
    return f", held constant outside {wavelengths[0]:g} to {wavelengths[-1]:g} nm"


def text_of(spec: str | PathLike[str] | None) -> str:
    """The given name or path without surrounding spaces.

    Raises:
        InvalidArgument: it is a URL, or contains one as in `nano24:https://...`.
    """
    if spec is None:
        return ""
    text = str(spec).strip()
    check_local(spec)
    check_local(text.partition(":")[2])
    return text


def frozen(values: Floats) -> Floats:
    """A read-only copy."""
    values = np.array(values, dtype=np.float64)
    values.setflags(write=False)
    return values
