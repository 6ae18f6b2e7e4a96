"""Lamps that are known only by kind: a mean and modes, the directions in which L may be off, relative to the mean.

Daylight and bulbs have a formula: the family is its colour temperature, known to so many kelvin; its one mode is
the change of ln L over one standard deviation, taken at the family's centre; nothing is searched. White LEDs and
fluorescent lamps have tables: the modes are the principal components of the table's lamps, of power and not of its
logarithm, since signals are sums of power, and of one mean power, since a scale of L is no evidence.
`python -m benchmarks.lamps` prints how much of a lamp left out its family explains.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from camssf.grid import Floats

DIMMEST = 1e-3
"""Where a lamp has less than this share of its peak, it counts as having this: no logarithm, no ratio without end."""


@dataclass(frozen=True)
class Temperature:
    """A family with a formula: centre and one standard deviation, K."""

    centre: float
    spread: float


@dataclass(frozen=True)
class Kind:
    """A family of tables: the CIE illuminants it is made of, how many components are kept, and what these leave.

    `left` is what the modes of the others leave of a lamp left out, RMS relative to the mean lamp from 400 to 700 nm,
    as `python -m benchmarks.lamps` measures it: the family's smooth tolerance.
    """

    members: tuple[str, ...]
    components: int
    left: float


FAMILIES: dict[str, Temperature | Kind] = {
    "daylight": Temperature(5800.0, 900.0),
    "bulb": Temperature(2700.0, 250.0),
    "white-led": Kind((*(f"LED-B{i}" for i in range(1, 6)), "LED-BH1", "LED-V1", "LED-V2"), 5, 0.17),
    "fluorescent": Kind((*(f"FL{i}" for i in range(1, 13)), *(f"FL3.{i}" for i in range(1, 16))), 8, 0.06),
}
"""The prior of a temperature is what outdoor light and sold bulbs span; LED-RGB1 is no white LED of a lamp shop."""


def logarithm(power: Floats) -> Floats:
    """ln L about its mean over the grid, (..., 681)."""
    level = np.log(np.maximum(power, DIMMEST * power.max(axis=-1, keepdims=True)))
    return np.asarray(level - level.mean(axis=-1, keepdims=True))


def temperature_mode(formula: Callable[[float], Floats], centre: float, spread: float) -> Floats:
    """Change of ln L over one standard deviation of its temperature, (1, 681): a central difference."""
    rise = logarithm(formula(centre + spread)) - logarithm(formula(centre - spread))
    return np.asarray(0.5 * rise[None])


def principal_modes(lamps: Sequence[Floats], components: int) -> tuple[Floats, Floats]:
    """Mean power (681,) and modes (q, 681) of lamps (681,), all taken at the same mean power.

    Modes are one standard deviation of a further lamp long. A spread estimated from n lamps falls short of that by
    (n + 1) (n - 1) / (n (n - 3)) in squared length, the variance of Student's predictive distribution.

    Args:
        lamps: at least four.
        components: q, at most n - 1.
    """
    shapes = np.stack(lamps)
    shapes = shapes / shapes.mean(axis=1, keepdims=True)
    mean = shapes.mean(axis=0)
    weights = np.linalg.svd(shapes - mean, full_matrices=False)[0].T  # of the lamps in each component
    n, q = len(shapes), min(components, len(shapes) - 1)
    modes = np.sqrt((n + 1) / (n * (n - 3))) * (weights[:q] @ (shapes - mean))
    return mean, modes / np.maximum(mean, DIMMEST * mean.max())
