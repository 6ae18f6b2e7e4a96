"""Indices of skin from its absorbance, -log₁₀ of reflectance, with their standard deviation."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from camssf.errors import InvalidArgument
from camssf.files import local
from camssf.grid import Floats, frozen
from camssf.rules import rules
from camssf.spectra.bundled import SURFACE_NODES
from camssf.spectra.tables import read_spectrum
from camssf_colour.reflectance import SurfaceSpectra

INDICES = ("erythema", "melanin")
"""Erythema: the mean absorbance from 540 to 575 nm, less that at 650 nm. Melanin: the mean from 650 to 700 nm."""
DARKEST = rules().number("surfaces.darkest")
FINE: Floats = np.arange(380.0, 720.5, 1.0)


def absorbance(reflectance: Floats) -> Floats:
    """-log₁₀ of reflectances (..., 35)."""
    return np.asarray(-np.log10(np.maximum(reflectance, DARKEST)))


def indices(spectra: SurfaceSpectra, weights: Floats) -> tuple[Floats, Floats]:
    """An index of m spectra and its standard deviation, (m,) each.

    Args:
        spectra: of m surfaces.
        weights: (35,) of the absorbance at SURFACE_NODES, from `index_weights`.
    """
    reflectance = np.maximum(spectra.reflectance, DARKEST)
    slopes = -weights / (reflectance * np.log(10.0))
    variance = np.einsum("mi,mij,mj->m", slopes, spectra.covariance, slopes)
    return absorbance(reflectance) @ weights, np.sqrt(np.maximum(variance, 0.0))


@cache
def shipped_index(name: str) -> Floats:
    """Weights (35,) of an index in INDICES."""
    red = _mean(650.0, 650.0) if name == "erythema" else np.zeros(SURFACE_NODES.size)
    return frozen((_mean(540.0, 575.0) if name == "erythema" else _mean(650.0, 700.0)) - red)


def index_weights(spec: str) -> tuple[str, Floats]:
    """Name and weights (35,) of an index.

    Args:
        spec: one of INDICES, or a file of two columns: wavelength in nm, and weight of the absorbance there. The
            index is the sum of weight times absorbance, which is linear between the nodes; its name is the file's.

    Raises:
        InvalidArgument: an unknown name, or a file that cannot be read or leaves 380 to 720 nm.
    """
    if spec in INDICES:
        return spec, shipped_index(spec)
    path = local(spec)
    if not path.suffix:
        raise InvalidArgument(f"No index is called {spec!r}.", f"Take {' or '.join(INDICES)}, or a file of weights.")
    at, weights = read_spectrum(path)
    return Path(spec).stem, frozen(weights @ _between_nodes(at, path))


def _between_nodes(at: Floats, path: Path) -> Floats:
    """(w, 35) values at wavelengths of the functions that are 1 at one node and linear between the nodes."""
    if not (np.isfinite(at).all() and at.min() >= SURFACE_NODES[0] and at.max() <= SURFACE_NODES[-1]):
        raise InvalidArgument(f"{path} has a wavelength outside 380 to 720 nm.", "Leave that row out.")
    return np.stack([np.interp(at, SURFACE_NODES, row) for row in np.eye(SURFACE_NODES.size)], axis=1)


def _mean(first: float, last: float) -> Floats:
    """Weights (35,) of the mean between two wavelengths."""
    inside = FINE[(first <= FINE) & (last >= FINE)]
    return np.asarray(_between_nodes(inside, Path()).mean(axis=0))
