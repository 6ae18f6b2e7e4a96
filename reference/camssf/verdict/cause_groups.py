"""What may have spoilt a shot, in groups that ask for the same advice."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

GROUPS = {
    "patch": ("patch",), "offset": ("gloss", "veil", "black"), "white": ("white",), "clipped": ("clipped",),
    "shadow": ("shadow",), "lights": ("lights",), "tone": ("tone",), "lamp": ("lamp", "tint"), "table": ("table",),
    "stranger": ("stranger",),
}  # fmt: skip
"""Causes that ask for the same advice, and those that photos cannot tell apart: another lamp or a tinted lens."""


@dataclass(frozen=True)
class Causes:
    """What may have spoilt a shot.

    Attributes:
        shot: 0-based.
        probability: of each of CAUSES that is possible, of LAMP, and of NONE.
        patch: 0-based, the likeliest one if a patch is the cause.
        basis: name of the answer's basis.
    """

    shot: int
    probability: Mapping[str, float]
    patch: int
    basis: str

    @property
    def group(self) -> str:
        """The likeliest of GROUPS."""
        return max(GROUPS, key=lambda group: sum(self.probability.get(name, 0.0) for name in GROUPS[group]))
