"""The paper: l1 on Gaussians, x ≥ 0, γ by the discrepancy principle (its Eq. (9)), by camssf's own solver."""

from __future__ import annotations

from benchmarks.paper.rivals import Given
from camssf.grid import Floats
from camssf.recovery.hypotheses import recover

NAME = "l1 on Gaussians (the paper)"
WEIGHTS = (0.0,)


def estimate(given: Given, weight: float) -> Floats:
    """Curves (681, 3)."""
    del weight
    return recover(given.observation(), basis="gaussian").values
