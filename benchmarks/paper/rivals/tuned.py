"""l1 on Gaussians as in paper.py, but γ is the best on the other makers' cameras: more than the paper asks for."""

from __future__ import annotations

from benchmarks.paper.rivals import Given
from camssf.grid import Floats
from camssf.recovery.hypotheses import recover
from camssf.recovery.sensitivity import SolverSettings

NAME = "l1 on Gaussians, γ tuned"
WEIGHTS = (1.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0)
"""γ."""


def estimate(given: Given, weight: float) -> Floats:
    """Curves (681, 3)."""
    return recover(given.observation(), basis="gaussian", settings=SolverSettings(gamma=weight)).values
