"""Sampled spectra: checks of wavelengths, interpolation to the grid, and what objects of other libraries hold.

Reading an object needs no library, only the object's attributes.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from camssf.errors import InvalidArgument
from camssf.files import check_local
from camssf.grid import WAVELENGTHS, Floats
from camssf.libraries import library, prepare_matplotlib
from camssf.messages import fail
from camssf.spectra.bundled import sprague
from camssf.spectra.limits import (
    ANGSTROMS,
    COVERED,
    FEWEST_WAVELENGTHS,
    NANOMETRES,
    OTHER_UNITS,
    SMALLEST_STEP,
    WIDEST_STEP,
)
from camssf.spectra.text import path_text


class Spectrum(Protocol):
    """One spectrum, such as colour-science's SpectralDistribution or any object with these attributes."""

    @property
    def wavelengths(self) -> Any:
        """(w,) nm, increasing."""

    @property
    def values(self) -> Any:
        """(w,)."""


class Spectra(Protocol):
    """Several spectra, such as colour-science's MultiSpectralDistributions."""

    @property
    def wavelengths(self) -> Any:
        """(w,) nm, increasing."""

    @property
    def values(self) -> Any:
        """(w, n)."""

    @property
    def labels(self) -> Any:
        """(n,) names of the columns."""


Pair: TypeAlias = tuple[ArrayLike, ArrayLike]
"""Wavelengths, nm, and the values there."""
Name: TypeAlias = str | PathLike[str]
"""A known name, or a file's path."""


@dataclass(frozen=True)
class Sampled:
    """n spectra at the same wavelengths.

    Attributes:
        name: for messages and results; differs from all names of tables.
        source: description for the report.
        labels: (n,) names of the spectra; empty if they have none.
        wavelengths: (w,) nm.
        values: (n, w).
    """

    name: str
    source: str
    labels: tuple[str, ...]
    wavelengths: Floats
    values: Floats


def is_one(value: Any) -> bool:
    """Whether this is one spectrum or one set of spectra, not a list of them."""
    return hasattr(value, "wavelengths") or isinstance(value, Mapping) or _is_pair(value)


def sampled(value: Any, kind: str, advice: str) -> Sampled:
    """Read the spectra of an object, of a mapping from names to objects, or of a pair of arrays.

    Args:
        given: any value; it is checked.
        kind: the expected kind for messages, for example "lamp".
        advice: advice for messages.

    Raises:
        InvalidArgument: it is none of these, or the shapes of its arrays do not match.
    """
    if isinstance(value, Mapping) and value:
        parts = [sampled(part, kind, advice) for part in value.values()]
        first = parts[0].wavelengths
        if any(len(part.values) != 1 or not np.array_equal(part.wavelengths, first) for part in parts):
            raise InvalidArgument(f"The spectra of this {kind} differ in their wavelengths.", advice)
        names = tuple(str(name) for name in value)
        return Sampled(f"{kind} (given)", "given as objects", names, first, np.concatenate([p.values for p in parts]))
    if hasattr(value, "wavelengths") and hasattr(value, "values"):
        name, source = _name(value, kind), f"given as an object, {type(value).__name__}"
        pair, labels = (value.wavelengths, value.values), tuple(str(part) for part in getattr(value, "labels", ()))
        turned = True  # one spectrum per column
    elif _is_pair(value):
        name, source, pair, labels = f"{kind} (given)", "given as arrays", tuple(value), ()
        turned = False
    else:
        raise InvalidArgument(f"A {type(value).__name__} is no {kind}.", advice)
    try:
        wavelengths, values = (np.array(part, dtype=np.float64) for part in pair)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(f"The {kind} holds a value that is not a number.", advice) from error
    if values.ndim == 2 and turned:
        values = values.T
    if wavelengths.ndim != 1 or values.ndim not in (1, 2) or values.shape[-1:] != wavelengths.shape:
        shapes = f"{wavelengths.shape} and {values.shape}"
        raise InvalidArgument(f"The {kind}'s wavelengths and values have the shapes {shapes}.", advice)
    return Sampled(name, source, labels, wavelengths, np.atleast_2d(values))


def _name(value: Any, kind: str) -> str:
    """The object's own name, marked as given, so that D65 in a result always means the table."""
    words = " ".join(str(getattr(value, "name", "") or kind).replace("/", " ").replace("\\", " ").split())
    return f"{words[:80]} (given)"


