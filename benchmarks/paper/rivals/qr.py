r"""QR with non-negativity, one of the paper's two comparisons in Fig. 4.

The basic solution of the underdetermined F s = y by QR with column pivoting (what MATLAB's `F \ y` gives): as many
wavelengths as patches respond, all others are 0. How the paper makes it non-negative it does not say, nor whether
the unknowns are wavelengths or Gaussians, hence four readings.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.optimize import nnls

from benchmarks.paper.rivals import Given
from camssf.grid import Floats
from camssf.recovery.basis import gaussian_basis

NAME = "QR with non-negativity"
READINGS = ("wavelengths, clipped", "wavelengths, NNLS", "Gaussians, clipped", "Gaussians, NNLS")
WEIGHTS = (0.0, 1.0, 2.0, 3.0)
"""Which reading."""


def estimate(given: Given, weight: float) -> Floats:
    """Curves (681, 3)."""
    reading = READINGS[int(weight)]
    atoms = gaussian_basis().dictionary[0] if reading.startswith("Gaussians") else np.eye(given.lamp.size)
    rows = given.rows() @ atoms
    if reading.endswith("NNLS"):  # active sets, each solved by QR: a basic solution that never was negative
        codes = [nnls(rows, y)[0] for y in given.signals.T]
    else:
        codes = [np.maximum(basic(rows, y), 0.0) for y in given.signals.T]
    return atoms @ np.stack(codes, axis=1)


def basic(rows: Floats, y: Floats) -> Floats:
    """The solution of rows x = y (n, r), n ≤ r, with at most n entries, by QR with column pivoting."""
    count = min(rows.shape)
    q, r, order = qr(rows, mode="economic", pivoting=True)
    x = np.zeros(rows.shape[1])
    x[order[:count]] = solve_triangular(r[:count, :count], (q.T @ y)[:count])
    return x
