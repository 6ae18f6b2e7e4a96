"""The Moore-Penrose pseudo-inverse with non-negativity, the other comparison of the paper's Fig. 4.

s = F⁺ y is the smallest curve that gives the signals. Four readings, as in qr.py; by NNLS it is the smallest among
the non-negative ones, found as the limit of a vanishing ridge.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import pinv
from scipy.optimize import nnls

from benchmarks.paper.rivals import Given
from benchmarks.paper.rivals.qr import READINGS
from camssf.grid import Floats
from camssf.recovery.basis import gaussian_basis

NAME = "pseudo-inverse with non-negativity"
WEIGHTS = (0.0, 1.0, 2.0, 3.0)
"""Which reading."""
RIDGE = 1e-6
"""Of the largest singular value: below what the signals can tell, above rounding."""


def estimate(given: Given, weight: float) -> Floats:
    """Curves (681, 3)."""
    reading = READINGS[int(weight)]
    atoms = gaussian_basis().dictionary[0] if reading.startswith("Gaussians") else np.eye(given.lamp.size)
    rows = given.rows() @ atoms
    if reading.endswith("NNLS"):
        ridge = RIDGE * np.linalg.norm(rows, 2)
        system = np.vstack([rows, ridge * np.eye(rows.shape[1])])
        codes = [
            nnls(system, np.concatenate([y, np.zeros(rows.shape[1])]), maxiter=20_000)[0] for y in given.signals.T
        ]
        return atoms @ np.stack(codes, axis=1)
    return np.asarray(atoms @ np.maximum(pinv(rows) @ given.signals, 0.0))
