"""Reads wavelengths and values from objects and arrays. It needs no library, only the objects' attributes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from camssf.errors import InvalidArgument
from camssf.grid import Floats


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


def is_one(given: Any) -> bool:
    """Whether this is one spectrum or one set of spectra, not a list of them."""
    return hasattr(given, "wavelengths") or isinstance(given, Mapping) or _is_pair(given)


def sampled(given: Any, kind: str, advice: str) -> Sampled:
    """Read the spectra of an object, of a mapping from names to objects, or of a pair of arrays.

    Args:
        given: any value; it is checked.
        kind: the expected kind for messages, for example "lamp".
        advice: advice for messages.

    Raises:
        InvalidArgument: it is none of these, or the shapes of its arrays do not match.
    """
    if isinstance(given, Mapping) and given:
        parts = [sampled(each, kind, advice) for each in given.values()]
        first = parts[0].wavelengths
        if any(len(part.values) != 1 or not np.array_equal(part.wavelengths, first) for part in parts):
            raise InvalidArgument(f"The spectra of this {kind} differ in their wavelengths.", advice)
        names = tuple(str(name) for name in given)
        return Sampled(f"{kind} (given)", "given as objects", names, first, np.concatenate([p.values for p in parts]))
    if hasattr(given, "wavelengths") and hasattr(given, "values"):
        name, source = _name(given, kind), f"given as an object, {type(given).__name__}"
        pair, labels = (given.wavelengths, given.values), tuple(str(each) for each in getattr(given, "labels", ()))
        turned = True  # one spectrum per column
    elif _is_pair(given):
        name, source, pair, labels = f"{kind} (given)", "given as arrays", tuple(given), ()
        turned = False
    else:
        raise InvalidArgument(f"A {type(given).__name__} is no {kind}.", advice)
    try:
        wavelengths, values = (np.array(each, dtype=np.float64) for each in pair)
    except (TypeError, ValueError) as error:
        raise InvalidArgument(f"The {kind} holds a value that is not a number.", advice) from error
    if values.ndim == 2 and turned:
        values = values.T
    if wavelengths.ndim != 1 or values.ndim not in (1, 2) or values.shape[-1:] != wavelengths.shape:
        shapes = f"{wavelengths.shape} and {values.shape}"
        raise InvalidArgument(f"The {kind}'s wavelengths and values have the shapes {shapes}.", advice)
    return Sampled(name, source, labels, wavelengths, np.atleast_2d(values))


def _name(given: Any, kind: str) -> str:
    """The object's own name, marked as given, so that D65 in a result always means the table."""
    words = " ".join(str(getattr(given, "name", "") or kind).replace("/", " ").replace("\\", " ").split())
    return f"{words[:80]} (given)"


def _is_pair(given: Any) -> bool:
    """Whether this is a pair of numeric arrays, not two names, two lamps or two such pairs."""
    if isinstance(given, str | bytes) or not hasattr(given, "__len__") or len(given) != 2:
        return False
    try:
        first, second = (np.asarray(each, dtype=np.float64) for each in given)
    except (TypeError, ValueError, KeyError):
        return False
    return first.ndim == 1 and second.ndim in (1, 2)
