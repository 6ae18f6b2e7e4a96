"""Other ways from patches to curves, one a file behind one signature: NAME, WEIGHTS, `estimate(given, weight)`.

`estimate` returns curves (681, 3), any scale. WEIGHTS are the values that a method's one free number may take; the
bench chooses among them on the cameras of other makers, whose truth it may look at. A method without one has (0.0,).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import Protocol, cast

import numpy as np

from camssf.grid import STEP, Floats
from camssf.recovery.basis import NODES, Basis, interpolate
from camssf.recovery.covariance import FLOOR
from camssf.recovery.observation import Observation


@dataclass(frozen=True)
class Given:
    """What every method is told.

    Attributes:
        signals: (n, 3) of Eq. (5).
        standard_error: (n, 3) of the signals; 0 without noise.
        reflectance: (n, 681).
        lamp: (681,) as the method believes it to be.
        training: (cameras, 69, 3) on the 5-nm nodes, peak 1; no camera of this maker among them.
        basis: learned from the same cameras.
    """

    signals: Floats
    standard_error: Floats
    reflectance: Floats
    lamp: Floats
    training: Floats
    basis: Basis

    def rows(self) -> Floats:
        """F (n, 681) of the paper's Eq. (8): R L dλ, with Σ L dλ = 1, so that F s = y."""
        return self.reflectance * self.lamp * STEP / (self.lamp.sum() * STEP)

    def node_rows(self) -> Floats:
        """The same for a curve that runs straight between the 5-nm nodes, (n, 69)."""
        return self.rows() @ between()

    def observation(self) -> Observation:
        """For camssf's own solver; no error is declared but the noise."""
        return Observation(
            self.signals, self.reflectance, self.lamp, standard_error=self.standard_error,
            chart_tolerance=0.0, white_tolerance=0.0,
        )  # fmt: skip

    def scale(self) -> Floats:
        """(n, 3) by which a row and its signal are divided, so that their noise is 1; never below 1e-4."""
        return np.maximum(self.standard_error, FLOOR)


class Method(Protocol):
    """One file of this folder."""

    NAME: str
    WEIGHTS: tuple[float, ...]
    estimate: Callable[[Given, float], Floats]


TABLE_1 = ("quadratic", "tikhonov", "subspace", "wiener", "ranks", "gaussians")
"""The families of the paper's Table 1."""
OURS = ("paper", "tuned", "sparse", "product")
FIGURE_4 = ("qr", "pinv")


def method(name: str) -> Method:
    """The file of that name."""
    return cast(Method, import_module(f"benchmarks.paper.rivals.{name}"))


@cache
def between() -> Floats:
    """(681, 69) from nodes to the grid, straight lines."""
    return interpolate(np.eye(NODES.size))


@cache
def bends() -> Floats:
    """(67, 69) second differences of a curve on its nodes, times 16: of the bend over 20 nm."""
    return np.asarray(16.0 * np.diff(np.eye(NODES.size), 2, axis=0))
