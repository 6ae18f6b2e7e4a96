"""The wavelength grid of every spectrum, 380 to 720 nm every 0.5 nm as in the paper; the channels' order; a band."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]
"""An array of float64; each docstring gives its shape and unit."""

STEP = 0.5
"""Spacing of the grid, nm; the dλ of every integral."""

WAVELENGTHS: Floats = np.linspace(380.0, 720.0, 681)
"""The grid, shape (681,), nm."""
WAVELENGTHS.setflags(write=False)

CHANNELS = ("red", "green", "blue")
"""Names of the channels in the order of every array's channel axis."""

BAND = 1.96
"""Half-width of a 95 % band, in standard deviations."""


def columns(curves: Mapping[str, Sequence[float]]) -> Floats:
    """Red, green and blue of a document, side by side: (m, 3)."""
    return np.stack([np.array(curves[channel], dtype=np.float64) for channel in CHANNELS], axis=1)


def frozen(values: Floats) -> Floats:
    """A read-only copy."""
    values = np.array(values, dtype=np.float64)
    values.setflags(write=False)
    return values
