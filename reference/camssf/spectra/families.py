"""Lamps of which only the kind is known: a mean spectrum and modes, the directions of its relative error.

Bulbs have a formula with one parameter, the colour temperature: their one mode is the change of ln L over one
standard deviation at the family's centre. Fluorescent lamps have a table: the modes are the principal components of
its lamps. Daylight and white LEDs are drawn at random by formulas (`tools.lamp_kinds`), and mean and principal
components are in data/spectra.json. Power is used for these, not its logarithm, because signals are sums of power;
all lamps have the same mean power, because the scale of L carries no information. `python -m benchmarks lamps`
prints how much of a left-out lamp its family explains.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from camssf.grid import Floats
from camssf.spectra.limits import DIMMEST


@dataclass(frozen=True)
class Temperature:
    """A family with a formula: centre and one standard deviation of its colour temperature, K."""

    centre: float
    spread: float


@dataclass(frozen=True)
class LampKind:
    """A family of tables: its CIE illuminants, the number of components, and the residual.

    `left` is the residual of a left-out lamp after fitting the modes of the others, RMS relative to the mean lamp
    from 400 to 700 nm, as `python -m benchmarks lamps` measures it. It is the family's smooth tolerance.
    """

    members: tuple[str, ...]
    components: int
    left: float


@dataclass(frozen=True)
class DrawnKind:
    """A family of lamps drawn by formulas, tabulated in data/spectra.json; `words` describes them for the report."""

    words: str


FAMILIES: dict[str, Temperature | LampKind | DrawnKind] = {
    "daylight": DrawnKind("CIE daylight, 4,200 to 23,800 K"),
    "bulb": Temperature(2700.0, 250.0),
    "white-led": DrawnKind("white LEDs by formula, pump and phosphors, 2,500 to 7,000 K"),
    "fluorescent": LampKind((*(f"FL{i}" for i in range(1, 13)), *(f"FL3.{i}" for i in range(1, 16))), 8, 0.06),
}
"""The prior of temperature covers common bulbs."""


def logarithm(power: Floats) -> Floats:
    """ln L minus its mean over the grid, (..., 681)."""
    level = np.log(np.maximum(power, DIMMEST * power.max(axis=-1, keepdims=True)))
    return np.asarray(level - level.mean(axis=-1, keepdims=True))


def temperature_mode(formula: Callable[[float], Floats], centre: float, spread: float) -> Floats:
    """Change of ln L over one standard deviation of the temperature, (1, 681), by a central difference."""
    rise = logarithm(formula(centre + spread)) - logarithm(formula(centre - spread))
    return np.asarray(0.5 * rise[None])


def principal_modes(lamps: Sequence[Floats], components: int) -> tuple[Floats, Floats]:
    """Mean power (681,) and modes (q, 681) of lamps (681,), all scaled to the same mean power.

    The length of a mode is one standard deviation of a new lamp. The variance estimated from n lamps is multiplied by
    (n + 1) (n - 1) / (n (n - 3)) for this, the variance of Student's predictive distribution.

    Args:
        lamps: at least four.
        components: q, at most n - 1.
    """
    shapes = np.stack(lamps)
    shapes = shapes / shapes.mean(axis=1, keepdims=True)
    mean = shapes.mean(axis=0)
    weights = np.linalg.svd(shapes - mean, full_matrices=False)[0].T  # of each lamp in each component
    n, q = len(shapes), min(components, len(shapes) - 1)
    modes = np.sqrt((n + 1) / (n * (n - 3))) * (weights[:q] @ (shapes - mean))
    return mean, modes / np.maximum(mean, DIMMEST * mean.max())
