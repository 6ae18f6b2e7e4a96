"""PCA subspace of measured cameras, least squares in it: Jiang et al. (2013) as colour-science has it.

The free number is how many eigenvectors are kept. The library knows no noise, so rows count alike.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from benchmarks.paper.rivals import Given, between
from camssf.grid import STEP, Floats
from camssf.recovery.basis import NODES
from camssf.spectra import colour_science

NAME = "PCA subspace (Jiang 2013, colour-science)"
WEIGHTS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0)


def estimate(given: Given, weight: float) -> Floats:
    """Curves (681, 3)."""
    colour = colour_science()
    eigenvectors = _eigenvectors(given.training.tobytes(), len(given.training))
    # On nodes the product of reflectance and lamp is what a curve straight between them is weighed by.
    rows = given.node_rows() / (5.0 / STEP)
    lamp = colour.SpectralDistribution(np.ones(NODES.size), NODES)
    patches = colour.MultiSpectralDistributions(rows.T, NODES, [str(i) for i in range(len(rows))])
    shape = colour.SpectralShape(NODES[0], NODES[-1], 5)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # colour-science announces alignments that do not happen
        found = [
            colour.recovery.RGB_to_sd_camera_sensitivity_Jiang2013(
                y, lamp, patches, vectors[:, : int(weight)], shape
            ).values
            for y, vectors in zip(given.signals.T, eigenvectors, strict=True)
        ]
    return between() @ np.stack(found, axis=1)


_KNOWN: dict[bytes, Any] = {}


def _eigenvectors(key: bytes, count: int) -> Any:
    """Of R, G, B, (69, 69) each; they take longer than the fit, so each training set's are kept."""
    if key not in _KNOWN:
        colour = colour_science()
        curves = np.frombuffer(key).reshape(count, NODES.size, 3)
        cameras = {
            str(i): colour.characterisation.RGB_CameraSensitivities(curve, NODES, labels=["red", "green", "blue"])
            for i, curve in enumerate(curves)
        }
        _KNOWN[key] = colour.recovery.PCA_Jiang2013(cameras, NODES.size)
    return _KNOWN[key]
