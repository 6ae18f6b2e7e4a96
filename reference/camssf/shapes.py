"""What a field of a document may hold: bounds and shapes, declared with the field's type.

A field of a frozen dataclass says it once, as `mean: Rows`; `documents.forms` reads, writes, checks and describes it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from camssf.grid import WAVELENGTHS, Floats

MOST = 1e12
"""Largest number that is accepted; sums of squares of much larger ones would overflow."""
MOST_PATCHES = 1000
"""Largest number of patches of a chart."""
MOST_SHOTS = 64
"""Largest number of shots of a capture."""


@dataclass(frozen=True)
class Bounds:
    """Bounds of a number; of a text or a list, of its length."""

    least: float = -MOST
    most: float = MOST


@dataclass(frozen=True)
class Pattern:
    """Regular expression that a whole text matches, and what that means in words."""

    expression: str
    words: str


@dataclass(frozen=True)
class Words:
    """The texts that are possible."""

    options: tuple[str, ...]


@dataclass(frozen=True)
class Shape:
    """Shape of an array and bounds of its numbers.

    Attributes:
        sides: lengths; None for any length from 1 on, the first from `fewest` on.
        least, most: bounds.
        whole: whether the numbers are whole; the array is then of int64.
        gaps: whether rows along the last axis may be missing: null in the file, NaN in the array.
    """

    sides: tuple[int | None, ...]
    least: float = -MOST
    most: float = MOST
    whole: bool = False
    gaps: bool = False
    fewest: int = 1


class Apart:
    """Marks a field that no document holds; it has a default."""


def _shape(*sides: int | None, **bounds: Any) -> Shape:
    return Shape(sides, **bounds)


Text: TypeAlias = Annotated[str, Bounds(0, 4096)]
Sha256: TypeAlias = Annotated[str, Pattern("[0-9a-f]{64}", "must be 64 hex digits")]
Number: TypeAlias = Annotated[float, Bounds()]
Size: TypeAlias = Annotated[float, Bounds(0.0)]
Positive: TypeAlias = Annotated[float, Bounds(1e-9)]
Share: TypeAlias = Annotated[float, Bounds(0.0, 1.0)]
Count: TypeAlias = Annotated[int, Bounds(0, 10**9)]
Whole: TypeAlias = Annotated[int, Bounds(1, 10**9)]
Argument: TypeAlias = str | int | float

_GRID = WAVELENGTHS.size
Spectrum: TypeAlias = Annotated[Floats, _shape(_GRID)]
Power: TypeAlias = Annotated[Floats, _shape(_GRID, least=0.0)]
Spectra: TypeAlias = Annotated[Floats, _shape(None, _GRID)]
Rgb: TypeAlias = Annotated[Floats, _shape(3)]
RgbSizes: TypeAlias = Annotated[Floats, _shape(3, least=0.0)]
Modes: TypeAlias = Annotated[Floats, _shape(None, _GRID, fewest=0)]
Vector: TypeAlias = Annotated[Floats, _shape(None)]
Sizes: TypeAlias = Annotated[Floats, _shape(None, least=0.0)]
Tolerances: TypeAlias = Annotated[Floats, _shape(None, least=0.0, most=0.5)]
Counts: TypeAlias = Annotated[NDArray[np.int64], _shape(None, least=0, whole=True)]
Rows: TypeAlias = Annotated[Floats, _shape(None, 3)]
RowSizes: TypeAlias = Annotated[Floats, _shape(None, 3, least=0.0)]
RowShares: TypeAlias = Annotated[Floats, _shape(None, 3, least=0.0, most=1.0)]
RowCounts: TypeAlias = Annotated[NDArray[np.int64], _shape(None, 3, least=1, most=1e15, whole=True)]
Levels: TypeAlias = Annotated[Floats, _shape(None, None)]
ShotRows: TypeAlias = Annotated[Floats, _shape(None, None, 3)]
ShotRowGaps: TypeAlias = Annotated[Floats, _shape(None, None, 3, gaps=True)]
Greens: TypeAlias = Annotated[Floats, _shape(None, 2)]
Reflectances: TypeAlias = Annotated[Floats, _shape(None, None, least=0.0, most=2.0)]
Quad: TypeAlias = Annotated[Floats, _shape(4, 2)]
Quads: TypeAlias = Annotated[Floats, _shape(None, 4, 2)]
