"""camssf's default: the elastic net on the learned basis, λ₂ = 1, γ = 0.05."""

from __future__ import annotations

from benchmarks.rivals import Given
from camssf.grid import Floats
from camssf.recovery.hypotheses import recover
from camssf.recovery.observation import Observation
from camssf.recovery.sensitivity import SolverSettings

NAME = "elastic net on cameras (camssf)"
WEIGHTS = (0.0,)


def estimate(given: Given, weight: float) -> Floats:
    """Curves (681, 3)."""
    del weight
    return recover(
        Observation(
            given.signals,
            given.reflectance,
            given.lamp,
            standard_error=given.standard_error,
            chart_tolerance=0.0,
            white_tolerance=0.0,
        ),
        basis=given.basis,
        settings=SolverSettings(engine="reference"),
    ).values