def _is_pair(value: Any) -> bool:
    """Whether this is a pair of numeric arrays, not two names, two lamps or two such pairs."""
    if isinstance(value, str | bytes) or not hasattr(value, "__len__") or len(value) != 2:
        return False
    try:
        first, second = (np.asarray(part, dtype=np.float64) for part in value)
    except (TypeError, ValueError, KeyError):
        return False
    return first.ndim == 1 and second.ndim in (1, 2)


_SORTED = "Sort them, in nm, each once."


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
    if np.allclose(wavelengths, first + step * np.arange(len(wavelengths)), rtol=0, atol=SMALLEST_STEP):
        return sprague(first, step, values)
    from scipy.interpolate import make_interp_spline

    return np.asarray(make_interp_spline(wavelengths, values)(np.clip(WAVELENGTHS, first, last)), dtype=np.float64)


def ascending(wavelengths: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Wavelengths (w,) and values (w, ...), turned if the wavelengths decrease throughout."""
    return (wavelengths[::-1], values[::-1]) if (np.diff(wavelengths) < 0).all() else (wavelengths, values)


def check_wavelengths(wavelengths: Floats, path: Path, code: str, *, whole: bool = True) -> None:
    """Check wavelengths: increasing, in nm, at least 6, no gap on the grid; with `whole`, covering 400 to 700 nm.

    Raises:
        InvalidArgument: they do not increase or are not in nm. Any other fault raises the error of this code.
    """
    steps = np.diff(wavelengths)
    if len(wavelengths) < 2 or not np.isfinite(wavelengths).all():
        raise InvalidArgument(f"{path} has fewer than two wavelengths, or one that is not a number.", _SORTED)
    _check_unit(float(wavelengths.min()), float(wavelengths.max()), path)
    if steps.min() < SMALLEST_STEP:
        at = int(steps.argmin())
        raise InvalidArgument(
            f"The wavelengths in {path} do not increase: {wavelengths[at]:g} is followed by {wavelengths[at + 1]:g}.",
            _SORTED,
        )
    ends = {"file": path, "first": wavelengths[0], "last": wavelengths[-1]}
    if whole and (wavelengths[0] > COVERED[0] or wavelengths[-1] < COVERED[1]):
        raise fail(f"{code}.narrow", **ends)
    inside = np.where((wavelengths[:-1] < WAVELENGTHS[-1]) & (wavelengths[1:] > WAVELENGTHS[0]), steps, 0.0)
    widest = int(inside.argmax())
    if len(wavelengths) < FEWEST_WAVELENGTHS:
        largest = float(steps.max())
        raise fail(f"{code}.few_wavelengths", value=largest, threshold=WIDEST_STEP, **ends, count=len(wavelengths))
    if steps[widest] > WIDEST_STEP:
        gap, first, last = (float(number) for number in (steps[widest], *wavelengths[widest : widest + 2]))
        raise fail(
            f"{code}.spectral_gap", value=gap, threshold=WIDEST_STEP, file=path, gap=gap, first=first, last=last
        )


def _check_unit(first: float, last: float, path: Path) -> None:
    """Raise if wavelengths from `first` to `last` are not in nm; name the unit that they would fit."""
    if NANOMETRES[0] <= first and last <= NANOMETRES[1] and not (ANGSTROMS[0] <= first and last <= ANGSTROMS[1]):
        return
    fits = (unit for unit, (low, high) in OTHER_UNITS.items() if low <= first and last <= high)
    unit = next(fits, None)
    ends = " to ".join(f"{end:.1e}" if 0 < end < 1e-3 else f"{end:g}" for end in (first, last))
    raise InvalidArgument(
        f"The wavelengths in {path} are not in nm: they run from {ends}" + (f", as in {unit}." if unit else "."),
        "Write 550 for green.",
    )


def held(wavelengths: Floats) -> str:
    """A note for `source` if a table does not cover the grid; else an empty text."""
    first, last = float(wavelengths.min()), float(wavelengths.max())
    if first <= WAVELENGTHS[0] and last >= WAVELENGTHS[-1]:
        return ""
    return f", held constant outside {first:g} to {last:g} nm"


def text_of(spec: str | PathLike[str] | None) -> str:
    """The given name or path without surrounding spaces; a Path is never a name.

    Raises:
        InvalidArgument: it is a URL, or contains one as in `nano24:https://...`.
    """
    if spec is None:
        return ""
    check_local(spec)
    text = (spec if isinstance(spec, str) else path_text(spec)).strip()
    check_local(text.partition(":")[2])
    return text
