"""l1 alone on the learned basis, γ = 1.4 (the best of docs/accuracy.md), by camssf's own solver."""

from __future__ import annotations

from benchmarks.paper.rivals import Given
from camssf.grid import Floats
from camssf.recovery.hypotheses import recover
from camssf.recovery.sensitivity import SolverSettings

NAME = "l1 on cameras"
WEIGHTS = (0.0,)


def estimate(given: Given, weight: float) -> Floats:
    """Curves (681, 3)."""
    del weight
    return recover(
        given.observation(), basis=given.basis, settings=SolverSettings(l2=0.0, gamma=1.4, engine="reference")
    ).values
