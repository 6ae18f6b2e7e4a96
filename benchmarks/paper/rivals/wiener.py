"""Wiener: the linear estimate of least mean square error for cameras like the measured ones.

s = K Fᵀ (F K Fᵀ + w² σ²)⁻¹ y with K the second moments of the other makers' cameras, scaled to white as the signals
are (Pratt and Mancill 1976). w = 1 trusts the noise as measured; with few cameras more may serve better.
"""

from __future__ import annotations

import numpy as np

from benchmarks.paper.rivals import Given, between
from camssf.grid import Floats

NAME = "Wiener"
WEIGHTS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)


def estimate(given: Given, weight: float) -> Floats:
    """Curves (681, 3)."""
    rows = given.node_rows()
    white = (given.lamp / given.lamp.sum()) @ between()
    found = []
    for c, (y, sigma) in enumerate(zip(given.signals.T, given.scale().T, strict=True)):
        cameras = given.training[:, :, c] / (given.training[:, :, c] @ white)[:, None]
        moments = cameras.T @ cameras / len(cameras)
        seen = rows @ moments
        found.append(seen.T @ np.linalg.solve(seen @ rows.T + np.diag((weight * sigma) ** 2), y))
    return between() @ np.stack(found, axis=1)
