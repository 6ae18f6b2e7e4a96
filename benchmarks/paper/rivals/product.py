"""camssf's default: the elastic net on the learned basis, λ₂ = 1, γ = 0.05."""

from __future__ import annotations

from benchmarks.paper.rivals import Given
from camssf.grid import Floats
from camssf.recovery.hypotheses import recover
from camssf.recovery.sensitivity import SolverSettings

NAME = "elastic net on cameras (camssf)"
WEIGHTS = (0.0,)


def estimate(given: Given, weight: float) -> Floats:
    """Curves (681, 3)."""
    del weight
    return recover(given.observation(), basis=given.basis, settings=SolverSettings(engine="reference")).values
