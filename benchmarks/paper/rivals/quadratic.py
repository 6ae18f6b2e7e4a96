"""Quadratic programming: the smoothest non-negative curve that explains the signals.

min ½ ‖(F s - y) / σ‖² + ½ w² ‖D² s‖² over s ≥ 0 on the 5-nm nodes. Without other constraints this program is a
non-negative least-squares problem, which SciPy solves exactly (Lawson and Hanson 1974).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from benchmarks.paper.rivals import Given, bends, between
from camssf.grid import Floats

NAME = "quadratic programme, smooth and non-negative"
WEIGHTS = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)


def estimate(given: Given, weight: float) -> Floats:
    """Curves (681, 3)."""
    rows, penalty = given.node_rows(), weight * bends()
    nodes = [
        nnls(np.vstack([rows / sigma[:, None], penalty]), np.concatenate([y / sigma, np.zeros(len(penalty))]))[0]
        for y, sigma in zip(given.signals.T, given.scale().T, strict=True)
    ]
    return between() @ np.stack(nodes, axis=1)
