"""Tikhonov: least squares with a penalty on second differences, in closed form; the curve may be negative."""

from __future__ import annotations

import numpy as np
from scipy.linalg import lstsq

from benchmarks.paper.rivals import Given, bends, between
from camssf.grid import Floats

NAME = "Tikhonov, second differences"
WEIGHTS = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)


def estimate(given: Given, weight: float) -> Floats:
    """Curves (681, 3)."""
    rows, penalty = given.node_rows(), weight * bends()
    nodes = [
        lstsq(np.vstack([rows / sigma[:, None], penalty]), np.concatenate([y / sigma, np.zeros(len(penalty))]))[0]
        for y, sigma in zip(given.signals.T, given.scale().T, strict=True)
    ]
    return between() @ np.stack(nodes, axis=1)
