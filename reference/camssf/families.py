"""Lamps that are known only by kind: a mean and modes of ln L, from CIE's tables and formulae.

Daylight and bulbs have a formula: the family is its colour temperature, known to so many kelvin; its one mode is
the change of ln L over one standard deviation, taken at the family's centre; nothing is searched. White LEDs and
fluorescent lamps have tables: the modes are the principal components of ln L of the table's lamps, each one standard
deviation long. A scale of L is no evidence, so every ln L is taken about its mean over the grid.
`python -m benchmarks.lamps` prints how much of a lamp left out its family explains.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from camssf.grid import Floats

DIMMEST = 1e-3
"""Power below this share of a lamp's peak counts as this: its logarithm would rule the modes, no camera sees it."""


@dataclass(frozen=True)
class Temperature:
    """A family with a formula: centre and one standard deviation, K."""

    centre: float
    spread: float


@dataclass(frozen=True)
class Kind:
    """A family of tables: the CIE illuminants it is made of, how many components are kept, and what these leave.

    `left` is the RMS of ln L that the modes of the others leave of a lamp left out, as `python -m benchmarks.lamps`
    measures it: the family's smooth tolerance.
    """

    members: tuple[str, ...]
    components: int
    left: float


FAMILIES: dict[str, Temperature | Kind] = {
    "daylight": Temperature(5800.0, 900.0),
    "bulb": Temperature(2700.0, 250.0),
    "white-led": Kind((*(f"LED-B{i}" for i in range(1, 6)), "LED-BH1", "LED-V1", "LED-V2"), 5, 0.09),
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
    """Mean power (681,) and modes (q, 681) of ln L of lamps (681,)."""
    logs = logarithm(np.stack(lamps))
    mean = logs.mean(axis=0)
    _, spread, directions = np.linalg.svd(logs - mean, full_matrices=False)
    q = min(components, len(logs) - 1)
    modes = directions[:q] * (spread[:q, None] / np.sqrt(len(logs) - 1))
    return np.exp(mean), modes
